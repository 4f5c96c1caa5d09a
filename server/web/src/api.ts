/** The service as the page uses it. Paths are relative, so that it also works behind a proxy's prefix. */

import type { Point } from "./geometry/camera";
import type { Triple } from "./geometry/color";
import { type UserInput, userInputQuery } from "./text/metadata";
import type { Estimate, Lighting, LightOverrides } from "./types";

export type * from "./types";

/** Parameters that the service does not know: what follows from them is stated as irradiances. */
const PAGE_ALONE: ReadonlySet<string> = new Set(["ground_albedo", "warmth", "softness"]);

/** An error of the service, in its own sentence; status 0 where there was no answer. */
export class ServiceError extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    detail: string,
  ) {
    super(detail);
  }

  /** The same with the file's name, where the file is what was refused. */
  withFileName(name: string): ServiceError {
    const isAboutFile = [400, 413, 415].includes(this.status);
    return isAboutFile ? new ServiceError(this.status, this.title, `${name}: ${this.message}`) : this;
  }
}

/** The light of photos of one location, one estimate for each; errors name the file. */
export async function estimatePhotos(photos: File[], userInput: UserInput, signal: AbortSignal): Promise<Estimate[]> {
  const query = userInputQuery(userInput, photos.length);
  query.set("probability", "true");
  query.set("photo_metadata", "true");
  const ask = async (route: string): Promise<unknown> =>
    (await request(`${route}?${query}`, { method: "POST", body: buildForm(photos), signal })).json();
  const [photo, ...others] = photos;
  if (photo && others.length === 0) return [(await ask("v1/lighting").catch(nameFile(photo))) as Estimate];
  return ((await ask("v1/lightings")) as { lightings: Estimate[] }).lightings;
}

/** Throws an error of the service again, with the name of the only file; of several, the service names the one. */
const nameFile =
  ({ name }: File) =>
  (error: unknown): never => {
    throw error instanceof ServiceError ? error.withFileName(name) : error;
  };

/** The photo upright, as JPEG, for browsers that cannot decode the file. */
export const fetchUprightPhoto = (photo: Blob, signal?: AbortSignal): Promise<Blob> =>
  post("v1/photo", buildForm([photo]), signal);

/** What a photo shows of its ground, as PNG: green is where the sun's shadow of an object may fall. */
export const fetchGroundMask = (photo: Blob, userInput: UserInput, signal: AbortSignal): Promise<Blob> =>
  post(`v1/ground?${userInputQuery(userInput, 1)}`, buildForm([photo]), signal);

/** The nearest ground in the sun to a point of a photo, both in shares of its width and height; null where there is none. */
export async function fetchLitSpot(photo: Blob, userInput: UserInput, [x, y]: Point): Promise<Point | null> {
  const query = userInputQuery(userInput, 1);
  for (const [name, share] of Object.entries({ x, y })) query.set(name, formatNumber(Math.min(Math.max(share, 0), 1)));
  const answer = await request(`v1/ground/lit-spot?${query}`, { method: "POST", body: buildForm([photo]) });
  return ((await answer.json()) as { spot: Point | null }).spot;
}

/** The light at a time of a day. */
export interface DayHour {
  time: string; // on the clock of the place
  lighting: Lighting;
}

/** The light of a day at the photo's place, every ten minutes while the sun is up. */
export async function fetchDay(
  photo: Blob,
  userInput: UserInput,
  date: string,
  signal: AbortSignal,
): Promise<{ hours: DayHour[]; warnings: string[] }> {
  const query = userInputQuery(userInput, 1);
  query.set("date", date);
  query.set("every", "10");
  return (await request(`v1/day?${query}`, { method: "POST", body: buildForm([photo]), signal })).json();
}

/** An example's file. */
export const fetchExample = async (url: string, signal: AbortSignal): Promise<Blob> =>
  (await request(url, { signal })).blob();

/** What a user changes of a light by hand, in the names of the service. */
export interface Adjustments {
  sun: [azimuth: number, elevation: number] | false; // false leaves it out
  exposure: number; // EV
  haze: number; // turbidity
}

/** The preview of a photo's light, as PNG: of the estimate, or of that light adjusted. */
export function fetchPreview(photo: Blob, userInput: UserInput, adjustments?: Adjustments): Promise<Blob> {
  const query = userInputQuery(userInput, 1);
  for (const [name, value] of Object.entries(adjustments ?? {})) {
    query.set(name, Array.isArray(value) ? value.map(formatNumber).join(",") : formatValue(value));
  }
  return post(`v1/preview?${query}`, buildForm([photo]));
}

/** The parameters of a photo's URL: the user's input, and the light that replaces the estimated one. */
export function photoQuery(userInput: UserInput, overrides?: LightOverrides): URLSearchParams {
  const query = userInputQuery(userInput, 1);
  for (const [name, value] of Object.entries(overrides ?? {})) {
    if (!PAGE_ALONE.has(name)) query.set(name, formatValue(value));
  }
  return query;
}

