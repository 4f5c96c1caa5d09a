"""The ground between the three spheres with all its bounces, against Mitsuba's path tracer."""

from typing import Any

import mitsuba as mitsuba_renderer
import numpy as np
import pytest

from lighting.colour import luminance
from lighting.envmap import render, sun_irradiance
from lighting.geometry import Floats, direction
from lighting.records import Lighting
from lighting.spheres.bounces import lit_stage
from lighting.spheres.shading import (
    DIFFUSE,
    DIFFUSE_REFLECTANCE,
    GLOSSINESS,
    GLOSSY,
    GLOSSY_REFLECTANCE,
    MIRROR_REFLECTANCE,
    ground,
)

mi: Any = mitsuba_renderer

SIDE = 0.1  # of a patch, in sphere radii
GLOSSY_ROUGHNESS = (2 * GLOSSINESS) ** -0.5  # of the Beckmann lobe that spreads reflections as the glossy lobe does
CENTRES = np.array([[-2.6, 1.0, 0.0], [0.0, 1.0, 0.0], [2.6, 1.0, 0.0]])


def colour(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": np.asarray(value, dtype=float).tolist()}


def path_tracer(lighting: Lighting) -> Any:
    """The three spheres under sky and sun, which is a direction here: no patch lies in a penumbra."""
    mirror = {"type": "conductor", "material": "none", "specular_reflectance": colour([MIRROR_REFLECTANCE] * 3)}
    glossy = {"type": "roughconductor", "material": "none", "specular_reflectance": colour([GLOSSY_REFLECTANCE] * 3)}
    diffuse = {"type": "diffuse", "reflectance": colour([DIFFUSE_REFLECTANCE] * 3)}
    surfaces = [mirror, {**glossy, "alpha": GLOSSY_ROUGHNESS}, diffuse]
    turned = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
    level = mi.ScalarTransform4f().rotate([1, 0, 0], -90).scale(500)
    ground = {"type": "diffuse", "reflectance": colour([lighting.ground_albedo] * 3)}
    sky = mi.Bitmap(render(lighting, 256, disc=False))
    sun = {"direction": (-lighting.sun_direction).tolist(), "irradiance": colour(sun_irradiance(lighting))}
    balls = zip(CENTRES.tolist(), surfaces, strict=True)
    return mi.load_dict({
        "type": "scene",
        "sky": {"type": "envmap", "bitmap": sky, "to_world": turned},
        "sun": {"type": "directional", **sun},
        "ground": {"type": "disk", "to_world": level, "bsdf": ground},
        **{f"ball {i}": {"type": "sphere", "center": centre, "bsdf": bsdf} for i, (centre, bsdf) in enumerate(balls)},
    })  # fmt: skip


def traced(scene: Any, point: Floats) -> Floats:
    """Mean radiance (3,) of the patch around a point on the ground, seen from just above it."""
    height = 1e-3
    eye = mi.ScalarTransform4f().look_at((point + np.array([0.0, height, 0.0])).tolist(), point.tolist(), [0, 0, -1])
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    sensor = mi.load_dict({
        "type": "perspective", "fov": float(2 * np.degrees(np.arctan(0.5 * SIDE / height))), "near_clip": 1e-5,
        "to_world": eye, "film": film, "sampler": {"type": "independent", "sample_count": 400},
    })  # fmt: skip
    integrator = mi.load_dict({"type": "path", "max_depth": 6})
    picture = np.array(mi.render(scene, sensor=sensor, integrator=integrator, seed=1))
    return np.asarray(picture[..., :3].mean(axis=(0, 1), dtype=np.float64))


def ours(lighting: Lighting, points: Floats) -> Floats:
    """Radiance (N, 3) of the patches around points (N, 3)."""
    stage = lit_stage(render(lighting, 512), lighting.sun_direction, CENTRES)
    step = (np.arange(4) + 0.5) / 4 * SIDE - SIDE / 2
    offsets = np.stack([*np.meshgrid(step, [0.0], step)], axis=-1).reshape(-1, 3)
    patches = (points[:, None] + offsets).reshape(-1, 3)
    return np.asarray(ground(patches, stage).reshape(len(points), -1, 3).mean(axis=1))


def patches(lighting: Lighting) -> Floats:
    """Beside the diffuse sphere's foot, in its and the glossy one's shadow from foot to tip, and in the sun."""
    away = -direction(lighting.sun_azimuth, 0.0)
    elevation = np.radians(lighting.sun_elevation)
    tip = (1 + np.cos(elevation)) / np.sin(elevation)
    shaded = [CENTRES[ball] * [1, 0, 1] + part * tip * away for ball in (DIFFUSE, GLOSSY) for part in (0.3, 0.6, 0.9)]
    across = np.array([away[2], 0, -away[0]])
    foot = CENTRES[DIFFUSE] * [1, 0, 1]
    return np.array([foot + 0.15 * away, *shaded, foot - 1.2 * away, foot - away + 1.5 * across, [1.3, 0.0, 1.5]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("azimuth", "elevation", "turbidity"), [(-125.0, 33.0, 3.0), (-70.0, 35.0, 3.0), (-160.0, 58.0, 5.0)]
)
def test_the_ground_is_as_bright_as_a_path_tracer_says(azimuth: float, elevation: float, turbidity: float) -> None:
    mi.set_variant("scalar_rgb")
    lighting = Lighting(azimuth, elevation, turbidity, 1.0)
    points = patches(lighting)
    scene = path_tracer(lighting)
    expected = luminance(np.array([traced(scene, point) for point in points]))
    found = luminance(ours(lighting, points))
    np.testing.assert_allclose(found[1:4], expected[1:4], rtol=0.03)
    np.testing.assert_allclose(
        found[4:], expected[4:], rtol=0.08
    )  # its noise is 2 %, the glossy lobe is not quite ours
    assert abs(found[0] - expected[0]) < 0.005 * expected[-1]
