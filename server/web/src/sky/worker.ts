/** The worker that renders skies, so that sliders need no request and the page stays quick. */

import tableUrl from "../../../../lighting/data/hosek_wilkie.f32?url";
import type { Parameters } from "../api";
import type { Factors } from "../picture/factors";
import type { Pixels } from "../picture/pixels";
import { layAround, type Surroundings, withSurroundings } from "../picture/surroundings";
import { direction, type Vector } from "../pure/angles";
import type { Camera } from "../pure/camera";
import { type Base, baseOf, type Light, lightOf, type Question } from "./light";
import { readTable, type SkyTable } from "./model";
import { type Picture, pictureOf } from "./picture";

export type Message =
  | { photo: Pixels; camera: Camera; factors: Factors | undefined }
  | { question: Question; id: number };

export interface Answer {
  id: number;
  light: Light; // its map holds the surroundings
  picture: Picture; // of the bare map
}

const LIGHT_ROWS = 128; // finer maps take phones too long to prefilter
const PICTURE_ROWS = 256;

let table: Promise<SkyTable> | undefined;
let around: Surroundings | undefined;
let last: { photo: string; base: Base } | undefined; // of the photo that was asked for

self.addEventListener("message", async ({ data }: MessageEvent<Message>) => {
  if ("photo" in data) around = layAround(data.photo, data.camera, data.factors, LIGHT_ROWS);
  else await answer(data.question, data.id);
});

async function answer(question: Question, id: number): Promise<void> {
  try {
    table ??= load();
    const sky = await table;
    const base = known(sky, question);
    const light = lightOf(sky, question, LIGHT_ROWS, base);
    const picture = pictureOf(lightOf(sky, question, PICTURE_ROWS, base), question.parameters);
    const gain = question.parameters.exposure / question.asked.exposure;
    const suns = { before: sunOf(question.asked), now: sunOf(question.parameters) };
    const map = around ? withSurroundings(light.map, around, gain, suns) : light.map;
    postMessage({ id, light: { ...light, map }, picture } satisfies Answer);
  } catch (error) {
    table = undefined;
    postMessage({ id, error: error instanceof Error ? error.message : String(error) });
  }
}

/** What all lights of the photo share, computed once for each photo. */
function known(sky: SkyTable, { parameters: _, ...ofPhoto }: Question): Base {
  const photo = JSON.stringify(ofPhoto);
  if (last?.photo !== photo) last = { photo, base: baseOf(sky, ofPhoto) };
  return last.base;
}

const sunOf = ({ sun_azimuth, sun_elevation }: Parameters): Vector => direction(sun_azimuth, sun_elevation);

async function load(): Promise<SkyTable> {
  const response = await fetch(tableUrl).catch(() => undefined);
  if (!response?.ok)
    throw new Error("The table of the sky could not be loaded, so the light cannot be shown. Try again.");
  return readTable(await response.arrayBuffer());
}
