/** The worker that renders skies, so that sliders need no request and the page stays quick. */

import hosekWilkieUrl from "../../../../lighting/data/hosek_wilkie.f32?url";
import pragueUrl from "../../../../lighting/data/prague.f16?url";
import type { LightParameters } from "../api";
import { direction, type Vector } from "../geometry/angles";
import type { Camera } from "../geometry/camera";
import type { Pixels } from "../geometry/color";
import {
  addSurroundings,
  buildSurroundings,
  type Surroundings,
  type SurroundingsFactors,
} from "../surroundings/surroundings";
import { parseSkyTable } from "./hosekWilkie";
import {
  type LightBase,
  prepareLight,
  renderLight,
  type SceneLight,
  type SkyRequest,
  type SkyTables,
} from "./lighting";
import { parsePragueTable } from "./prague";
import { type MapPicture, toneMap } from "./render";

export type SkyMessage =
  | { photo: Pixels; camera: Camera; factors: SurroundingsFactors | undefined }
  | { question: SkyRequest; id: number };

export interface SkyAnswer {
  id: number;
  light: SceneLight; // its map holds the surroundings
  picture: MapPicture; // of the bare map
}

const LIGHT_ROWS = 128; // finer maps take phones too long to prefilter
const PICTURE_ROWS = 256;

let tables: Promise<SkyTables> | undefined;
let surroundings: Surroundings | undefined;
let last: { photo: string; base: LightBase } | undefined; // of the latest photo

self.addEventListener("message", async ({ data }: MessageEvent<SkyMessage>) => {
  if ("photo" in data) surroundings = buildSurroundings(data.photo, data.camera, data.factors, LIGHT_ROWS);
  else await answer(data.question, data.id);
});

async function answer(question: SkyRequest, id: number): Promise<void> {
  try {
    tables ??= loadTables();
    const sky = await tables;
    const base = cachedBase(sky, question);
    const light = renderLight(sky, question, LIGHT_ROWS, base);
    const picture = toneMap(renderLight(sky, question, PICTURE_ROWS, base), question.parameters);
    const gain = question.parameters.exposure / question.estimated.exposure;
    const suns = { before: sunDirection(question.estimated), now: sunDirection(question.parameters) };
    const map = surroundings ? addSurroundings(light.map, surroundings, gain, suns) : light.map;
    postMessage({ id, light: { ...light, map }, picture } satisfies SkyAnswer);
  } catch (error) {
    tables = undefined;
    postMessage({ id, error: error instanceof Error ? error.message : String(error) });
  }
}

/** What all lights of the photo share, computed once for each photo. */
function cachedBase(sky: SkyTables, { parameters: _, ...ofPhoto }: SkyRequest): LightBase {
  const photo = JSON.stringify(ofPhoto);
  if (last?.photo !== photo) last = { photo, base: prepareLight(sky, ofPhoto) };
  return last.base;
}

const sunDirection = ({ sun_azimuth, sun_elevation }: LightParameters): Vector => direction(sun_azimuth, sun_elevation);

async function loadTables(): Promise<SkyTables> {
  const [hosekWilkie, prague] = await Promise.all([hosekWilkieUrl, pragueUrl].map(loadTable));
  return { hosekWilkie: parseSkyTable(hosekWilkie as ArrayBuffer), prague: parsePragueTable(prague as ArrayBuffer) };
}

async function loadTable(url: string): Promise<ArrayBuffer> {
  const response = await fetch(url).catch(() => undefined);
  if (!response?.ok)
    throw new Error("The table of the sky could not be loaded, so the light cannot be shown. Try again.");
  return response.arrayBuffer();
}
