/** The light of parameters: sky, sun and ground in the photo's linear values, as a renderer needs them. */

import type { Parameters } from "../api";
import { radians } from "../pure/angles";
import { type SkyTable, skyShape, sunPower, type Triple } from "./model";
import { horizontalIrradiance, type Latlong, paintGround, paintSky } from "./paint";

/** What a record may state of its light; whatever it leaves out follows from the model. */
export interface Stated {
  sun?: Triple; // irradiance of a plane that faces the sun
  sky?: Triple; // irradiance of level ground
  ground?: Triple; // reflectance
  cover?: number; // 0 clear to 1 overcast
}

/** What is asked for: the light on show, and the estimate that it began as. */
export interface Question {
  parameters: Parameters;
  asked: Parameters;
  stated: Stated;
  groundSeen?: Triple | undefined; // the photo's own ground, linear, as it is under the estimate's light
}

export interface Light {
  map: Latlong; // the sky without the sun's disc above the ground
  sky: Triple; // irradiance of level ground by the sky alone
  sun: Triple; // irradiance of a plane that faces the sun; zero where it does not shine
  ground: Triple; // radiance of the ground
}

const NEUTRAL: Triple = [1, 1, 1];
const LOWEST = 5; // the model's suns below it have hardly any green and no blue, and photos' suns have
const HIGH = 30; // of a sun at full strength
const WEAKEST = 0.05; // of that sun's channels, which the model's is taken to have at least: in haze a low one has none
const each = (make: (channel: 0 | 1 | 2) => number): Triple => [make(0), make(1), make(2)];

/** The model's own light, its sky and its sun multiplied by gains. */
function modelled(table: SkyTable, height: number, p: Parameters, cover: number, gains: Gains): Omit<Light, "ground"> {
  const shape = skyShape(table, p.sun_elevation, p.turbidity, p.ground_albedo);
  const gain = each(() => p.exposure);
  const map = paintSky(height, shape, { azimuth: p.sun_azimuth, elevation: p.sun_elevation, gain, cover });
  if (gains.sky !== NEUTRAL) scale(map, gains.sky);
  const ofModel = gains.sun === NEUTRAL ? sunPower(table, p.sun_elevation, p.turbidity) : steadyPower(table, p);
  const power = p.sun ? ofModel : ([0, 0, 0] as Triple);
  return { map, sky: horizontalIrradiance(map), sun: each((c) => power[c] * p.exposure * gains.sun[c]) };
}

/** The model's sun, or what stands for it where it would vanish: `change` of lighting.envmap has the same rule. */
function steadyPower(table: SkyTable, p: Parameters): Triple {
  const there = sunPower(table, Math.max(p.sun_elevation, LOWEST), p.turbidity);
  const high = sunPower(table, HIGH, p.turbidity);
  return each((c) => Math.max(there[c], WEAKEST * high[c]));
}

/** What takes the model's light to the one that a record states. */
interface Gains {
  sky: Triple;
  sun: Triple;
}

function gainsOf(table: SkyTable, asked: Parameters, stated: Stated): Gains {
  if (!stated.sky && !stated.sun) return { sky: NEUTRAL, sun: NEUTRAL };
  const { sky } = modelled(table, 32, asked, stated.cover ?? 0, { sky: NEUTRAL, sun: NEUTRAL });
  const sun = steadyPower(table, asked);
  const ratio = (said: Triple | undefined, own: Triple): Triple =>
    said ? each((c) => said[c] / Math.max(own[c], 1e-9)) : NEUTRAL;
  const exposed = each((c) => sun[c] * asked.exposure);
  return { sky: ratio(stated.sky, sky), sun: ratio(stated.sun, exposed) };
}

/** What all lights of a photo share, whatever its sliders say. */
export interface Base {
  gains: Gains;
  before: Triple | undefined; // irradiance of level ground by the estimate, where the photo's ground is known
}

export function baseOf(table: SkyTable, { asked, stated, groundSeen }: Omit<Question, "parameters">): Base {
  const gains = gainsOf(table, asked, stated);
  const cover = stated.cover ?? 0;
  return { gains, before: groundSeen && level(modelled(table, 32, asked, cover, gains), asked) };
}

/** The light of a question, its map `height` rows high. */
export function lightOf(table: SkyTable, question: Question, height: number, base = baseOf(table, question)): Light {
  const { parameters, stated, groundSeen } = question;
  const { gains, before } = base;
  const light = modelled(table, height, parameters, stated.cover ?? 0, gains);
  const onGround = level(light, parameters);
  const ground = each((c) => {
    if (stated.ground) return (stated.ground[c] / Math.PI) * onGround[c];
    if (groundSeen && before) return (groundSeen[c] * onGround[c]) / Math.max(before[c], 1e-9);
    return (parameters.ground_albedo / Math.PI) * onGround[c];
  });
  paintGround(light.map, ground);
  return { ...light, ground };
}

/** Irradiance of level ground by sky and sun. */
function level({ sky, sun }: Pick<Light, "sky" | "sun">, { sun_elevation }: Parameters): Triple {
  return each((c) => sky[c] + sun[c] * Math.sin(radians(sun_elevation)));
}

function scale({ data }: Latlong, gain: Triple): void {
  for (let i = 0; i < data.length; i += 4) {
    for (const c of [0, 1, 2] as const) data[i + c] = (data[i + c] as number) * gain[c];
  }
}
