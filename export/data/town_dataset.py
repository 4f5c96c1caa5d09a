"""A folder of rendered towns in the format of any other folder of panoramas, with exact labels."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from export.data.labels import Label, read_labels, write_labels
from export.data.panoramas import RENDERED, Panorama, read_index, write_index
from export.data.path_tracing import RenderedTown, Sky, random_sky
from export.data.procedural_towns import random_town
from lighting.files.exr import write_exr
from lighting.geometry import Floats

LABELS = "labels.csv"
_SAVE_EVERY = 20  # places
_ROUNDING = 1e-9  # so that five times 0.2 is one
_GROUND_RADIUS = 12.0  # m around the camera, where sunlight on the ground counts
_GROUND_POINTS = 400
_MIN_DIRECT, _MIN_PARTLY = 0.25, 0.03  # shares of the sunlight for direct light to be "yes" and "partly"
_MIN_SUNLIGHT = 0.5  # share of the sunlight for turbidity and exposure to be visible in the sky


@dataclass(frozen=True)
class _TownPanorama:
    """A panorama of a rendered place with the truth about it."""

    name: str
    radiance: Floats  # (H, 2H, 3) linear
    label: Label
    sun_visible: bool


def _render_town(number: int, height: int) -> _TownPanorama:
    """Town `number`; the same number gives the same town in every run."""
    rng = np.random.default_rng([8, number])
    sky = random_sky(rng)
    scene = RenderedTown(*random_town(rng), sky)
    while not scene.is_clear():
        scene = RenderedTown(*random_town(rng), sky)
    ground = rng.uniform(-1, 1, (_GROUND_POINTS, 3)) * [_GROUND_RADIUS, 0, _GROUND_RADIUS] + [0, 0.3, 0]
    lit = scene.sunlit_share(ground) * sky.sunlight
    visible = scene.is_sun_visible() and sky.sunlight > _MIN_SUNLIGHT
    name = f"town_{number:05d}"
    return _TownPanorama(name, scene.panorama(height, 2 * number), _make_label(name, sky, lit), visible)


def _make_label(name: str, sky: Sky, lit: float) -> Label:
    label = Label(name, direct="yes" if lit > _MIN_DIRECT else "partly" if lit > _MIN_PARTLY else "no")
    light = sky.lighting
    if not sky.is_overcast:
        label = replace(label, sun_azimuth=light.sun_azimuth, sun_elevation=light.sun_elevation)
        label = replace(label, sun_uncertainty=1.0, sun_source="given")
    if sky.sunlight <= _MIN_SUNLIGHT:
        return label
    return replace(label, turbidity=light.turbidity, exposure=light.exposure, fit_residual=0.0, fit_ok=True)


def render_towns(folder: Path, count: int, height: int, val: float = 0.0) -> None:
    """Render towns until the folder holds `count`; continues where an earlier call stopped.

    Args:
        folder: to fill.
        count: towns in all.
        height: rows of each panorama.
        val: share of the towns that are of the split `val`, 0 to 1, evenly over their numbers.
    """
    root = folder.resolve()
    (root / "panoramas").mkdir(parents=True, exist_ok=True)
    labels = read_labels(root / LABELS) if (root / LABELS).exists() else []
    panoramas = read_index(root)[: len(labels)] if labels else []  # the index is written first: it may hold more
    for number in tqdm(range(len(labels), count), initial=len(labels), total=count, unit="place"):
        rendered = _render_town(number, height)
        panoramas.append(_index_row(rendered, root, _split_of(number, val)))
        labels.append(rendered.label)
        write_exr(panoramas[-1].path, rendered.radiance)
        if number + 1 == count or (number + 1) % _SAVE_EVERY == 0:
            write_index(panoramas, root)
            write_labels(labels, root / LABELS)


def _split_of(number: int, val: float) -> str:
    """The split of town `number`, the same however many towns there will be."""
    return "val" if int((number + 1) * val + _ROUNDING) > int(number * val + _ROUNDING) else "train"


def _index_row(rendered: _TownPanorama, root: Path, split: str) -> Panorama:
    label = rendered.label
    has_sun = label.sun_source != "none"
    path = root / "panoramas" / f"{rendered.name}.exr"
    sun = "none" if not has_sun else "visible" if rendered.sun_visible else "inferred"
    azimuth, elevation, std = (label.sun_azimuth, label.sun_elevation, 1.0) if has_sun else (None, None, None)
    name, more = rendered.name, (label.direct, *RENDERED)
    return Panorama(name, path, "hdr", name, split, sun, azimuth, elevation, std, *more)
