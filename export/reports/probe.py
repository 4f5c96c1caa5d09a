"""How exactly skies are merged, aligned and oriented: known skies, a real stack, scans of the real sky.

`sky_scans.csv` beside this file holds 20 scans of the sky over Cornell University in 81 directions, of 27 May (clear)
and 24 September 2013, as linear Rec.709 of the CIE 1931 observer. They come from the spectral measurements of the
project spectralskylight (repository sky-measurements-2014, Apache License 2.0; Kider, Knowlton, Newlin, Li and
Greenberg, SIGGRAPH Asia 2014); `python -m export.probe.scans` of commit 6df25d7 reduced them.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.envmap.render import render
from lighting.envmap.sun_disc import sun_irradiance
from lighting.geometry import Floats, angle_between, camera_axes, direction, latlong_directions
from lighting.photo.linear import LinearPhoto
from lighting.probe.alignment import SUN_CLEARANCE, ProbeOrientation, Scan, log_errors, orient, yaw_rotation
from lighting.probe.bracket import Bracket, bracket_of
from lighting.probe.develop import BracketSettings, Moment, Probe, make_probe, make_series
from lighting.probe.fisheye import Kind, Lens, fisheye_lens, lens_directions, lens_pixels, to_latlong
from lighting.probe.hdr_merge import clipped
from lighting.records import GROUND_ALBEDO, Lighting
from lighting.sky.cie import general_luminance, overcast_luminance
from lighting.sky.hosek_wilkie import sky_radiance, sun_disc_points, sun_disc_radiance
from lighting.sky.perez import perez_luminance
from lighting.solar_position import sun_position

# Bracketed exposures of known skies: a camera in front of a rendered map, with its noise and its bits.

BRACKET_TIMES = tuple(float(time) for time in np.geomspace(1 / 8000, 1, 7))  # s
ELECTRONS = 50_000.0  # at full scale, of a full-frame camera at its base sensitivity
READ_ELECTRONS = 3.0


@dataclass(frozen=True)
class BracketCamera:
    """A camera's bits, and how much of its full scale the brightest pixel fills in the shortest exposure."""

    bits: int = 14
    fill: float = 0.8  # over 1, the sun clips in every exposure
    noise: bool = True


def photograph_sky(lighting: Lighting, lens: Lens, rotation: Floats) -> NDArray[np.float32]:
    """Mean radiance (h, w, 3) that each pixel of a lens sees of the sky and the sun; 0 outside its circle.

    The sky is sampled in the middle of each pixel; the sun's disc is summed point by point into the pixels that it
    falls on, so that its power is exact.
    """
    pixels = np.stack(np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5), axis=-1)
    towards = lens_directions(lens, pixels) @ rotation.T
    seen = np.isfinite(towards).all(axis=-1)
    sun = lighting.sun_direction
    picture = np.zeros((lens.height, lens.width, 3))
    picture[seen] = sky_radiance(towards[seen], sun, lighting.turbidity, lighting.ground_albedo)
    points, weight = sun_disc_points(sun)
    at = np.floor(lens_pixels(lens, points @ rotation)).astype(np.intp)
    radiance = sun_disc_radiance(points, sun, lighting.turbidity) * weight[:, None]
    np.add.at(picture, (at[:, 1], at[:, 0]), radiance / _pixel_solid_angle(lens, at)[:, None])
    return np.asarray(picture * lighting.exposure, dtype=np.float32)


