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
import { followLight, type Latlong, LIGHT_ROWS, type MapPicture, removeDisc, toneMap } from "./render";

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
let exported: ExportedLight | null = null; // without the sun's disc
let last: { photo: string; base: LightBase } | undefined; // of the latest photo

self.addEventListener("message", async ({ data }: MessageEvent<SkyMessage>) => {
  if ("question" in data) await answer(data.question, data.id);
  else
    exported = data.exported && {
      ...data.exported,
      map: removeDisc(data.exported.map, data.exported.question.parameters),
    };
});

async function answer(question: SkyRequest, id: number): Promise<void> {
  try {
    tables ??= loadTables();
    const sky = await tables;
    const bare = renderLight(sky, question, LIGHT_ROWS, cachedBase(sky, question));
    const light = { ...bare, map: exported ? showPlace(sky, bare.map, question, exported) : bare.map };
    postMessage({ id, light, picture: toneMap(light, question.parameters) } satisfies SkyAnswer);
  } catch (error) {
    tables = undefined;
    postMessage({ id, error: error instanceof Error ? error.message : String(error) });
  }
}

/** The exported map in the light of a question. */
function showPlace(
  sky: SkyTables,
  now: Latlong,
  question: SkyRequest,
  { map, question: before }: ExportedLight,
): Latlong {
  if (JSON.stringify(question.parameters) === JSON.stringify(before.parameters))
    return { ...map, data: map.data.slice() };
  return followLight(map, { before: renderLight(sky, before, LIGHT_ROWS, cachedBase(sky, before)).map, now });
}

/** What all lights of the photo share, computed once for each photo. */
function cachedBase(sky: SkyTables, { parameters: _, ...ofPhoto }: SkyRequest): LightBase {
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
