/** The worker that renders skies, so that sliders need no request and the page stays quick. */

import hosekWilkieUrl from "../../../../lighting/data/hosek_wilkie.f32?url";
import pragueUrl from "../../../../lighting/data/prague.f16?url";
import {
  type LightBase,
  prepareLight,
  renderLight,
  type SceneLight,
  type SkyRequest,
  type SkyTables,
} from "./lighting";
import { parseHosekWilkieTable, parsePragueTable } from "./models";
import { followLight, halveMap, type Latlong, LIGHT_ROWS, type MapPicture, removeDisc, toneMap } from "./render";

/** A map that the service exported, and what it was asked for. */
export interface ExportedLight {
  map: Latlong;
  question: SkyRequest;
}

export type SkyMessage = { exported: ExportedLight | null } | { question: SkyRequest; id: number };

export interface SkyAnswer {
  id: number;
  light: SceneLight; // its map is the exported one, which follows what has changed since
  picture: MapPicture; // of the same map, with the sun's disc
}

let tables: Promise<SkyTables> | undefined;
let exported: { question: SkyRequest; maps: [full: Latlong, coarse: Latlong] } | null = null; // without the sun's disc
let exportedBare: Latlong[] = []; // the bare maps of its light, by their sizes as above
let last: { photo: string; base: LightBase } | undefined; // of the latest photo

self.addEventListener("message", async ({ data }: MessageEvent<SkyMessage>) => {
  if ("question" in data) await answer(data.question, data.id);
  else setExported(data.exported);
});

function setExported(light: ExportedLight | null): void {
  exportedBare = [];
  const map = light && removeDisc(light.map, light.question.parameters);
  exported = map && { question: light.question, maps: [map, halveMap(map)] };
}

async function answer(question: SkyRequest, id: number): Promise<void> {
  try {
    tables ??= loadTables();
    const sky = await tables;
    const bare = renderLight(sky, question, question.coarse ? LIGHT_ROWS / 2 : LIGHT_ROWS, cachedBase(sky, question));
    const light = { ...bare, map: showPlace(sky, bare.map, question) };
    const picture = toneMap(light, question.parameters);
    postMessage({ id, light, picture } satisfies SkyAnswer, { transfer: [light.map.data.buffer, picture.data.buffer] });
  } catch (error) {
    tables = undefined;
    postMessage({ id, error: error instanceof Error ? error.message : String(error) });
  }
}

/** The exported map in the light of a question; its bare map where none is exported. */
function showPlace(sky: SkyTables, now: Latlong, question: SkyRequest): Latlong {
  if (!exported) return now;
  const size = question.coarse ? 1 : 0;
  const map = exported.maps[size];
  const before = exported.question;
  if (JSON.stringify(question.parameters) === JSON.stringify(before.parameters))
    return { ...map, data: map.data.slice() };
  exportedBare[size] ??= renderLight(sky, before, map.height, cachedBase(sky, before)).map;
  return followLight(map, { before: exportedBare[size], now });
}

/** What all lights of the photo share, computed once for each photo. */
function cachedBase(sky: SkyTables, { estimated, stated }: SkyRequest): LightBase {
  const ofPhoto = { estimated, stated };
  const photo = JSON.stringify(ofPhoto);
  if (last?.photo !== photo) last = { photo, base: prepareLight(sky, ofPhoto) };
  return last.base;
}

async function loadTables(): Promise<SkyTables> {
  const [hosekWilkie, prague] = await Promise.all([hosekWilkieUrl, pragueUrl].map(loadTable));
  return {
    hosekWilkie: parseHosekWilkieTable(hosekWilkie as ArrayBuffer),
    prague: parsePragueTable(prague as ArrayBuffer),
  };
}

async function loadTable(url: string): Promise<ArrayBuffer> {
  const response = await fetch(url).catch(() => undefined);
  if (!response?.ok) throw new Error("The sky's table could not be loaded, so no light is shown. Try again.");
  return response.arrayBuffer();
}
