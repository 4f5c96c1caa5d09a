"""Make sky_reference.npz: skies and suns as Mitsuba 3's `sunsky` computes them, to test lighting.sky against.

python -m tests.data.sky_reference
"""

from itertools import product
from pathlib import Path

import numpy as np

from lighting.geometry import SUN_RADIUS, Floats, direction

REFERENCE = Path(__file__).with_suffix(".npz")
TURBIDITIES = (1.0, 1.7, 3.0, 5.5, 9.9, 10.0)
ALBEDOS = (0.0, 0.3, 1.0)
ELEVATIONS = (0.05, 2.0, 12.5, 45.0, 75.0, 90.0)  # deg; Mitsuba has no sky for a sun at 0
_DIRECTIONS = 24


def sky_directions(sun: Floats, rng: np.random.Generator) -> Floats:
    """Unit vectors (N, 3) above the horizon: near the sun, near the horizon and anywhere."""
    near = sun + rng.normal(size=(8, 3)) * np.geomspace(1e-3, 0.5, 8)[:, None]
    low = direction(rng.uniform(-180, 180, 4), [0.01, 0.1, 1.0, 3.0])
    other = rng.normal(size=(_DIRECTIONS - 12, 3))
    vectors = np.concatenate([near, low, other])
    vectors[:, 1] = np.abs(vectors[:, 1])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def disc_directions(azimuth: float, elevation: float) -> Floats:
    """Unit vectors (N, 3) from the disc's center to nearly its edge, downwards and sideways."""
    offset = SUN_RADIUS * np.array([0.0, 0.3, 0.6, 0.9, 0.98])
    down = direction(azimuth, elevation - offset)
    across = direction(azimuth + offset / np.cos(np.radians(min(elevation, 89.0))), elevation)
    return down if elevation > 89.0 else np.concatenate([down, across])


def mitsuba_radiance(
    directions: Floats, sun: Floats, turbidity: float, albedo: float, *, sky: float = 0.0, disc: float = 0.0
) -> Floats:
    """Radiance (N, 3) of Mitsuba's emitter with the sky and the disc scaled by the factors given; never below 0."""
    import mitsuba as mi

    emitter = mi.load_dict(
        {
            "type": "sunsky",
            "sun_direction": _to_z_up(sun).tolist(),
            "turbidity": turbidity,
            "albedo": albedo,
            "sky_scale": sky,
            "sun_scale": disc,
            "complex_sun": True,  # with limb darkening
        }
    )
    result = []
    for vector in directions:
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = (-_to_z_up(vector)).tolist()
        result.append(np.array(emitter.eval(interaction)).ravel())
    return np.maximum(result, 0.0)


def cases() -> list[tuple[float, float, float]]:
    """Turbidity, albedo and sun elevation [deg] of every case, in the order of the file."""
    return list(product(TURBIDITIES, ALBEDOS, ELEVATIONS))


def _to_z_up(vector: Floats) -> Floats:
    x, y, z = vector
    return np.array([x, -z, y])


def main() -> None:
    """Write the file."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    rng = np.random.default_rng(2012)
    azimuths = rng.integers(-179, 180, len(cases())).astype(float)
    skies, radiances, discs = [], [], []
    for azimuth, (turbidity, albedo, elevation) in zip(azimuths, cases(), strict=True):
        sun = direction(azimuth, elevation)
        skies.append(sky_directions(sun, rng).astype(np.float32))
        radiances.append(mitsuba_radiance(skies[-1], sun, turbidity, albedo, sky=1.0))
        disc = mitsuba_radiance(disc_directions(azimuth, elevation), sun, turbidity, albedo, disc=1.0)
        discs.append(np.resize(disc, (10, 3)))
    arrays = {"azimuth": azimuths, "directions": skies, "sky": radiances, "disc": discs}
    np.savez_compressed(REFERENCE, allow_pickle=False, **{k: np.asarray(v, np.float32) for k, v in arrays.items()})


if __name__ == "__main__":
    main()
