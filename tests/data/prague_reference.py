"""Make prague_reference.npz: radiances of the Prague sky model by its own data set, to test lighting.sky against.

python -m tests.data.prague_reference PragueSkyModelReduced.dat
"""

import sys
from pathlib import Path

import numpy as np

from export.data.sky_tables import _PragueData, _read_prague, _read_sky, _rgb_weights
from lighting.geometry import Floats, direction

REFERENCE = Path(__file__).with_suffix(".npz")
TURBIDITIES = (3.0, 4.0, 6.0, 8.5, 10.0)
VISIBILITIES = (131.8, 131.8, 70.29972, 32.04434, 20.0)  # km, of the turbidities
ELEVATIONS = (-4.2, -3.1, -1.5, -0.5, 0.0, 1.0, 3.0, 5.23, 8.0, 14.0, 18.64, 27.17, 36.71, 47.16, 83.34, 90.0)  # deg
_DIRECTIONS = 40


def prague_directions(sun: Floats, rng: np.random.Generator) -> Floats:
    """Unit vectors (N, 3) above the horizon: near the sun, near the horizon and anywhere."""
    near = sun + rng.normal(size=(10, 3)) * np.geomspace(1e-3, 0.5, 10)[:, None]
    low = direction(rng.uniform(-180, 180, 10), np.geomspace(0.05, 5, 10))
    other = rng.normal(size=(_DIRECTIONS - 20, 3))
    vectors = np.concatenate([near, low, other])
    vectors[:, 1] = np.abs(vectors[:, 1])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _reference(data: _PragueData) -> dict[str, Floats]:
    """Directions (E, N, 3), and radiance (T, E, N, 3) of each turbidity and sun."""
    rng, rgb = np.random.default_rng(0), _rgb_weights(data)
    suns = [direction(20.0, elevation) for elevation in ELEVATIONS]
    directions = [prague_directions(sun, rng) for sun in suns]
    radiance = [
        [_read_sky(data, d, sun, visibility, rgb=rgb) for d, sun in zip(directions, suns, strict=True)]
        for visibility in VISIBILITIES
    ]
    return {"directions": np.array(directions), "radiance": np.array(radiance)}


if __name__ == "__main__":
    made = _reference(_read_prague(Path(sys.argv[1]).read_bytes()))
    np.savez_compressed(REFERENCE, directions=made["directions"], radiance=made["radiance"].astype(np.float32))
