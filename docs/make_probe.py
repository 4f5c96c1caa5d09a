"""The worked example of docs/probe.md: a bracket of the project's own sky, merged, beside scans of the real sky.

python -m docs.make_probe [FOLDER]

writes seven 16-bit exposures and the probe made of them below FOLDER (default: a temporary one), and docs/probe.png.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.reports.probe import (
    BRACKET_TIMES,
    SKY_DAY,
    SKY_PLACE,
    BracketCamera,
    clear_sky_at,
    expose_bracket,
    photograph_sky,
    read_sky_scans,
)
from lighting.colour import luminance, tone_map
from lighting.geometry import Floats, direction
from lighting.photo import LinearPhoto
from lighting.probe import Moment, Probe, Scan, Settings, bracket_of, make_probe, orient, write_probe
from lighting.probe.align import yaw_rotation
from lighting.probe.lens import lens_of
from lighting.records import GROUND_ALBEDO
from lighting.sky.cie import general_luminance
from lighting.sky.hosek_wilkie import sky_radiance
from lighting.sky.perez import perez_luminance

PICTURE = Path(__file__).with_name("probe.png")
SIDE = 600
YAW = 40.0  # deg, how the camera was turned
SUNNY = "2013-05-27"


def photos() -> list[LinearPhoto]:
    """Seven exposures of a clear June morning through a fisheye, the sun clipped in all."""
    picture = photograph_sky(
        clear_sky_at(Moment(SKY_DAY, *SKY_PLACE)), lens_of("equidistant", SIDE, SIDE), yaw_rotation(YAW)
    )
    return expose_bracket(picture, BracketCamera(14, fill=8.0), np.random.default_rng(0), BRACKET_TIMES)


def draw(exposures: Sequence[LinearPhoto], probe: Probe, scan: Scan, offset: float) -> None:
    """The exposures, the map, and a scan beside three models."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(12, 12), layout="constrained")
    top, middle, bottom = figure.subfigures(3, 1, height_ratios=(1.1, 3.2, 2.0))
    for axes, photo, time in zip(top.subplots(1, len(exposures)), exposures, BRACKET_TIMES, strict=True):
        axes.imshow(tone_map(photo.pixels, 1.0))
        axes.set_title(_seconds(time), fontsize=10)
        axes.axis("off")
    _draw_map(middle.subplots(), probe)
    skies = _skies(scan, offset)
    domes = bottom.subplots(1, len(skies), subplot_kw={"projection": "polar"})
    for axes, (name, values) in zip(domes, skies, strict=True):
        _draw_sky(axes, name, values, scan, offset)
    figure.savefig(PICTURE, dpi=80)


def _draw_map(axes: Any, probe: Probe) -> None:
    exposure = 0.5 / float(np.median(luminance(probe.image[: len(probe.image) // 2])))
    axes.imshow(tone_map(probe.image, exposure), extent=(-180, 180, -90, 90))
    azimuth, elevation = probe.moment.sun
    axes.plot(azimuth, elevation, "o", mfc="none", mec="black", ms=22)
    axes.text(azimuth, elevation - 20, "sun by the ephemeris", ha="center", fontsize=10)
    axes.set_xticks(range(-180, 181, 90), ["south", "west", "north", "east", "south"])
    axes.set_yticks((-90, 0, 90), ["nadir", "horizon", "zenith"])
    axes.set_title("merged and aligned; the sun, clipped in every exposure, is filled in by the model", fontsize=10)


def _skies(scan: Scan, offset: float) -> list[tuple[str, Floats]]:
    """The measured luminance and three models (N,), each with the measured median."""
    towards, sun = scan.directions(-1, offset), direction(*scan.sun)
    models = {
        "Hosek-Wilkie, turbidity 6": luminance(sky_radiance(towards, sun, 6.0, GROUND_ALBEDO)),
        "Perez, clearness 5.3": perez_luminance(towards, sun, 5.3, 0.15),
        "CIE clear sky": general_luminance(towards, sun, 12),
    }
    scale = np.median(scan.luminance)
    skies = [(name, values * (scale / np.median(values))) for name, values in models.items()]
    return [("measured, 27 May 2013", scan.luminance), *skies]


def _draw_sky(axes: Any, name: str, values: Floats, scan: Scan, offset: float) -> None:
    """The sky as a map, north up and east on the right: 81 directions coloured by the logarithm of their luminance."""
    azimuth = np.radians(-scan.azimuth + offset)
    low, high = np.log(np.percentile(scan.luminance, (2, 98)))
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.scatter(azimuth, 90 - scan.elevation, c=np.log(values), s=55, vmin=low, vmax=high, cmap="viridis")
    axes.plot(np.radians(scan.sun[0]), 90 - scan.sun[1], "o", mfc="none", mec="red", ms=13)
    axes.set_ylim(0, 90)
    axes.set_yticks([])
    axes.set_xticks(np.radians((0, 90, 180, 270)), ["N", "E", "S", "W"])
    axes.set_title(name, fontsize=10)


def _seconds(time: float) -> str:
    return f"{time:.2g} s" if time > 0.3 else f"1/{1 / time:.0f} s"


def write_exposures(exposures: Sequence[LinearPhoto], folder: Path) -> None:
    """The exposures as 16-bit PNG with their times in EXIF."""
    from tests.pictures import taken, write_png16

    folder.mkdir(parents=True, exist_ok=True)
    for index, photo in enumerate(exposures):
        counts: NDArray[np.uint16] = np.rint(photo.pixels * 65535).astype(np.uint16)
        write_png16(folder / f"exposure_{index}.png", counts, taken(BRACKET_TIMES[index]))


def main(folder: Path) -> None:
    exposures = photos()
    write_exposures(exposures, folder)
    probe = make_probe(bracket_of(exposures), Moment(SKY_DAY, *SKY_PLACE), Settings(fill=True))
    write_probe(probe, folder / "probe.exr")
    day = read_sky_scans()[SUNNY]
    draw(exposures, probe, day[4], orient(day).offset)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