def _pixel_solid_angle(lens: Lens, at: NDArray[np.intp]) -> Floats:
    """Solid angle [sr] (N,) of the pixels in these columns and rows (N, 2)."""
    a, b, c, d = (lens_directions(lens, at + np.array(corner)) for corner in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.asarray(np.linalg.norm(np.cross(c - a, d - b), axis=-1) / 2)


def expose_bracket(
    picture: NDArray[np.float32],
    camera: BracketCamera,
    rng: np.random.Generator,
    times: Sequence[float] = BRACKET_TIMES,
) -> list[LinearPhoto]:
    """A bracket of a picture's radiance (h, w, 3), the longest exposure last; relative exposures are `times`."""
    gain = camera.fill / (float(picture.max()) * min(times))
    full = 2**camera.bits - 1
    photos = []
    for time in times:
        value = np.asarray(picture * (gain * time), dtype=np.float64)
        if camera.noise:
            electrons = np.minimum(value, 2.0) * ELECTRONS
            value = rng.normal(electrons, np.sqrt(electrons + READ_ELECTRONS**2)) / ELECTRONS
        counts = np.clip(np.rint(value * full), 0, full)
        photos.append(LinearPhoto((counts / full).astype(np.float32), 0.98, 1 / full, time))
    return photos


def _bracket_gain(picture: NDArray[np.float32], camera: BracketCamera, times: Sequence[float] = BRACKET_TIMES) -> float:
    """Merged radiance / true radiance of such a bracket."""
    return camera.fill / (float(picture.max()) * min(times))


# Scans of the real sky: how a scanner's azimuth counts, and which model fits.

SkyShape = Callable[[Floats, Floats], Iterable[Floats]]

SCANS = Path(__file__).with_name("sky_scans.csv")
SCAN_PLACE = (42.443449, -76.481962)  # deg, the roof of Rhodes Hall
SCAN_COLUMNS = ("utc", "azimuth_as_filed", "elevation", "red", "green", "blue")


def read_sky_scans(path: Path = SCANS) -> dict[str, list[Scan]]:
    """The scans of each day, by date."""
    rows: dict[str, list[dict[str, str]]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            rows.setdefault(row["utc"], []).append(row)
    days: dict[str, list[Scan]] = {}
    for time in sorted(rows):
        days.setdefault(time[:10], []).append(_scan(time, rows[time]))
    return days


def _scan(time: str, rows: list[dict[str, str]]) -> Scan:
    colour = np.array([[float(row[name]) for name in SCAN_COLUMNS[3:]] for row in rows])
    azimuth, elevation = (np.array([float(row[name]) for row in rows]) for name in SCAN_COLUMNS[1:3])
    sun = sun_position(datetime.fromisoformat(time), *SCAN_PLACE)
    return Scan(azimuth, elevation, luminance(colour), (float(sun[0]), float(sun[1])))


SCAN_MODELS: dict[str, SkyShape] = {
    "Hosek-Wilkie, turbidity fitted": lambda towards, sun: (
        luminance(sky_radiance(towards, sun, float(turbidity), GROUND_ALBEDO)) for turbidity in np.arange(1, 10.1, 0.25)
    ),
    "Perez, clearness and brightness fitted": lambda towards, sun: (
        perez_luminance(towards, sun, clearness, brightness)
        for clearness in (1.03, 1.15, 1.35, 1.7, 2.3, 3.5, 5.3, 8.0)
        for brightness in np.arange(0.05, 0.5, 0.05)
    ),
    "CIE general sky, type fitted": lambda towards, sun: (general_luminance(towards, sun, k) for k in range(1, 16)),
    "CIE clear sky (type 12)": lambda towards, sun: [general_luminance(towards, sun, 12)],
    "CIE overcast sky": lambda towards, _: [overcast_luminance(towards)],
}


def _scan_residuals(scans: list[Scan], sense: int, offset: float, model: SkyShape) -> Floats:
    """Relative error (S,) of a model at its best in each scan: root mean square of the logarithm, free of scale."""
    result = []
    for scan in scans:
        towards, sun = scan.directions(sense, offset), direction(*scan.sun)
        far = angle_between(towards, sun) > SUN_CLEARANCE
        result.append(min(_rms(log_errors(scan.luminance[far], values)) for values in model(towards[far], sun)))
    return np.array(result)


def _rms(error: Floats) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _report_scans(path: Path = SCANS) -> str:
    """What the scans say, as tables in Markdown."""
    parts = []
    for day, scans in read_sky_scans(path).items():
        found = orient(scans)
        sense = "clockwise" if found.sense > 0 else "counter-clockwise"
        far = _offset_along_sky(scans, found, found.offset)
        parts.append(
            f"### {day}, {len(scans)} scans\n\nazimuths run {sense} from {found.offset:.1f}° (error {found.error:.3f}, "
            f"the other sense {found.other:.3f}); each scan alone says {found.offsets.min():.0f} to "
            f"{found.offsets.max():.0f}°, {found.offsets.mean():.1f} ± {found.offsets.std():.1f}, along the sky at "
            f"most {far:.1f}° from it\n\n| model | median error | least | largest |\n|---|---:|---:|---:|"
        )
        for name, model in SCAN_MODELS.items():
            error = 100 * _scan_residuals(scans, found.sense, found.offset, model)
            parts.append(f"| {name} | {np.median(error):.0f} % | {error.min():.0f} % | {error.max():.0f} % |")
        parts.append("")
    return "\n".join(parts)


def _offset_along_sky(scans: list[Scan], found: ProbeOrientation, offset: float) -> float:
    """How far [deg] along the sky, at the sun's height, a single scan's azimuths are at most from those by `offset`."""
    height = np.radians([scan.sun[1] for scan in scans])
    return float(np.max(np.abs(found.offsets - offset) * np.cos(height)))


# The tables.

SKY_PLACE = (47.0, 8.0)  # deg
SKY_DAY = datetime(2024, 6, 1, 9, 0, tzinfo=UTC)
PICTURE_SIDE = 800  # pixels of a picture
SERIES_SIDE = 500  # pixels of a picture of a series
TURBIDITY = 3.0  # of the synthetic clear skies
MAP_HEIGHT = 256  # rows of the maps compared
SKY_FILL = 8.0  # of full scale: the peak in the shortest exposure when the sky is exposed for, and the sun clips
_DARK = 0.05  # quantile that counts as the darkest sky


@dataclass(frozen=True)
class _BracketErrors:
    """A merged synthetic bracket against its truth."""

    sky: float  # root mean square of the relative error over the sky
    alone: float  # the same of the longest exposure alone, without any merging
    steps: float  # of the camera's rounding, that red has in it in the darkest twentieth of the sky
    sun: float  # largest relative error of the sun's irradiance over the channels
    clipped: bool  # what the probe says of the sun
    turn: float  # deg, between the rotation found and the true one


def clear_sky_at(moment: Moment) -> Lighting:
    """A clear sky of a moment."""
    azimuth, elevation = moment.sun
    return Lighting(sun_azimuth=azimuth, sun_elevation=elevation, turbidity=TURBIDITY, exposure=1.0)


def _measure_bracket(
    camera: BracketCamera, moment: Moment, lens: Lens, yaw: float, seed: int = 0, times: Sequence[float] = BRACKET_TIMES
) -> _BracketErrors:
    """Photograph a clear sky, merge it and compare."""
    lighting, rotation = clear_sky_at(moment), yaw_rotation(yaw)
    picture = photograph_sky(lighting, lens, rotation)
    bracket = bracket_of(expose_bracket(picture, camera, np.random.default_rng(seed), times))
    probe = make_probe(bracket, moment, _settings(lens))
    assert probe.spot is not None
    assert probe.alignment is not None
    gain = _bracket_gain(picture, camera, times)
    power = probe.spot.irradiance / gain / sun_irradiance(lighting) - 1
    longest = bracket.photos[-1]
    single = to_latlong(longest.pixels / np.float32(times[-1]), clipped(longest), lens, rotation, MAP_HEIGHT)[0]
    return _BracketErrors(
        sky=_sky_error(probe.image, lighting, gain),
        alone=_sky_error(single, lighting, gain),
        steps=float(np.quantile(picture[picture.any(axis=-1), 0], _DARK) * gain * times[-1] / longest.step),
        sun=float(np.abs(power).max()),
        clipped=probe.spot.clipped,
        turn=_rotation_between(probe.alignment.rotation, rotation),
    )


def _sky_error(image: NDArray[np.float32], lighting: Lighting, gain: float) -> float:
    """Relative root mean square over the sky above 5 deg and 5 deg from the sun, of a map (H, 2H, 3)."""
    towards = latlong_directions(len(image))
    sky = (towards[..., 1] > np.sin(np.radians(5))) & (angle_between(towards, lighting.sun_direction) > 5)
    truth = render(lighting, len(image), sun=False)[sky]
    return float(np.sqrt(np.mean((image[sky] / gain / truth - 1) ** 2)))


def _rotation_between(a: Floats, b: Floats) -> float:
    """The angle [deg] of the rotation between two."""
    return float(np.degrees(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1))))


