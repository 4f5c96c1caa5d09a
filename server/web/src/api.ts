/** The service as the page uses it. Paths are relative, so that it also works behind a proxy's prefix. */

import { apiKey, keyHeader } from "./key";
import type { Factors } from "./picture/factors";
import type { Camera } from "./pure/camera";
import type { Distribution } from "./pure/distribution";
import { type Given, givenQuery } from "./pure/given";
import type { Triple } from "./sky/model";

/** The record of a photo's light, as the service answers it; what may be missing is newer than some networks. */
export interface Lighting {
  model: { name: string; version: string };
  suitable?: number; // probability that this is an outdoor daylight photo
  sun: {
    azimuth: number;
    elevation: number;
    direction: [number, number, number];
    visibility: number;
    irradiance?: Triple; // of a plane that faces it
    radius_50: number;
    radius_90: number;
  };
  sky: {
    model: string;
    turbidity: number;
    ground_albedo: number;
    exposure: number;
    cover?: number; // 0 clear to 1 overcast
    irradiance?: Triple; // of level ground
    coefficients?: unknown;
  };
  ground?: { color: Triple };
  camera: Camera & { heading?: number; heading_radius_50?: number; relative_heading?: number };
  evidence: string[];
  warnings: string[];
}

/** The record of a light that was changed by hand: what the estimate said of itself is no longer in it. */
export type Edited = Omit<Lighting, "sun"> & { sun: Omit<Lighting["sun"], "radius_50" | "radius_90"> };

export interface Estimate extends Lighting {
  links: { envmap: string };
  probability: Distribution;
  surroundings?: Factors; // what the place makes of the bare map, where the network says what lies around
}

/** The strength of a light, in the photo's linear values. */
export interface Power {
  sun: Triple; // irradiance of a plane that faces the sun
  sky: Triple; // irradiance of level ground
}

/** What an environment map is rendered from. */
export interface Parameters {
  sun_azimuth: number;
  sun_elevation: number;
  turbidity: number;
  exposure: number;
  ground_albedo: number;
  sun: boolean; // whether the disc is painted
}

/** A light, and perhaps a camera, in place of the estimated ones. Where it states no power, the estimate's follows the other parameters. */
export interface Changed extends Parameters {
  sun_irradiance?: Triple;
  sky_irradiance?: Triple;
  sky_cover?: number;
  ground_color?: Triple;
  photo_exposure?: number; // at which the photo is as it is
  camera_elevation?: number;
  camera_roll?: number;
  vertical_fov?: number;
}

export type Format = "exr" | "hdr" | "png";

/** A refusal by the service, in its own words; status 0 where there was no answer. */
export class Refusal extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    detail: string,
  ) {
    super(detail);
  }

  /** The same with the file's name, where the file is what was refused. */
  of(file: File): Refusal {
    const itsFault = [400, 413, 415].includes(this.status);
    return itsFault ? new Refusal(this.status, this.title, `${file.name}: ${this.message}`) : this;
  }
}

export const TOOLS = ["blender", "usd", "gltf", "threejs", "mitsuba"] as const;
export type Tool = (typeof TOOLS)[number];

/** The light of photos of one place, one estimate for each. */
export async function estimate(photos: Blob[], given: Given, signal: AbortSignal): Promise<Estimate[]> {
  const query = givenQuery(given, photos.length);
  query.set("probability", "true");
  query.set("surroundings", "true");
  const response = await ask(`v1/lighting?${query}`, { method: "POST", body: formOf(photos), signal });
  const answer = (await response.json()) as Estimate | { lightings: Estimate[] };
  return "lightings" in answer ? answer.lightings : [answer];
}

/** The photo upright, as JPEG, for browsers that cannot decode the file. */
export const uprightPhoto = (photo: Blob, signal?: AbortSignal): Promise<Blob> =>
  send("v1/photo", formOf([photo]), signal);

/** An example's file. */
export const exampleFile = async (url: string, signal: AbortSignal): Promise<Blob> =>
  (await ask(url, { signal })).blob();

/** The preview of a photo's estimate, as PNG. */
export const previewFile = (photo: Blob, given: Given): Promise<Blob> =>
  send(`v1/preview?${givenQuery(given, 1)}`, formOf([photo]));

/** The parameters of a photo's URL: what the user said of it, and the light that replaces the estimated one. */
export function photoQuery(given: Given, changed?: Changed): URLSearchParams {
  const query = givenQuery(given, 1);
  for (const [name, value] of Object.entries(changed ?? {})) {
    if (name !== "ground_albedo") query.set(name, valueText(value));
  }
  return query;
}

/** A scene with the photo in it, as ZIP; `changed` replaces the estimated light. */
export function sceneFile(photo: Blob, given: Given, tool: Tool, changed?: Changed): Promise<Blob> {
  const query = photoQuery(given, changed);
  query.set("tool", tool);
  return send(`v1/scene?${query}`, formOf([photo]));
}

/** How a map is wanted. */
export interface MapOptions {
  format: Format;
  height: number;
}

/** The environment map of a photo, with the place; `changed` replaces the estimated light. */
export function envmapFile(
  photo: Blob,
  given: Given,
  { format, height }: MapOptions,
  changed?: Changed,
): Promise<Blob> {
  const query = photoQuery(given, changed);
  query.set("format", format);
  query.set("height", String(height));
  return send(`v1/envmap?${query}`, formOf([photo]));
}

async function send(url: string, body: BodyInit, signal?: AbortSignal): Promise<Blob> {
  return (await ask(url, { method: "POST", body, ...(signal ? { signal } : {}) })).blob();
}

function formOf(photos: Blob[]): FormData {
  const form = new FormData();
  for (const photo of photos) form.append("photo", photo);
  return form;
}

const numberText = (value: number): string => String(Number(value.toPrecision(6)));

/** A number, or several with commas between them, to 6 digits; or a switch. */
export function valueText(value: number | Triple | boolean): string {
  if (typeof value === "boolean") return String(value);
  return typeof value === "number" ? numberText(value) : value.map(numberText).join(",");
}

/** What the service says of itself. */
export interface Described {
  accuracy: Record<string, Record<string, number>>; // median errors by protocol, then by the names of the model card
  matching: boolean; // whether it finds by what several photos show in common how they are turned
}

export const description = async (): Promise<Described> => (await ask("v1/model", {})).json();

async function ask(url: string, init: RequestInit): Promise<Response> {
  const key = apiKey();
  const headers: HeadersInit = key ? keyHeader(key) : {};
  const response = await fetch(url, { ...init, headers }).catch((error: unknown) => {
    if (init.signal?.aborted) throw error;
    throw new Refusal(
      0,
      "The service did not answer",
      "Check your connection, and that the service is still running, then try again.",
    );
  });
  if (!response.ok) throw await refusal(response);
  return response;
}

async function refusal(response: Response): Promise<Refusal> {
  const problem = await response.json().catch(() => ({}));
  const [first] = Array.isArray(problem.errors) ? problem.errors : [];
  if (first?.place === "form") return new Refusal(response.status, "These photos cannot be taken", first.detail);
  const title = typeof problem.title === "string" ? problem.title : `The service answered ${response.status}`;
  return new Refusal(response.status, title, typeof problem.detail === "string" ? problem.detail : response.statusText);
}
