/** The light of parameters: sky, sun and ground in the photo's linear values, as a renderer needs them. */

import type { LightParameters } from "../api";
import { radians } from "../geometry/angles";
import { CHANNELS, rgbLuminance, type Triple } from "../geometry/color";
import { type HosekWilkieTable, hosekWilkieSky, type PragueTable, pragueSky, sunIrradiance } from "./models";
import {
  addOvercast,
  fillGround,
  horizontalIrradiance,
  type Latlong,
  renderHosekWilkieSky,
  renderPragueSky,
  type SceneLight,
} from "./render";

export type { SceneLight };

/** What a record may state of its light; whatever it leaves out follows from the model. */
interface StatedLight {
  sun?: Triple; // irradiance of a plane that faces the sun
  sky?: Triple; // irradiance of level ground
  groundColor?: Triple; // reflectance
  cover?: number; // 0 clear to 1 overcast
}

/** What the worker renders: the light on show, and the estimate that it began as. */
export interface SkyRequest {
  parameters: LightParameters;
  estimated: LightParameters;
  stated: StatedLight;
  painted?: string; // the model that paints the sky; the map of any but "prague" is that of Hosek and Wilkie
  coarse?: boolean; // whether half of the rows will do, as while the sun is dragged
}

/** The tables of the sky models. */
export interface SkyTables {
  hosekWilkie: HosekWilkieTable;
  prague: PragueTable;
}

const NEUTRAL: Triple = [1, 1, 1];
const MIN_SUN_ELEVATION = 5; // the model's suns below it have hardly any green and no blue, and photos' suns have
const HIGH_SUN = 30; // of a sun at full strength
const MIN_SUN_SHARE = 0.05; // of that sun's channels, which the model's is taken to have at least: in haze a low one has none
const WHITE_SUN = 60; // elevation of a sun for which cameras' white is set
const SUNNY_COVER = 0.5; // the most clouds where the sun is turned on by hand
const MAX_SKY_GAIN = 2; // by which a sun that is moved brightens a sky: the photo stays exposed for its own
const mapChannels = (make: (channel: 0 | 1 | 2) => number): Triple => [make(0), make(1), make(2)];

/** A sky by the Prague model whose light on level ground is that of another sky. */
function renderPrague(table: PragueTable, height: number, p: LightParameters, cover: number, level: Triple): Latlong {
  const map = renderPragueSky(height, pragueSky(table, p.sun_elevation, p.turbidity), p.sun_azimuth, p.sun_elevation);
  const own = horizontalIrradiance(map);
  scaleMap(
    map,
    mapChannels((c) => ((1 - cover) * level[c]) / Math.max(own[c], 1e-9)),
  );
  addOvercast(
    map,
    mapChannels((c) => cover * level[c]),
  );
  return map;
}

/** How much less a sky gives whose sun is below the horizon than one whose sun is on it, by the Prague model. */
function twilightFading(table: PragueTable, { sun_elevation, turbidity }: LightParameters): Triple {
  const level = (elevation: number): Triple =>
    horizontalIrradiance(renderPragueSky(64, pragueSky(table, elevation, turbidity), 0, elevation));
  const [now, horizon] = [level(sun_elevation), level(0)];
  return mapChannels((c) => now[c] / horizon[c]);
}

/** The model's own light, its sky and its sun multiplied by gains; below the horizon the sun gives none. */
function renderModel(
  tables: SkyTables,
  height: number,
  p: LightParameters,
  cover: number,
  gains: Gains,
): Omit<SceneLight, "ground"> {
  const table = tables.hosekWilkie;
  const isUp = p.sun_elevation >= 0;
  const shape = hosekWilkieSky(table, p.sun_elevation, p.turbidity, p.ground_albedo);
  const gain = mapChannels(() => p.exposure);
  const map = renderHosekWilkieSky(height, shape, { azimuth: p.sun_azimuth, elevation: p.sun_elevation, gain, cover });
  if (!isUp) scaleMap(map, twilightFading(tables.prague, p));
  if (gains.sky !== NEUTRAL) scaleMap(map, gains.sky);
  const ofModel = gains.sun === NEUTRAL ? sunIrradiance(table, p.sun_elevation, p.turbidity) : steadySun(table, p);
  const irradiances = p.sun && isUp ? ofModel : ([0, 0, 0] as Triple);
  return { map, sky: horizontalIrradiance(map), sun: mapChannels((c) => irradiances[c] * p.exposure * gains.sun[c]) };
}

const DIFFUSED = 0.5; // share of the sun's light that clouds pass on to the ground

/** A light whose sun clouds soften: they take a share of it and pass some of that on from all of the sky. */
function softenLight(light: Omit<SceneLight, "ground">, { softness, sun_elevation }: LightParameters): void {
  const added = DIFFUSED * softness * rgbLuminance(light.sun) * Math.max(Math.sin(radians(sun_elevation)), 0);
  const gain = mapChannels((c) => (light.sky[c] + added) / Math.max(light.sky[c], 1e-9));
  scaleMap(light.map, gain);
  light.sky = mapChannels((c) => light.sky[c] * gain[c]);
  light.sun = mapChannels((c) => light.sun[c] * (1 - softness));
}

const WARMING: Triple = [0.5, 0, -1]; // stops of a warmth of 1

/** A sun of another warmth, as bright as before. */
function warmSun(sun: Triple, warmth: number): Triple {
  const warmed = mapChannels((c) => sun[c] * 2 ** (warmth * WARMING[c]));
  const gain = rgbLuminance(sun) / Math.max(rgbLuminance(warmed), 1e-9);
  return mapChannels((c) => warmed[c] * gain);
}

