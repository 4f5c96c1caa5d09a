/** The light that is on show: the estimate until a slider moves. */

import type { Lighting, Parameters } from "./api";
import { direction } from "./pure/angles";
import { isSunny } from "./pure/words";

export function parametersOf({ sun, sky, ...rest }: Lighting): Parameters {
  return {
    sun_azimuth: sun.azimuth,
    sun_elevation: sun.elevation,
    turbidity: sky.turbidity,
    exposure: sky.exposure,
    ground_albedo: sky.ground_albedo,
    sun: isSunny({ sun, sky, ...rest }),
  };
}

export function isSame(a: Parameters, b: Parameters): boolean {
  return JSON.stringify(a) === JSON.stringify(b);
}

/** The record as a file: the estimate's own, or an edited one without what no longer follows from it. */
export function recordOf(estimate: Lighting, shown: Parameters): Lighting {
  const { model, sun, sky, camera } = estimate;
  const asked = parametersOf(estimate);
  if (isSame(asked, shown)) return { model, sun, sky, camera };
  return {
    model,
    sun: {
      ...sun,
      azimuth: shown.sun_azimuth,
      elevation: shown.sun_elevation,
      direction: [...direction(shown.sun_azimuth, shown.sun_elevation)],
      visibility: shown.sun === asked.sun ? sun.visibility : Number(shown.sun),
    },
    sky: {
      model: sky.model,
      turbidity: shown.turbidity,
      ground_albedo: shown.ground_albedo,
      exposure: shown.exposure,
    },
    camera,
  };
}
