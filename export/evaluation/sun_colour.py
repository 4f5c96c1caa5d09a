"""How far a sun's colour goes to that of a clear sun as high: the fit of a constant in lighting/strength.py.

Of most panoramas the sun is clipped, and its target is their sky's times a clear sky's ratio: of 8-bit pictures, whose
blue is deeper than the sky's, such a sun has too little red. The sunny HDR panoramas say how its colour is; the network
saw those of `train`, those of `val` it did not. The sun of some is clipped as well, so errors on `train` stand once
more without these; few notes of `val` say it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.evaluation.light import Judged, judged
from export.evaluation.tables import table
from lighting.colour import tone_map
from lighting.decoding import lighting_from
from lighting.errors import ModelError
from lighting.evidence import said_of
from lighting.geometry import Floats, angle_between
from lighting.model import Model
from lighting.photo import photo_of
from lighting.strength import toward_clear

POWERS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8)  # of the clear sun's colour, tried


@dataclass(frozen=True)
class Sun:
    """A sun as it is and as the network states it, in one crop."""

    place: str
    true: Floats  # (3,) irradiance of a surface that faces it
    said: Floats  # (3,) the same by the network
    true_level: Floats  # (3,) irradiance of level ground by sun and sky
    said_sky: Floats  # (3,) that of level ground by the sky alone, by the network
    elevation: float  # deg, by the pixels
    unclipped: bool  # whether the panorama's notes say so of it


def suns_of(model: Model, shown: Judged) -> list[Sun]:
    """The suns of sunny crops, where the network sees that they shine; raises ModelError if it states none."""
    found = []
    for (source, _), crop, truth in zip(shown.views, shown.crops, shown.truth, strict=True):
        if truth.sun_direction is None:
            continue
        light = lighting_from(said_of(model, photo_of(tone_map(crop.linear))))
        if light.sun_irradiance is None or light.sky_irradiance is None:
            raise ModelError("The network states no light.")
        level = truth.sun_irradiance * truth.sun_direction[1] + truth.sky_irradiance
        said, sky = np.array(light.sun_irradiance), np.array(light.sky_irradiance)
        if light.sun_shines:
            shot, true = source.panorama, truth.sun_irradiance
            found.append(Sun(shot.place, true, said, level, sky, light.sun_elevation, shot.sun_is_unclipped))
    if not found:
        raise ModelError("The network sees the sun shine in no crop of a sunny HDR panorama.")
    return found


def errors(suns: Sequence[Sun], power: float) -> Floats:
    """Angles (2,) between colours [deg], of the sun and of the light on level ground: means of the places' medians."""
    places: dict[str, list[Floats]] = {}
    for sun in suns:
        colour = toward_clear(sun.said, sun.elevation, power)
        level = colour * np.sin(np.radians(sun.elevation)) + sun.said_sky
        both = angle_between(colour, sun.true), angle_between(level, sun.true_level)
        places.setdefault(sun.place, []).append(np.array(both, dtype=np.float64))
    return np.asarray(np.mean([np.median(found, axis=0) for found in places.values()], axis=0))


def sun_colour_report(model: Model, data: Path, labels: Path) -> str:
    """The errors of colour by power, on `train` and on `val`."""
    train, val = (suns_of(model, judged(data, labels, model.spec, part)) for part in ("train", "val"))
    unclipped = [sun for sun in train if sun.unclipped]
    parts = {"train": train, **({"train, unclipped": unclipped} if unclipped else {}), "val": val}
    header = ["power", *(f"{part}: sun / level light" for part in parts)]
    rows = []
    for power in POWERS:
        pairs = (errors(suns, power) for suns in parts.values())
        rows.append([f"{power:g}", *(f"{sun:.1f}° / {level:.1f}°" for sun, level in pairs)])
    counts = ", ".join(f"{len(suns)} crops of `{part}`" for part, suns in parts.items())
    return f"Error of colour in {counts}, the mean of places\n\n{table(header, rows)}"
