"""How well the shadow mask of a photo's ground is found, in rendered places, where it is known for each pixel.

Sky and sun are traced separately. So it is also known how dark each pixel of the ground would be in shadow. The mask
is for that: the shadow of a thing that is put into the scene.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.crops import auto_exposure_gain
from export.data.procedural_towns import random_town
from export.data.rendered_towns import RenderedTown, random_sky
from export.evaluation.metrics import figures_table, percentage
from lighting.color import SRGB_LINEAR, luminance, tone_map
from lighting.envmap.latlong import row_irradiance
from lighting.envmap.render import sky_irradiance, sun_light
from lighting.envmap.shadow_mask import ground_shadow_mask
from lighting.estimator import Estimator
from lighting.geometry import Floats, Pinhole, wrap_azimuth
from lighting.model import Model
from lighting.photo.reader import Photo
from lighting.records import Lighting

FIRST_PLACE = 6000  # number; training renders those below 1,000, and 5,000 on chose the rule's constants
GROUND_WIDTH, GROUND_HEIGHT = 320, 240  # pixels
MIN_GROUND = 0.05  # of the picture
MIN_SUN = 0.5  # share of the sun that clouds let through
WHOLE_SHARE = 0.03  # share of the ground up to which a picture counts as all lit, or as all in shade
TRUE_VISIBILITY = 0.8  # visibility of the sun where the light is the true one
MIN_LUMINANCE_SHADE = 1e-6
SHADE_NOTE = (
    "Shade on level ground [%]. Then the error of the shadow of a thing that is put there [hundredths of a stop], by "
    "the true light and by the network's. Photos by what their ground shows: sunlight, shade or both."
)


@dataclass(frozen=True, eq=False)
class _GroundScene:
    """A photo of a rendered place with the truth about its ground."""

    picture: NDArray[np.uint8]  # (h, w, 3) sRGB
    light: Lighting  # the true one
    ground: NDArray[np.bool_]  # (h, w)
    lit: NDArray[np.bool_]  # (h, w)
    darkened: Floats  # (h, w) luminance in the shadow of another thing

    @property
    def kind(self) -> str:
        """ "lit", "shade" or "both", by what the ground shows."""
        share = float(self.lit[self.ground].mean())
        return "lit" if share > 1 - WHOLE_SHARE else "shade" if share < WHOLE_SHARE else "both"


def report_shadow_mask(model: Model, count: int) -> str:
    """Tables in Markdown of masks by the true light and by the network's, beside no mask and the true one.

    Args:
        model: the network to ask.
        count: of photos of rendered places.
    """
    return _format_masks(model, list(_render_scenes(count)))


def _format_masks(model: Model, scenes: Sequence[_GroundScene]) -> str:
    estimator = Estimator(model)
    predicted = [estimator(Photo(s.picture, GROUND_WIDTH, GROUND_HEIGHT, "PNG")).lighting for s in scenes]
    methods: dict[str, tuple[Sequence[Lighting], list[Floats]]] = {}
    for suffix, lights in ((", true light", [s.light for s in scenes]), ("", predicted)):
        methods[f"no mask{suffix}"] = lights, [np.ones(s.lit.shape) for s in scenes]
        methods[f"mask{suffix}"] = lights, [_predicted_mask(s, light) for s, light in zip(scenes, lights, strict=True)]
        methods[f"true mask{suffix}"] = lights, [np.asarray(s.lit, dtype=np.float64) for s in scenes]
    sections = [SHADE_NOTE]
    for kind in sorted({s.kind for s in scenes}):
        chosen = [i for i, s in enumerate(scenes) if s.kind == kind]
        rows = {
            name: _shade_figures([scenes[i] for i in chosen], [lights[i] for i in chosen], [masks[i] for i in chosen])
            for name, (lights, masks) in methods.items()
        }
        sections += [f"Ground of {len(chosen)} photos: {kind}", figures_table(rows)]
    return "\n\n".join(sections)


def _render_scenes(count: int) -> Iterator[_GroundScene]:
    """Photos of `count` sunny places that show enough ground; each number gives the same one in every run."""
    scenes = (_render_scene(number) for number in itertools.count(FIRST_PLACE))
    return itertools.islice((scene for scene in scenes if scene is not None), count)


def _render_scene(number: int) -> _GroundScene | None:
    """None for a place without sun or ground."""
    rng = np.random.default_rng([17, number])
    sky = random_sky(rng)
    town = RenderedTown(*random_town(rng), sky)
    angles = {"azimuth": rng.uniform(-180, 180), "elevation": rng.uniform(-18, 5)}
    camera = Pinhole(GROUND_WIDTH, GROUND_HEIGHT, rng.uniform(42, 65), **angles)
    if sky.sunlight < MIN_SUN or not town.is_clear():
        return None
    traced = town.photo(camera, 2 * number)
    if traced.ground.mean() < MIN_GROUND:
        return None
    radiance = traced.sky + traced.sun
    gain = auto_exposure_gain(radiance)
    above = row_irradiance(len(sky.radiance)) @ sky.radiance.mean(axis=1, dtype=np.float64)
    light = replace(
        sky.lighting,
        sun_azimuth=float(wrap_azimuth(sky.lighting.sun_azimuth - camera.azimuth)),
        sun_visibility=TRUE_VISIBILITY,
        camera_elevation=camera.elevation,
        vertical_fov=camera.vertical_fov,
        sun_irradiance=tuple((gain * sky.sun_irradiance).tolist()),
        sky_irradiance=tuple((gain * above).tolist()),
    )
    return _GroundScene(tone_map(gain * radiance), light, traced.ground, traced.lit, gain * luminance(traced.sky))


def _predicted_mask(scene: _GroundScene, light: Lighting) -> Floats:
    """How far the picture's ground counts as lit (h, w)."""
    lit = Image.fromarray(ground_shadow_mask(scene.picture, light))
    return np.asarray(lit.resize((GROUND_WIDTH, GROUND_HEIGHT), Image.Resampling.BILINEAR), dtype=np.float64)