/** A scene with the photo in it, as ZIP; `overrides` replace the estimated light. */
export function fetchScene(photo: Blob, userInput: UserInput, tool: string, overrides?: LightOverrides): Promise<Blob> {
  const query = photoQuery(userInput, overrides);
  query.set("for", tool);
  return post(`v1/scene?${query}`, buildForm([photo]));
}

/** What kind of map to fetch. */
interface MapOptions {
  format: string;
  height: number;
}

/** The environment map of a photo, with the surroundings; `overrides` replace the estimated light. */
export function fetchEnvmap(
  photo: Blob,
  userInput: UserInput,
  { format, height }: MapOptions,
  overrides?: LightOverrides,
  signal?: AbortSignal,
): Promise<Blob> {
  const query = photoQuery(userInput, overrides);
  query.set("format", format);
  query.set("height", String(height));
  return post(`v1/envmap?${query}`, buildForm([photo]), signal);
}

async function post(url: string, body: BodyInit, signal?: AbortSignal): Promise<Blob> {
  return (await request(url, { method: "POST", body, ...(signal ? { signal } : {}) })).blob();
}

function buildForm(photos: Blob[]): FormData {
  const form = new FormData();
  for (const photo of photos) form.append("photo", photo);
  return form;
}

const formatNumber = (value: number): string => String(Number(value.toPrecision(6)));

/** A number, or several with commas between them, to 6 digits; or a switch. */
export function formatValue(value: number | Triple | boolean): string {
  if (typeof value === "boolean") return String(value);
  return typeof value === "number" ? formatNumber(value) : value.map(formatNumber).join(",");
}

/** What the service states of itself. */
export interface ModelInfo {
  accuracy: Record<string, Record<string, number>>; // median errors by protocol, then by the names of the model card
  matching: boolean; // whether it finds the rotations between photos by what they show in common
  jobs: boolean; // whether it takes long jobs, whose uploads it keeps until they end
  scene_labels: Record<string, string>; // of the tools, by the values of `tool`
  map_formats: string[];
}

const fetchModelInfo = async (): Promise<ModelInfo> => (await request("v1/model", {})).json();

async function request(url: string, init: RequestInit): Promise<Response> {
  const key = apiKey();
  const headers: HeadersInit = key ? authorizationHeader(key) : {};
  const response = await fetch(url, { ...init, headers }).catch((error: unknown) => {
    if (init.signal?.aborted) throw error;
    throw new ServiceError(
      0,
      "The service did not answer",
      "Check your connection, and that the service is still running, then try again.",
    );
  });
  if (!response.ok) throw await readProblem(response);
  return response;
}

async function readProblem(response: Response): Promise<ServiceError> {
  const problem = await response.json().catch(() => ({}));
  const [first] = Array.isArray(problem.errors) ? problem.errors : [];
  if (first?.place === "form") return new ServiceError(response.status, "These photos cannot be taken", first.detail);
  const title = typeof problem.title === "string" ? problem.title : `The service answered ${response.status}`;
  return new ServiceError(
    response.status,
    title,
    typeof problem.detail === "string" ? problem.detail : response.statusText,
  );
}

const STORAGE_NAME = "lighting-api-key";

export const apiKey = (): string | null => sessionStorage.getItem(STORAGE_NAME);

/** The header that carries a key. */
const authorizationHeader = (key: string): Record<string, string> => ({ Authorization: `Bearer ${key}` });

/** Keeps a key; false for one with characters that no request can carry, which is not kept. */
export function storeKey(key: string): boolean {
  try {
    new Headers(authorizationHeader(key));
  } catch {
    return false;
  }
  sessionStorage.setItem(STORAGE_NAME, key);
  return true;
}

let pending: Promise<ModelInfo | undefined> | undefined;

/** What the service states of itself, fetched once; undefined where that failed, as without a key: then the next call fetches again. */
export function modelInfo(): Promise<ModelInfo | undefined> {
  pending ??= fetchModelInfo().catch(() => {
    pending = undefined;
    return undefined;
  });
  return pending;
}

/**
 * A function that waits for `delay` milliseconds of quiet, then runs `work`; a newer call aborts the one under way.
 * An abort is no failure; whatever else `work` throws goes to `onError`.
 */
export function debounceLatest<T>(
  work: (value: T, signal: AbortSignal) => Promise<void>,
  delay: number,
  onError: (error: unknown) => void,
): (value: T) => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let running = new AbortController();
  return (value) => {
    clearTimeout(timer);
    running.abort();
    const controller = new AbortController();
    running = controller;
    timer = setTimeout(() => {
      work(value, controller.signal).catch((error) => {
        if (!controller.signal.aborted) onError(error);
      });
    }, delay);
  };
}
