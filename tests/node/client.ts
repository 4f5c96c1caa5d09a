/** A client with types from the OpenAPI document, as a stranger writes it; tests/server/test_clients.py compiles and runs it. */

import { readFileSync } from "node:fs";
import createClient from "openapi-fetch";
import type { paths } from "./api";

const [url = "", path = ""] = process.argv.slice(2);
const client = createClient<paths>({ baseUrl: url });
const photo = new Blob([readFileSync(path)], { type: "image/jpeg" });

/** A form with a photo so often, and with parameters. */
const form = (times: number, parameters: Record<string, string> = {}) => ({
  body: { photo: [""] as never },
  bodySerializer: () => {
    const fields = new FormData();
    for (let count = 0; count < times; count++) fields.append("photo", photo, "photo.jpg");
    for (const [name, value] of Object.entries(parameters)) fields.set(name, value);
    return fields;
  },
});

const one = await client.POST("/v1/lighting", { params: { query: { probability: true } }, ...form(1) });
if (!one.data) throw new Error(one.error.detail);
const azimuth: number = one.data.sun.azimuth;

const two = await client.POST("/v1/lightings", form(2, { match: "false" }));
if (!two.data) throw new Error(two.error.detail);
const lights: number = two.data.lightings.length;

const map = await client.POST("/v1/envmap", {
  params: { query: { height: 16, format: "hdr" } },
  ...form(1),
  parseAs: "arrayBuffer",
});
if (!map.data) throw new Error("no map");

const wrong = await client.POST("/v1/lighting", form(1, { vertical_fov: "999" }));
const field: string | undefined = wrong.error?.errors?.[0]?.field;

const model = await client.GET("/v1/model");
const tools: string[] = model.data?.scene_tools ?? [];

console.log(JSON.stringify({ azimuth, lights, bytes: map.response.status, field, tools, jobs: model.data?.jobs }));
