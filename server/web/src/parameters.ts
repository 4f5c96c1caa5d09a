/** The light that is on show: the estimate until a slider moves. */

import type { Changed, Edited, Estimate, Lighting, Parameters, Power } from "./api";
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

/** The light on show with all that its record states of it; `power` is what it has where it is not the estimate's. */
export function statedLight(estimate: Lighting, shown: Parameters, power: Power): Changed {
  const { sun, sky, ground } = estimate;
  const own = isSame(parametersOf(estimate), shown);
  const stated = sun.irradiance && sky.irradiance;
  return {
    ...{ ...shown, photo_exposure: sky.exposure },
    ...(stated ? { sun_irradiance: own ? sun.irradiance : power.sun } : {}),
    ...(stated ? { sky_irradiance: own ? sky.irradiance : power.sky } : {}),
    ...(sky.cover === undefined ? {} : { sky_cover: sky.cover }),
    ...(ground ? { ground_color: ground.color } : {}),
  };
}

/** The camera that a record states, in the names of the service. */
export function commonCamera({ camera }: Lighting): Partial<Changed> {
  return { camera_elevation: camera.elevation, camera_roll: camera.roll, vertical_fov: camera.vertical_fov };
}

/**
 * The record as a file: the estimate's own, or an edited one without what no longer follows from it. `power` is that of
 * the light on show; it replaces the one that the estimate states.
 */
export function recordOf(estimate: Estimate, shown: Parameters, power: Power): Lighting | Edited {
  const { links: _, probability: __, surroundings: ___, ...record } = estimate;
  if (isSame(parametersOf(record), shown)) return record;
  const { azimuth, elevation } = { azimuth: shown.sun_azimuth, elevation: shown.sun_elevation };
  const { cover } = record.sky;
  const stated = record.sky.irradiance !== undefined;
  return {
    ...record,
    evidence: [],
    warnings: [],
    sun: {
      ...{ azimuth, elevation, direction: [...direction(azimuth, elevation)], visibility: Number(shown.sun) },
      ...(stated ? { irradiance: power.sun } : {}),
    },
    sky: {
      model: record.sky.model,
      turbidity: shown.turbidity,
      ground_albedo: shown.ground_albedo,
      exposure: shown.exposure,
      ...(cover === undefined ? {} : { cover }),
      ...(stated ? { irradiance: power.sky } : {}),
    },
  };
}
