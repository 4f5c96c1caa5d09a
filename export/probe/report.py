"""`python -m export probe`: how exactly skies are merged, aligned and oriented, as tables in Markdown."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.data import DataError
from export.probe.scans import report as scans_report
from export.probe.synthetic import TIMES, Camera, expose, gain_of, photograph
from lighting.envmap import render, sun_irradiance
from lighting.geometry import Floats, angle_between, camera_axes, latlong_directions
from lighting.photo import LinearPhoto
from lighting.probe.align import yaw_rotation
from lighting.probe.develop import Probe, make_probe, make_series
from lighting.probe.exposures import Bracket, bracket_of, read_bracket
from lighting.probe.lens import Kind, Lens, lens_of
from lighting.probe.mapping import to_latlong
from lighting.probe.ratios import clipped, exposed
from lighting.probe.settings import Moment, Settings
from lighting.records import Lighting

PLACE = (47.0, 8.0)  # deg
DAY = datetime(2024, 6, 1, 9, 0, tzinfo=UTC)
SIDE = 800  # pixels of a picture
SERIES_SIDE = 500  # pixels of a picture of a series
TURBIDITY = 3.0  # of the synthetic clear skies
HEIGHT = 256  # rows of the maps compared
SKY_FILL = 8.0  # of full scale: the peak in the shortest exposure when the sky is exposed for, and the sun clips
_EXPOSURE = "_image.png"  # how the names of the stack's exposures end
_DARK = 0.05  # quantile that counts as the darkest sky
ALPNACH = Moment(datetime(2018, 1, 29, 11, 9, 20, tzinfo=UTC), 46.94, 8.28)
ALPNACH_CIRCLE = ((149.5, 141.0), 132.5)  # centre and radius, pixels, read off the longest exposure


@dataclass(frozen=True)
class Measured:
    """A merged synthetic bracket against its truth."""

    sky: float  # root mean square of the relative error over the sky
    alone: float  # the same of the longest exposure alone, without any merging
    steps: float  # of the camera's rounding, that red has in it in the darkest twentieth of the sky
    sun: float  # largest relative error of the sun's irradiance over the channels
    clipped: bool  # what the probe says of the sun
    turn: float  # deg, between the rotation found and the true one


def lighting_at(moment: Moment) -> Lighting:
    """A clear sky of a moment."""
    azimuth, elevation = moment.sun
    return Lighting(sun_azimuth=azimuth, sun_elevation=elevation, turbidity=TURBIDITY, exposure=1.0)


def measure(
    camera: Camera, moment: Moment, lens: Lens, yaw: float, seed: int = 0, times: Sequence[float] = TIMES
) -> Measured:
    """Photograph a clear sky, merge it and compare."""
    lighting, rotation = lighting_at(moment), yaw_rotation(yaw)
    picture = photograph(lighting, lens, rotation)
    bracket = bracket_of(expose(picture, camera, np.random.default_rng(seed), times))
    probe = make_probe(bracket, moment, _settings(lens))
    assert probe.spot is not None
    assert probe.alignment is not None
    gain = gain_of(picture, camera, times)
    power = probe.spot.irradiance / gain / sun_irradiance(lighting) - 1
    longest = bracket.photos[-1]
    single = to_latlong(longest.pixels / np.float32(times[-1]), clipped(longest), lens, rotation, HEIGHT)[0]
    return Measured(
        sky=sky_error(probe.image, lighting, gain),
        alone=sky_error(single, lighting, gain),
        steps=float(np.quantile(picture[picture.any(axis=-1), 0], _DARK) * gain * times[-1] / longest.step),
        sun=float(np.abs(power).max()),
        clipped=probe.spot.clipped,
        turn=turned(probe.alignment.rotation, rotation),
    )


def sky_error(image: NDArray[np.float32], lighting: Lighting, gain: float) -> float:
    """Relative root mean square over the sky above 5 deg and 5 deg from the sun, of a map (H, 2H, 3)."""
    towards = latlong_directions(len(image))
    sky = (towards[..., 1] > np.sin(np.radians(5))) & (angle_between(towards, lighting.sun_direction) > 5)
    truth = render(lighting, len(image), sun=False)[sky]
    return float(np.sqrt(np.mean((image[sky] / gain / truth - 1) ** 2)))


def turned(a: Floats, b: Floats) -> float:
    """The angle [deg] of the rotation between two."""
    return float(np.degrees(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1))))


def merging() -> Iterator[str]:
    """Seven brackets, by bits and by what they are exposed for."""
    yield f"## Seven exposures of 1/8000 to 1 s, {SIDE} x {SIDE} pixels, map of {HEIGHT} rows\n"
    yield "| bits | exposed for | sky, relative RMSE | sun's irradiance | the probe says | alignment |"
    yield "|---:|---|---:|---:|---|---:|"
    lens, moment = lens_of("equidistant", SIDE, SIDE), Moment(DAY, *PLACE)
    for bits in (8, 12, 14):
        for fill, name in ((0.8, "the sun"), (SKY_FILL, "the sky")):
            got = measure(Camera(bits, fill), moment, lens, 40.0)
            sun = "-" if got.clipped else f"{100 * got.sun:.1f} %"
            yield (
                f"| {bits} | {name} | {100 * got.sky:.1f} % | {sun} | {'clipped' if got.clipped else 'not clipped'} "
                f"| {got.turn:.2f}° |"
            )


def rounding() -> Iterator[str]:
    """What a bracket that is exposed for the sun needs for its sky: bits, or longer exposures."""
    yield "\n## Seven exposures from 1/8000 s on, exposed for the sun\n"
    yield "| bits | longest | rounding steps in the darkest sky | sky, relative RMSE | by the longest exposure alone |"
    yield "|---:|---:|---:|---:|---:|"
    lens, moment = lens_of("equidistant", SIDE, SIDE), Moment(DAY, *PLACE)
    for bits, longest in ((8, 1), (8, 2), (8, 4), (9, 1), (10, 1), (12, 1)):
        times = np.geomspace(TIMES[0], longest, len(TIMES))
        got = measure(Camera(bits), moment, lens, 40.0, times=times.tolist())
        yield f"| {bits} | {longest} s | {got.steps:.1f} | {100 * got.sky:.1f} % | {100 * got.alone:.1f} % |"


def heights() -> Iterator[str]:
    """What 8 bits that are exposed for the sun leave of the sky, by the height of the sun."""
    yield "\n## Seven exposures of 8 bits, 1/8000 to 1 s, exposed for the sun\n"
    yield "| sun's height | rounding steps in the darkest sky | sky, relative RMSE | by the longest exposure alone |"
    yield "|---:|---:|---:|---:|"
    lens = lens_of("equidistant", SIDE, SIDE)
    for hours in (-3, 6, 0, 3):
        moment = Moment(DAY + timedelta(hours=hours), *PLACE)
        got = measure(Camera(8), moment, lens, 40.0)
        yield f"| {moment.sun[1]:.0f}° | {got.steps:.1f} | {100 * got.sky:.1f} % | {100 * got.alone:.1f} % |"


def alignment() -> Iterator[str]:
    """One probe by its yaw; series of a tilted camera whose lens was told wrongly."""
    yield "\n## Alignment\n\nOne probe of each lens, yaw alone:\n"
    yield "| lens | yaw | error |\n|---|---:|---:|"
    for index, (kind, width) in enumerate(_LENSES):
        yaw, height = 30.0 + 77.0 * index, SIDE
        got = measure(Camera(14), Moment(DAY, *PLACE), lens_of(kind, width, height), yaw, index)
        yield f"| {kind} | {yaw:.0f}° | {got.turn:.2f}° |"
    yield "\nSeries of seven hours, sun clipped; what is told of the camera: upright, 180°, not mirrored:\n"
    yield "| tilt | field of view | mirrored | error of the turn | found: tilt | field of view | mirrored |"
    yield "|---:|---:|---|---:|---:|---:|---|"
    for tilt, fov, mirrored in ((0.0, 180.0, False), (3.0, 180.0, False), (3.0, 190.0, True), (6.0, 172.0, False)):
        yield _series_row(tilt, fov, mirrored)


_LENSES: Sequence[tuple[Kind, int]] = (
    ("equidistant", SIDE),
    ("equisolid", SIDE),
    ("ball", SIDE),
    ("latlong", 2 * SIDE),
)


def series(tilt: float, fov: float, mirrored: bool) -> tuple[list[Probe], Floats]:
    """The probes of a synthetic series, and the true rotation: yaw 70 deg after a tilt towards the north-east."""
    lens = lens_of("equidistant", SERIES_SIDE, SERIES_SIDE, fov=fov, mirrored=mirrored)
    rotation = yaw_rotation(70.0) @ _tilted(tilt)
    moments = [Moment(DAY + timedelta(hours=hour - 2), *PLACE) for hour in range(7)]
    rng = np.random.default_rng(5)
    readers = [partial(_bracket, lighting_at(moment), lens, rotation, rng) for moment in moments]
    told = Settings(height=128)
    return list(make_series(readers, moments, told)), rotation


def _series_row(tilt: float, fov: float, mirrored: bool) -> str:
    probes, rotation = series(tilt, fov, mirrored)
    found = probes[0].alignment
    assert found is not None
    return (
        f"| {tilt:.0f}° | {fov:.0f}° | {_yes(mirrored)} | {turned(found.rotation, rotation):.2f}° | {found.tilt:.2f}° "
        f"| {found.lens.fov:.1f}° | {_yes(found.lens.mirrored)} |"
    )


def _bracket(lighting: Lighting, lens: Lens, rotation: Floats, rng: np.random.Generator) -> Bracket:
    picture = photograph(lighting, lens, rotation)
    photos: list[LinearPhoto] = expose(picture, Camera(14, SKY_FILL), rng, TIMES[::2])
    return bracket_of(photos)


def _tilted(tilt: float) -> Floats:
    """The rotation (3, 3) about a horizontal axis that lowers the zenith by `tilt` [deg] towards the north-east."""
    axes = camera_axes(45.0, -tilt, 0.0)
    level = camera_axes(45.0, 0.0, 0.0)
    return np.asarray(axes.T @ level)


def read_stack(folder: Path) -> Bracket:
    """The exposures in the Alpnach stack's folder; DataError where it holds fewer than two, PhotoError, ProbeError."""
    files = sorted(folder.glob(f"*{_EXPOSURE}"))
    if len(files) < 2:
        raise DataError(f"{folder} holds no stack: it takes two exposures or more, named *{_EXPOSURE}.")
    return read_bracket(files, "linear")


