/** The service as the page uses it. Paths are relative, so that it also works behind a proxy's prefix. */

import { apiKey } from "./key";
import type { Camera } from "./pure/camera";
import type { Distribution } from "./pure/distribution";

/** The record of a photo's light, as the service answers it. */
export interface Lighting {
  model: { name: string; version: string };
  sun: {
    azimuth: number;
    elevation: number;
    direction: [number, number, number];
    visibility: number;
    radius_50: number;
    radius_90: number;
  };
  sky: { model: string; turbidity: number; ground_albedo: number; exposure: number; coefficients?: unknown };
  camera: Camera;
  evidence: string[];
  warnings: string[];
}

export interface Estimate extends Lighting {
  links: { envmap: string };
  probability: Distribution;
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
}

export async function estimate(photo: Blob, signal: AbortSignal): Promise<Estimate> {
  const form = new FormData();
  form.append("photo", photo);
  const response = await ask("v1/lighting?probability=true", { method: "POST", body: form, signal });
  return (await response.json()) as Estimate;
}

export function envmapUrl(parameters: Parameters, format: Format, height: number): string {
  const query = new URLSearchParams();
  for (const [name, value] of Object.entries(parameters)) {
    query.set(name, typeof value === "number" ? String(Number(value.toPrecision(6))) : String(value));
  }
  query.set("height", String(height));
  query.set("format", format);
  return `v1/envmap?${query}`;
}

/** A file of the service. */
export async function file(url: string, signal?: AbortSignal): Promise<Blob> {
  return (await ask(url, signal ? { signal } : {})).blob();
}

/** Median errors on photos the network never saw, by the names of the model card; empty where none are stated. */
export async function accuracy(): Promise<Record<string, number>> {
  const { accuracy } = (await (await ask("v1/model", {})).json()) as {
    accuracy: Record<string, Record<string, number>>;
  };
  return accuracy.phone ?? Object.values(accuracy)[0] ?? {};
}

async function ask(url: string, init: RequestInit): Promise<Response> {
  const key = apiKey();
  const headers: HeadersInit = key ? { Authorization: `Bearer ${key}` } : {};
  const response = await fetch(url, { ...init, headers }).catch((error: unknown) => {
    if (init.signal?.aborted) throw error;
    throw new Refusal(0, "The service did not answer", "Check that it is still running, then try again.");
  });
  if (!response.ok) throw await refusal(response);
  return response;
}

async function refusal(response: Response): Promise<Refusal> {
  const problem = await response.json().catch(() => ({}));
  const title = typeof problem.title === "string" ? problem.title : `The service answered ${response.status}`;
  return new Refusal(response.status, title, typeof problem.detail === "string" ? problem.detail : response.statusText);
}