def _merging_table() -> Iterator[str]:
    """Seven brackets, by bits and by what they are exposed for."""
    yield f"## Seven exposures of 1/8000 to 1 s, {PICTURE_SIDE} x {PICTURE_SIDE} pixels, map of {MAP_HEIGHT} rows\n"
    yield "| bits | exposed for | sky, relative RMSE | sun's irradiance | the probe says | alignment |"
    yield "|---:|---|---:|---:|---|---:|"
    lens, moment = fisheye_lens("equidistant", PICTURE_SIDE, PICTURE_SIDE), Moment(SKY_DAY, *SKY_PLACE)
    for bits in (8, 12, 14):
        for fill, name in ((0.8, "the sun"), (SKY_FILL, "the sky")):
            got = _measure_bracket(BracketCamera(bits, fill), moment, lens, 40.0)
            sun = "-" if got.clipped else f"{100 * got.sun:.1f} %"
            yield (
                f"| {bits} | {name} | {100 * got.sky:.1f} % | {sun} | {'clipped' if got.clipped else 'not clipped'} "
                f"| {got.turn:.2f}° |"
            )


def _rounding_table() -> Iterator[str]:
    """What a bracket that is exposed for the sun needs for its sky: bits, or longer exposures."""
    yield "\n## Seven exposures from 1/8000 s on, exposed for the sun\n"
    yield "| bits | longest | rounding steps in the darkest sky | sky, relative RMSE | by the longest exposure alone |"
    yield "|---:|---:|---:|---:|---:|"
    lens, moment = fisheye_lens("equidistant", PICTURE_SIDE, PICTURE_SIDE), Moment(SKY_DAY, *SKY_PLACE)
    for bits, longest in ((8, 1), (8, 2), (8, 4), (9, 1), (10, 1), (12, 1)):
        times = np.geomspace(BRACKET_TIMES[0], longest, len(BRACKET_TIMES))
        got = _measure_bracket(BracketCamera(bits), moment, lens, 40.0, times=times.tolist())
        yield f"| {bits} | {longest} s | {got.steps:.1f} | {100 * got.sky:.1f} % | {100 * got.alone:.1f} % |"


