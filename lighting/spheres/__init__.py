"""A mirror, a glossy and a grey ball in the light of a map: on a stage of their own, or on the photo's ground."""

from lighting.spheres.bounces import lit_stage
from lighting.spheres.in_photo import has_ground, with_balls
from lighting.spheres.render import PITCH, VERTICAL_FOV, pitch_of, render_spheres, render_stage, sphere_centres
from lighting.spheres.shading import DIFFUSE, DIFFUSE_REFLECTANCE, Stage

__all__ = [
    "DIFFUSE",
    "DIFFUSE_REFLECTANCE",
    "PITCH",
    "VERTICAL_FOV",
    "Stage",
    "has_ground",
    "lit_stage",
    "pitch_of",
    "render_spheres",
    "render_stage",
    "sphere_centres",
    "with_balls",
]
