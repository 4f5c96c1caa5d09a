"""Environment maps of a light: rendered, turned, and with the place around."""

from lighting.envmap.changing import change
from lighting.envmap.disc import sun_irradiance
from lighting.envmap.ground import photo_ground
from lighting.envmap.lit_ground import lit_around, lit_ground
from lighting.envmap.maps import Image, row_levels
from lighting.envmap.photo_view import camera_of
from lighting.envmap.render import ground_reflectance, level_irradiance, render, sky_irradiance, with_irradiance
from lighting.envmap.sky_colour import photo_sky
from lighting.envmap.surroundings import Place, known_place, place_factors, place_of, surround
from lighting.envmap.turning import brighten, rotate, turn
from lighting.envmap.views import view

__all__ = [
    "Image",
    "Place",
    "brighten",
    "camera_of",
    "change",
    "ground_reflectance",
    "known_place",
    "level_irradiance",
    "lit_around",
    "lit_ground",
    "photo_ground",
    "photo_sky",
    "place_factors",
    "place_of",
    "render",
    "rotate",
    "row_levels",
    "sky_irradiance",
    "sun_irradiance",
    "surround",
    "turn",
    "view",
    "with_irradiance",
]