def _heights_table() -> Iterator[str]:
    """What 8 bits that are exposed for the sun leave of the sky, by the height of the sun."""
    yield "\n## Seven exposures of 8 bits, 1/8000 to 1 s, exposed for the sun\n"
    yield "| sun's height | rounding steps in the darkest sky | sky, relative RMSE | by the longest exposure alone |"
    yield "|---:|---:|---:|---:|"
    lens = fisheye_lens("equidistant", PICTURE_SIDE, PICTURE_SIDE)
    for hours in (-3, 6, 0, 3):
        moment = Moment(SKY_DAY + timedelta(hours=hours), *SKY_PLACE)
        got = _measure_bracket(BracketCamera(8), moment, lens, 40.0)
        yield f"| {moment.sun[1]:.0f}° | {got.steps:.1f} | {100 * got.sky:.1f} % | {100 * got.alone:.1f} % |"


def _alignment_tables() -> Iterator[str]:
    """One probe by its yaw; series of a tilted camera whose lens was told wrongly."""
    yield "\n## Alignment\n\nOne probe of each lens, yaw alone:\n"
    yield "| lens | yaw | error |\n|---|---:|---:|"
    for index, (kind, width) in enumerate(_LENSES):
        yaw, height = 30.0 + 77.0 * index, PICTURE_SIDE
        got = _measure_bracket(
            BracketCamera(14), Moment(SKY_DAY, *SKY_PLACE), fisheye_lens(kind, width, height), yaw, index
        )
        yield f"| {kind} | {yaw:.0f}° | {got.turn:.2f}° |"
    yield "\nSeries of seven hours, sun clipped; what is told of the camera: upright, 180°, not mirrored:\n"
    yield "| tilt | field of view | mirrored | error of the turn | found: tilt | field of view | mirrored |"
    yield "|---:|---:|---|---:|---:|---:|---|"
    for tilt, fov, mirrored in ((0.0, 180.0, False), (3.0, 180.0, False), (3.0, 190.0, True), (6.0, 172.0, False)):
        yield _series_row(tilt, fov, mirrored)