def stack(bracket: Bracket) -> Iterator[str]:
    """A real fisheye stack without exposure times."""
    yield f"\n## The fisheye stack of Alpnach, {len(bracket.photos)} exposures\n"
    yield "| exposures | ratio | standard error | values used |\n|---|---:|---:|---:|"
    for index, ratio in enumerate(exposed(bracket).ratios):
        assert ratio is not None
        yield f"| {index} to {index + 1} | {ratio.value:.2f} | {100 * ratio.error:.1f} % | {ratio.samples} |"
    yield "\n| lens | sun found off the ephemeris | the probe says |\n|---|---:|---|"
    for kind in ("equidistant", "equisolid"):
        told = Settings(kind=kind, centre=ALPNACH_CIRCLE[0], radius=ALPNACH_CIRCLE[1], height=HEIGHT)
        probe = make_probe(bracket, ALPNACH, told)
        yield f"| {kind}, 180° | {probe.off:.1f}° | {probe.warnings[0]} |"


def report(folder: Path | None) -> Iterator[str]:
    """All tables, line by line; the stack's where its folder is given, which is read first: the rest takes minutes."""
    bracket = None if folder is None else read_stack(folder)
    yield from merging()
    yield from rounding()
    yield from heights()
    yield from alignment()
    if bracket is not None:
        yield from stack(bracket)
    yield "\n## Scans of the real sky\n"
    yield scans_report()


def _settings(lens: Lens) -> Settings:
    return Settings(
        kind=lens.kind, fov=lens.fov, centre=lens.centre, radius=lens.radius, pitch=lens.pitch, height=HEIGHT
    )


def _yes(value: bool) -> str:
    return "yes" if value else "no"
