"""How near models of a clear sky come to HDR panoramas, away from the sun.

A model has one exposure a picture, and one white balance: maps give each channel its irradiance. Pictures count by
themselves; walls and trees in them count as sky, so all figures are upper bounds.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from export.data.panoramas import Panorama, read_index, read_linear_panorama
from export.evaluation.metrics import Bools, figures_table
from lighting.color import luminance
from lighting.envmap.latlong import envmap_irradiance, irradiance_from_rows, row_irradiance
from lighting.geometry import Floats, angle_between, direction, latlong_directions
from lighting.sky.clear_sky import prague_radiance, sky_radiance

_BANDS = ((0.0, 10.0), (10.0, 25.0), (25.0, 90.0))  # of the sun's elevation, deg
_TURBIDITIES = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
SKY_NOTE = (
    "Median differences from the sky of HDR panoramas [stops]. They are of luminance after one exposure, of red and "
    "blue over green after white balance, and of the light on four upright faces. Medians over pictures."
)

_ROWS = 64  # of the maps that are compared
_MIN_ELEVATION, _MIN_SUN_ANGLE = 12.0, 12.0  # deg, of the sky that is compared
_FACE_ELEVATION, _FACE_SUN_ANGLE = 6.0, 3.0  # deg, of the sky that lights upright faces
_ALBEDO = 1 / 3  # of the Prague sky's ground
_EPSILON = 1e-6  # radiance that stands for none


class _Sky(Protocol):
    def __call__(self, directions: Floats, sun: Floats, turbidity: float) -> Floats: ...


@dataclass(frozen=True, eq=False)
class _Truth:
    """The upper half of one panorama."""

    sun: Floats  # (3,)
    elevation: float  # deg, of the sun
    image: Floats  # (_ROWS / 2, _ROWS, 3)


@dataclass(frozen=True)
class _SkyErrors:
    """How far a model's sky is from a panorama's [stops]."""

    brightness: float
    color: float
    faces: float


def report_sky_models(data: Path, split: str | None) -> str:
    """A table in Markdown for each band of the sun's elevation.

    Args:
        data: folder of panoramas.
        split: train or val; None: both.
    """
    return _format_errors(list(_read_truths(read_index(data, split))))


def _hosek_wilkie(directions: Floats, sun: Floats, turbidity: float) -> Floats:
    return sky_radiance(directions, sun, turbidity, _ALBEDO)


def _prague(directions: Floats, sun: Floats, turbidity: float) -> Floats:
    return prague_radiance(directions, sun, turbidity)


def _read_truths(panoramas: Sequence[Panorama]) -> Iterator[_Truth]:
    """Those of HDR panoramas whose sun is known and shines."""
    for panorama in panoramas:
        if panorama.kind != "hdr" or panorama.direct not in ("yes", "partly") or panorama.sun_elevation is None:
            continue
        if panorama.sun_azimuth is None or panorama.sun_elevation < 0:
            continue
        image = read_linear_panorama(panorama, _ROWS)
        sun = direction(panorama.sun_azimuth, panorama.sun_elevation)
        yield _Truth(sun, panorama.sun_elevation, np.asarray(image[: _ROWS // 2], dtype=np.float64))


def _format_errors(truths: Sequence[_Truth]) -> str:
    sections = [SKY_NOTE]
    skies: dict[str, _Sky] = {"Hosek-Wilkie": _hosek_wilkie, "Prague": _prague}
    for low, high in _BANDS:
        chosen = [
            truth for truth in truths if low <= truth.elevation < high or truth.elevation == high == _BANDS[-1][1]
        ]
        if not chosen:
            continue
        rows = {}
        for name, sky in skies.items():
            errors = {t: [_compare(truth, partial(sky, turbidity=t)) for truth in chosen] for t in _TURBIDITIES}
            best = [min((errors[t][i] for t in _TURBIDITIES), key=lambda e: e.brightness) for i in range(len(chosen))]
            rows[f"{name}, best turbidity of each picture"] = _figures(best)
            rows |= {f"{name}, turbidity {t:g}": _figures(errors[t]) for t in _TURBIDITIES}
        sections += [f"Suns at {low:g} to {high:g}°: {len(chosen)} pictures", figures_table(rows, 3)]
    return "\n\n".join(sections)


def _figures(errors: Sequence[_SkyErrors]) -> dict[str, float]:
    return {name: float(np.median([getattr(e, name) for e in errors])) for name in ("brightness", "color", "faces")}


def _compare(truth: _Truth, sky: "partial[Floats]") -> _SkyErrors:
    directions = latlong_directions(_ROWS)[: _ROWS // 2]
    image, model = np.maximum(truth.image, _EPSILON), np.maximum(sky(directions, truth.sun), _EPSILON)
    elevation = np.degrees(np.arcsin(directions[..., 1]))
    sun_angle = angle_between(directions, truth.sun)
    compared = (elevation > _MIN_ELEVATION) & (sun_angle > _MIN_SUN_ANGLE)
    bright = np.log2(luminance(model)[compared] / luminance(image)[compared])
    chroma = np.log2((model / model[..., [1]])[compared] / (image / image[..., [1]])[compared])[:, [0, 2]]
    return _SkyErrors(
        _median_deviation(bright),
        float(np.mean([_median_deviation(column) for column in chroma.T])),
        _compare_faces(image, model, (elevation > _FACE_ELEVATION) & (sun_angle > _FACE_SUN_ANGLE)),
    )


def _median_deviation(values: Floats) -> float:
    return float(np.median(np.abs(values - np.median(values))))


def _compare_faces(image: Floats, model: Floats, lit: Bools) -> float:
    """How far the light on four upright faces is off [stops], where that on level ground is right in each channel."""
    normals = direction(np.arange(0.0, 360.0, 90.0), 0.0)
    faces = []
    for half in (image, model):
        whole = np.concatenate([half * lit[..., None], np.zeros_like(half)]).astype(np.float32)
        level = irradiance_from_rows(row_irradiance(_ROWS), whole)
        faces.append(envmap_irradiance(whole, normals) / level)
    return float(np.mean(np.abs(np.log2(faces[1] / faces[0]))))