_LENSES: Sequence[tuple[Kind, int]] = (
    ("equidistant", PICTURE_SIDE),
    ("equisolid", PICTURE_SIDE),
    ("ball", PICTURE_SIDE),
    ("latlong", 2 * PICTURE_SIDE),
)


def _synthetic_series(tilt: float, fov: float, mirrored: bool) -> tuple[list[Probe], Floats]:
    """The probes of a synthetic series, and the true rotation: yaw 70 deg after a tilt towards the north-east."""
    lens = fisheye_lens("equidistant", SERIES_SIDE, SERIES_SIDE, fov=fov, mirrored=mirrored)
    rotation = yaw_rotation(70.0) @ _tilted(tilt)
    moments = [Moment(SKY_DAY + timedelta(hours=hour - 2), *SKY_PLACE) for hour in range(7)]
    rng = np.random.default_rng(5)
    readers = [partial(_bracket, clear_sky_at(moment), lens, rotation, rng) for moment in moments]
    told = BracketSettings(height=128)
    return list(make_series(readers, moments, told)), rotation


def _series_row(tilt: float, fov: float, mirrored: bool) -> str:
    probes, rotation = _synthetic_series(tilt, fov, mirrored)
    found = probes[0].alignment
    assert found is not None
    error = _rotation_between(found.rotation, rotation)
    return (
        f"| {tilt:.0f}° | {fov:.0f}° | {_yes(mirrored)} | {error:.2f}° | {found.tilt:.2f}° | {found.lens.fov:.1f}° "
        f"| {_yes(found.lens.mirrored)} |"
    )


def _bracket(lighting: Lighting, lens: Lens, rotation: Floats, rng: np.random.Generator) -> Bracket:
    picture = photograph_sky(lighting, lens, rotation)
    photos: list[LinearPhoto] = expose_bracket(picture, BracketCamera(14, SKY_FILL), rng, BRACKET_TIMES[::2])
    return bracket_of(photos)


def _tilted(tilt: float) -> Floats:
    """The rotation (3, 3) about a horizontal axis that lowers the zenith by `tilt` [deg] towards the north-east."""
    axes = camera_axes(45.0, -tilt, 0.0)
    level = camera_axes(45.0, 0.0, 0.0)
    return np.asarray(axes.T @ level)


def report_probe() -> Iterator[str]:
    """All tables, line by line; they take minutes."""
    yield from _merging_table()
    yield from _rounding_table()
    yield from _heights_table()
    yield from _alignment_tables()
    yield "\n## Scans of the real sky\n"
    yield _report_scans()


def _settings(lens: Lens) -> BracketSettings:
    return BracketSettings(
        kind=lens.kind, fov=lens.fov, centre=lens.centre, radius=lens.radius, pitch=lens.pitch, height=MAP_HEIGHT
    )


def _yes(value: bool) -> str:
    return "yes" if value else "no"