/** The cloud cover of a light: that of the record, less where its sun did not shine, and what softens the sun. */
export function coverOf(stated: number | undefined, wasSunny: boolean, { sun, softness }: LightParameters): number {
  const cover = Math.min(stated ?? 0, sun && !wasSunny ? SUNNY_COVER : 1);
  return cover + softness * (1 - cover);
}

/** The model's sun, or what stands for it where it would vanish: `edit_lighting` of lighting.envmap.relighting has the same rule. */
function steadySun(table: HosekWilkieTable, p: LightParameters): Triple {
  const atElevation = sunIrradiance(table, Math.max(p.sun_elevation, MIN_SUN_ELEVATION), p.turbidity);
  const high = sunIrradiance(table, HIGH_SUN, p.turbidity);
  return mapChannels((c) => Math.max(atElevation[c], MIN_SUN_SHARE * high[c]));
}

/** What takes the model's light to the one that a record states. */
interface Gains {
  sky: Triple;
  sun: Triple;
}

function computeGains(tables: SkyTables, estimated: LightParameters, stated: StatedLight): Gains {
  if (!stated.sky && !stated.sun) return { sky: NEUTRAL, sun: NEUTRAL };
  const { sky } = renderModel(tables, 32, estimated, stated.cover ?? 0, { sky: NEUTRAL, sun: NEUTRAL });
  const sun = steadySun(tables.hosekWilkie, estimated);
  const exposed = mapChannels((c) => sun[c] * estimated.exposure);
  return { sky: channelRatio(stated.sky, sky), sun: channelRatio(stated.sun, exposed) };
}

const channelRatio = (target: Triple | undefined, modeled: Triple): Triple =>
  target ? mapChannels((c) => target[c] / Math.max(modeled[c], 1e-9)) : NEUTRAL;

/** Those of a light whose sun did not shine and is turned on: as strong against the sky as the model's is. */
function turnedOnGains(tables: SkyTables, estimated: LightParameters, { sky, cover = 0 }: StatedLight): Gains {
  if (!sky) return { sky: NEUTRAL, sun: NEUTRAL };
  const [clear, open] = [0, Math.min(cover, SUNNY_COVER)].map(
    (clouds) => renderModel(tables, 32, estimated, clouds, { sky: NEUTRAL, sun: NEUTRAL }).sky,
  ) as [Triple, Triple];
  const white = steadySun(tables.hosekWilkie, { ...estimated, sun_elevation: WHITE_SUN });
  const gain = (rgbLuminance(sky) / Math.max(rgbLuminance(clear), 1e-9)) * rgbLuminance(white);
  return { sky: channelRatio(sky, open), sun: mapChannels((c) => gain / white[c]) };
}

/** Dims a light whose raised sun would make its sky more than twice as bright as the estimate's at this exposure. */
function limitSky(light: Omit<SceneLight, "ground">, { parameters, estimated, stated }: SkyRequest): void {
  if (!stated.sky || parameters.sun_elevation === estimated.sun_elevation) return;
  const most = (MAX_SKY_GAIN * rgbLuminance(stated.sky) * parameters.exposure) / Math.max(estimated.exposure, 1e-9);
  const gain = Math.min(most / Math.max(rgbLuminance(light.sky), 1e-9), 1);
  scaleMap(
    light.map,
    mapChannels(() => gain),
  );
  light.sky = mapChannels((c) => light.sky[c] * gain);
  light.sun = mapChannels((c) => light.sun[c] * gain);
}

/** What all lights of a photo share, whatever its sliders say. */
export interface LightBase {
  gains: Gains;
  turnedOn?: Gains; // where the sun did not shine and is turned on
}

export function prepareLight(
  tables: SkyTables,
  { estimated, stated }: Pick<SkyRequest, "estimated" | "stated">,
): LightBase {
  const gains = computeGains(tables, estimated, stated);
  return estimated.sun ? { gains } : { gains, turnedOn: turnedOnGains(tables, estimated, stated) };
}

/** The light of a question, its map `height` rows high. */
export function renderLight(
  tables: SkyTables,
  question: SkyRequest,
  height: number,
  base = prepareLight(tables, question),
): SceneLight {
  const { parameters, stated } = question;
  const gains = (parameters.sun && base.turnedOn) || base.gains;
  const cover = coverOf(stated.cover, question.estimated.sun, parameters);
  const light = renderModel(tables, height, parameters, cover, gains);
  limitSky(light, question);
  if (parameters.warmth !== 0) light.sun = warmSun(light.sun, parameters.warmth);
  if (parameters.softness > 0) softenLight(light, parameters);
  if (question.painted === "prague" || parameters.sun_elevation < 0)
    light.map = renderPrague(tables.prague, height, parameters, cover, light.sky);
  const irradiance = groundIrradiance(light, parameters);
  const ground = mapChannels((c) => {
    if (stated.groundColor) return (stated.groundColor[c] / Math.PI) * irradiance[c];
    return (parameters.ground_albedo / Math.PI) * irradiance[c];
  });
  fillGround(light.map, ground);
  return { ...light, ground };
}

/** Irradiance of level ground by sky and sun. */
function groundIrradiance({ sky, sun }: Pick<SceneLight, "sky" | "sun">, { sun_elevation }: LightParameters): Triple {
  return mapChannels((c) => sky[c] + sun[c] * Math.sin(radians(sun_elevation)));
}

function scaleMap({ data }: Latlong, gain: Triple): void {
  for (let i = 0; i < data.length; i += 4) {
    for (const c of CHANNELS) data[i + c] = (data[i + c] as number) * gain[c];
  }
}