def _shade_figures(
    scenes: Sequence[_GroundScene], lights: Sequence[Lighting], masks: Sequence[Floats]
) -> dict[str, float]:
    """Precision, recall and accuracy [%] of shade over all ground, and errors of the shadow [hundredths of a stop]."""
    predicted = np.concatenate([m[s.ground] < 0.5 for s, m in zip(scenes, masks, strict=True)])
    true = np.concatenate([~s.lit[s.ground] for s in scenes])
    errors = [_shadow_error(*one) for one in zip(scenes, lights, masks, strict=True)]
    return {
        "precision of shade": percentage(true[predicted]),
        "recall": percentage(predicted[true]),
        "right": percentage(predicted == true),
        "shadow off by, mean": 100 * float(np.mean(np.abs(np.concatenate(errors)))),
        "median photo": 100 * float(np.median([np.mean(np.abs(e)) for e in errors])),
        "too dark by, mean": 100 * float(np.mean(np.maximum(-np.concatenate(errors), 0.0))),
    }


def _shadow_error(scene: _GroundScene, light: Lighting, lit: Floats) -> Floats:
    """Stops (N,) by which the ground is too bright where a thing that is put there hides the sun."""
    sky = float(luminance(sky_irradiance(light)))
    sun = float(luminance(sun_light(light)[0])) * max(float(light.sun_direction[1]), 0.0)
    remaining = luminance(SRGB_LINEAR[scene.picture])[scene.ground] * sky / (sky + lit[scene.ground] * sun)
    true = np.maximum(scene.darkened[scene.ground], MIN_LUMINANCE_SHADE)
    return np.asarray(np.log2(np.maximum(remaining, MIN_LUMINANCE_SHADE) / true))
