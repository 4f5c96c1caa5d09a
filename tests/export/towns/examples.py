"""Level ground and clear skies."""

import numpy as np

from export.towns.mesh import Mesh, box
from export.towns.sky import HEIGHT, Sky
from lighting.envmap import render
from lighting.records import Lighting

ALBEDO = (0.2, 0.4, 0.6)


def plain(size: float = 400.0) -> Mesh:
    """A level square of ground."""
    h = size / 2
    return Mesh(np.array([[[-h, 0, -h], [-h, 0, h], [h, 0, h], [h, 0, -h]]]), np.array([ALBEDO]))


NOTHING = box(np.array([900.0, 900.0]), np.ones(3), 0, np.array(ALBEDO))


def clear(elevation: float = 40.0, sunlight: float = 1.0) -> Sky:
    lighting = Lighting(sun_azimuth=60.0, sun_elevation=elevation, turbidity=3.0, exposure=0.02)
    radiance = render(lighting, HEIGHT, sun=False)
    radiance[HEIGHT // 2 :] = 0.0
    return Sky(radiance, lighting, sunlight)
