"""Sets of 3 to 5 overlapping photos: their headings, their lens, and what that makes of the sun."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from export.data import Panorama
from export.turns.sets import Taken, sweep
from lighting.evidence import Evidence, Fused, fuse_together, said_of
from lighting.geometry import Floats, angle_between, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo import photo_of
from lighting.records import Prediction
from lighting.turns import Placed, Shot, features, place

SIZES = (3, 4, 5)


@dataclass(frozen=True, eq=False)
class Group:
    """One set and all that was said of it."""

    taken: list[Taken]
    said: list[Prediction]
    placed: tuple[Placed, ...]
    matched: tuple[Fused, ...]  # with the turns by matches
    true: tuple[Fused, ...]  # with the true headings
    blind: tuple[Fused, ...]  # with unknown headings
    sun: Floats | None  # (3,) true, from azimuth 0 of the panorama


def groups(model: Model, panoramas: Sequence[Panorama]) -> list[Group]:
    """A set of each panorama, of 3, 4 and 5 photos in turn."""
    return [_group(model, p, SIZES[i % len(SIZES)]) for i, p in enumerate(tqdm(panoramas, unit="set"))]


def _group(model: Model, panorama: Panorama, size: int) -> Group:
    taken = sweep(panorama, size, "set")
    said = predictions(model, taken)
    placed = place(
        [
            Shot(features(t.pixels), p.camera_elevation, p.camera_roll, p.vertical_fov)
            for t, p in zip(taken, said, strict=True)
        ]
    )
    nothing, headings = [Evidence()] * size, [t.camera.azimuth for t in taken]
    sun = None
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        sun = direction(panorama.sun_azimuth, max(panorama.sun_elevation, 0.0))
    return Group(
        taken,
        said,
        placed,
        fuse_together(said, nothing, None, placed),
        fuse_together(said, nothing, headings),
        fuse_together(said, nothing),
        sun,
    )


def predictions(model: Model, taken: Sequence[Taken]) -> list[Prediction]:
    """What the network says of each photo alone."""
    return [said_of(model, photo_of(t.pixels)) for t in taken]


def figures(found: Sequence[Group]) -> dict[str, float]:
    """Of all photos of all sets; angles in deg, shares in %."""
    heading = np.concatenate([_heading_errors(g) for g in found])
    known = np.isfinite(heading)
    fov = np.concatenate([_fov_errors(g) for g in found])
    moved = np.concatenate([angle_between(_suns(g.matched), _suns(g.true)) for g in found])
    whole = np.concatenate([np.full(len(g.taken), _connected(g)) for g in found])
    return {
        "photos": float(sum(len(g.taken) for g in found)),
        "connected [%]": 100 * float(np.mean([_connected(g) for g in found])),
        "heading, 50 %": float(np.median(heading[known])),
        "95 %": float(np.quantile(heading[known], 0.95)),
        "over 2° [%]": 100 * float(np.mean(heading[known] > 2.0)),
        "field of view, 50 %": float(np.nanmedian(fov)),
        "of the network": float(np.median(np.concatenate([_network_fov_errors(g) for g in found]))),
        "sun moved by the matched headings, 50 %": float(np.median(moved)),
        "90 %": float(np.quantile(moved, 0.9)),
        "within 1° [%]": 100 * float(np.mean(moved <= 1.0)),
        "of connected sets [%]": 100 * float(np.mean(moved[whole] <= 1.0)),
    }


def sun_figures(found: Sequence[Group]) -> dict[str, dict[str, float]]:
    """Errors of the sun over sets that have one, by what is known of the headings."""
    lit = [g for g in found if g.sun is not None]
    ways = {"headings unknown": "blind", "headings by matches": "matched", "true headings": "true"}
    return {name: _sun_row(lit, attribute) for name, attribute in ways.items()}


def _sun_row(lit: Sequence[Group], attribute: str) -> dict[str, float]:
    error = np.concatenate([_sun_errors(g, getattr(g, attribute)) for g in lit])
    answers = [f for g in lit for f in getattr(g, attribute)]
    return {
        "photos": float(len(error)),
        "sun, 50 %": float(np.median(error)),
        "under 45° [%]": 100 * float(np.mean(error < 45.0)),
        "in 50 % region [%]": 100 * float(np.mean(error <= [f.sun.radius_50 for f in answers])),
        "in 90 % region [%]": 100 * float(np.mean(error <= [f.sun.radius_90 for f in answers])),
    }


def tilt_figures(found: Sequence[Group]) -> dict[str, dict[str, float]]:
    """Errors of the cameras' elevation and roll, by the network for each photo and by the set's common vertical."""
    true = np.array([(t.camera.elevation, t.camera.roll) for g in found for t in g.taken])
    alone = np.array([(p.camera_elevation, p.camera_roll) for g in found for p in g.said])
    level = np.array([(p.camera_elevation, p.camera_roll) for g in found for p in g.placed])
    return {
        name: {"elevation, 50 %": float(off[0]), "roll, 50 %": float(off[1])}
        for name, off in (
            ("the network", np.median(np.abs(alone - true), axis=0)),
            ("the set", np.median(np.abs(level - true), axis=0)),
        )
    }


def _suns(answers: Sequence[Fused]) -> Floats:
    return direction([f.sun.azimuth for f in answers], [f.sun.elevation for f in answers])


def _sun_errors(group: Group, answers: Sequence[Fused]) -> Floats:
    turned = [f.sun.azimuth + t.camera.azimuth for f, t in zip(answers, group.taken, strict=True)]
    assert group.sun is not None
    return angle_between(direction(turned, [f.sun.elevation for f in answers]), group.sun)


def _connected(group: Group) -> bool:
    return len({p.group for p in group.placed}) == 1


def _heading_errors(group: Group) -> Floats:
    """Errors (n - 1,) against the first photo, NaN for photos that are not connected with it."""
    true = np.array([t.camera.azimuth for t in group.taken])
    found = np.array([p.heading if p.group == group.placed[0].group else np.nan for p in group.placed])
    return np.abs(wrap_azimuth(found - (true - true[0])))[1:]


def _fov_errors(group: Group) -> Floats:
    return np.array(
        [
            np.nan if p.vertical_fov is None else abs(p.vertical_fov - t.camera.vertical_fov)
            for p, t in zip(group.placed, group.taken, strict=True)
        ]
    )


def _network_fov_errors(group: Group) -> Floats:
    return np.array([abs(p.vertical_fov - t.camera.vertical_fov) for p, t in zip(group.said, group.taken, strict=True)])
