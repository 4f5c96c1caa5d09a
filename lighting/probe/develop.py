"""A bracket becomes a probe: a sky in the world's axes, aligned by its sun, written as OpenEXR.

A sun that no exposure could measure may be taken from the model of the sky beside it.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import MAX_RADIANCE
from lighting.envmap.render import render, sun_light
from lighting.errors import ErrorCode, ProbeError
from lighting.files.exr import write_exr
from lighting.geometry import Floats, angle_between, angles, direction, latlong_directions, wrap_azimuth
from lighting.photo.linear import Curve
from lighting.probe.alignment import Alignment, align_by_sun, align_series, yaw_rotation
from lighting.probe.bracket import TIME_ATTRIBUTE, Bracket, probe_path
from lighting.probe.fisheye import (
    Lens,
    LensKind,
    check_lens,
    make_lens,
    pixels_per_degree,
    project_to_lens,
    resample_to_latlong,
)
from lighting.probe.merging import (
    SMOOTHING_REACH,
    MergedHdr,
    dequantize,
    measure_ratios,
    merge_exposures,
)
from lighting.probe.sky_fit import SkyFit, fit_sky
from lighting.probe.sun_detection import Mask, SunBlob, find_sun_blob
from lighting.records import Lighting
from lighting.solar_position import sun_position

_MAX_STOPS = 40.0  # of a filter; one for the sun has 17


@dataclass(frozen=True)
class BracketSettings:
    """How the pictures were taken, and what map to make; None is the usual, as `make_lens` has it.

    Raises ProbeError for numbers that no picture is taken by.
    """

    kind: LensKind = "equidistant"
    """The lens's projection."""
    fov: float | None = None
    """Deg across the circle that the lens fills. None: 180."""
    center: tuple[float, float] | None = None
    """Column and row of the circle's or ball's middle, pixels. None: the picture's."""
    radius: float | None = None
    """Of the circle or ball, pixels. None: half the shorter side."""
    camera_elevation: float | None = None
    """Deg, -90 to 90, of the direction in which the camera looks. None: up by a fisheye, else level."""
    mirrored: bool = False
    """Whether left and right are swapped."""
    nd: float = 0.0
    """Stops of a filter before the lens."""
    yaw: float | None = None
    """Deg clockwise from north of the camera's azimuth 0; None finds it by the sun."""
    height: int = 512
    """Rows of the map."""
    curve: Curve | None = None
    """How values are coded: "linear" or "srgb". None: linear for 16 bits, else sRGB."""
    fill: bool = False
    """A clipped sun is taken from the model."""

    def __post_init__(self) -> None:
        _check_finite("The lens", self.fov, *(self.center or ()), self.radius, self.camera_elevation, self.nd, self.yaw)
        check_lens(self.kind, self.fov, self.radius)
        if not 0.0 <= self.nd <= _MAX_STOPS:
            sentence = f"The filter has {self.nd:g} stops; it must have 0 to {_MAX_STOPS:g}."
            raise ProbeError(sentence, "nd", ErrorCode.OUT_OF_RANGE)
        if self.camera_elevation is not None and not -90.0 <= self.camera_elevation <= 90.0:
            sentence = f"The camera looks {self.camera_elevation:g} deg up; that must lie in -90 to 90."
            raise ProbeError(sentence, "camera_elevation", ErrorCode.OUT_OF_RANGE)


@dataclass(frozen=True)
class Moment:
    """When and where a bracket was taken."""

    time: datetime
    """Time, aware."""
    latitude: float
    """Deg, positive north."""
    longitude: float
    """Deg, positive east."""

    def __post_init__(self) -> None:
        _check_finite("The place", self.latitude, self.longitude)

    @property
    def sun(self) -> tuple[float, float]:
        """Azimuth in (-180, 180] and elevation [deg] by the ephemeris."""
        azimuth, elevation = sun_position(self.time, self.latitude, self.longitude)
        return float(wrap_azimuth(azimuth)), float(elevation)


def _check_day(moment: Moment) -> None:
    """Raise ProbeError where the sun is below the horizon."""
    if moment.sun[1] < 0:
        time = moment.time.isoformat(timespec="minutes")
        sentence = f"At {time} the sun is {-moment.sun[1]:.0f} deg below the horizon: it is night."
        raise ProbeError(sentence, code=ErrorCode.NIGHT)


def _check_finite(what: str, *numbers: float | None) -> None:
    if not all(number is None or math.isfinite(number) for number in numbers):
        raise ProbeError(f"{what} is told by a number that is not finite.", code=ErrorCode.WRONG_TYPE)


# A clipped sun, filled in.


def _fill_sun(image: NDArray[np.float32], clipped: Mask, spot: SunBlob) -> tuple[NDArray[np.float32], SunBlob, SkyFit]:
    """The map (H, 2H, 3) with the model's disc in place of the clipped sun, the sun it gives, and the sky fitted.

    Turbidity and exposure are fitted to the clear sky that is seen; the clipped pixels become what is beside them.
    Raises ProbeError where too little clear sky is seen.
    """
    fit = fit_sky(image, spot.direction)
    if fit is None:
        raise ProbeError("The sun cannot be filled in: too little clear sky is seen to fit the model to.")
    elevation = max(spot.elevation, 0.0)
    lighting = Lighting(spot.azimuth, elevation, turbidity=fit.turbidity, exposure=fit.exposure)
    filled = _replace_clipped(image, clipped, spot)
    upper = len(image) // 2
    with_disc, without_disc = (render(lighting, len(image), sun=shines)[:upper] for shines in (True, False))
    filled[:upper] += with_disc - without_disc
    return filled, replace(spot, irradiance=sun_light(lighting)[0]), fit


def _replace_clipped(image: NDArray[np.float32], clipped: Mask, spot: SunBlob) -> NDArray[np.float32]:
    """A copy whose clipped pixels around the sun have the median color of the ring beside them."""
    distance = angle_between(latlong_directions(len(image)), spot.direction)
    reach = max(spot.radius, 1.5 * 180.0 / len(image)) + 1.0
    region = (distance < reach) & (clipped | (distance < 0.6 * reach))
    ring = (distance >= reach) & (distance < 2 * reach) & ~clipped
    filled = image.copy()
    if ring.any():
        filled[region] = np.median(image[ring], axis=0)
    return filled


# From bracket to probe.

_SEARCH_HEIGHT = 256  # rows of the map in which the sun is sought before the camera's turn is known
_MAX_SUN_ERROR = 1.0  # deg between the sun found and the ephemeris from which on a warning says so
_MAX_TILT = 7.0  # deg, of a series' camera from which on a warning says so: a clock an hour off looks like 10 at 47 deg
_MAX_CLIPPED_SKY = 0.001  # share of the sky that may be clipped beside the sun before a warning says so


@dataclass(frozen=True, eq=False)
class _MergedBracket:
    """A bracket merged, before it is turned to the world."""

    merged: MergedHdr
    lens: Lens
    spot: SunBlob | None  # in the camera's frame, by the lens as told
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Probe:
    """A measured sky in the world's axes: center column true north, right half east."""

    image: NDArray[np.float32]
    """(H, 2H, 3), linear Rec.709, in units of full scale / relative exposure."""
    clipped: Mask
    """(H, 2H), brighter than could be measured."""
    moment: Moment
    """When and where it was taken."""
    spot: SunBlob | None
    """The sun in the photos. None: not seen."""
    fit: SkyFit | None
    """Of the model that gives the sun's light. None: it was measured."""
    alignment: Alignment | None
    """None where the caller told the yaw."""
    warnings: tuple[str, ...]
    """Sentences for people."""

    @property
    def sun_error(self) -> float | None:
        """Angle [deg] between the sun in the map and the ephemeris; None without a sun in the map."""
        return None if self.spot is None else float(angle_between(self.spot.direction, direction(*self.moment.sun)))


def make_probe(bracket: Bracket, moment: Moment, settings: BracketSettings) -> Probe:
    """Make one probe, aligned by its sun or by the yaw in the settings.

    Args:
        bracket: its exposures.
        moment: when and where they were taken, by day.
        settings: lens, filter and map.

    Raises:
        ProbeError: it is night, no sun is found, or the exposures cannot be merged.
    """
    _check_day(moment)
    hdr = _merge_bracket(bracket, settings)
    if settings.yaw is not None:
        return _finish_probe(hdr, yaw_rotation(settings.yaw), None, moment, settings)
    if hdr.spot is None:
        sentence = "No sun is found in the sky, so the probe cannot be aligned; tell the camera's yaw."
        raise ProbeError(sentence, "yaw", ErrorCode.MISSING)
    observed = (hdr.spot.azimuth, hdr.spot.elevation)
    alignment = align_by_sun(hdr.lens, observed, moment.sun)
    return _finish_probe(hdr, alignment.rotation, alignment, moment, settings)


def make_series(
    brackets: Sequence[Callable[[], Bracket]], moments: Sequence[Moment], settings: BracketSettings
) -> Iterator[Probe]:
    """Make the probes of one camera that did not move, one after the other, all aligned by all their suns.

    Args:
        brackets: functions that read the brackets; each is called twice.
        moments: when and where each was taken, by day.
        settings: lens, filter and maps.

    Raises:
        ProbeError: it is night at one of them, or too few suns are found.
    """
    for moment in moments:
        _check_day(moment)
    alignment = _series_alignment(brackets, moments, settings)
    adjusted = replace(settings, fov=alignment.lens.fov, mirrored=alignment.lens.mirrored)
    for read, moment in zip(brackets, moments, strict=True):
        hdr = _merge_bracket(read(), adjusted)
        yield _finish_probe(hdr, alignment.rotation, alignment, moment, adjusted)


def _series_alignment(
    brackets: Sequence[Callable[[], Bracket]], moments: Sequence[Moment], settings: BracketSettings
) -> Alignment:
    """How the camera of a series stood, by the suns that its probes show; ProbeError where they are too few."""
    pixels, suns, lens = [], [], None
    for read, moment in zip(brackets, moments, strict=True):
        hdr = _merge_bracket(read(), settings)
        lens = hdr.lens
        if hdr.spot is not None:
            pixels.append(project_to_lens(lens, hdr.spot.direction))
            suns.append(direction(*moment.sun))
    if lens is None or not pixels:
        raise ProbeError("No sun is found in any probe of the series, so it cannot be aligned.")
    return align_series(lens, np.array(pixels), np.array(suns))


def _merge_bracket(bracket: Bracket, settings: BracketSettings) -> _MergedBracket:
    """The bracket merged, and its sun in the camera's frame."""
    lengths = measure_ratios(bracket)
    relative = lengths.relative / 2.0**settings.nd
    merged = merge_exposures(bracket, relative)
    height, width = merged.clipped.shape
    circle = {"fov": settings.fov, "center": settings.center, "radius": settings.radius}
    lens = make_lens(
        settings.kind, width, height, **circle, elevation=settings.camera_elevation, mirrored=settings.mirrored
    )
    merged = dequantize(merged, bracket, relative, SMOOTHING_REACH * pixels_per_degree(lens))
    spot = find_sun_blob(*resample_to_latlong(merged.radiance, merged.clipped, lens, np.eye(3), _SEARCH_HEIGHT))
    return _MergedBracket(merged, lens, spot, (*bracket.warnings, *lengths.warnings))


def _finish_probe(
    hdr: _MergedBracket, rotation: Floats, alignment: Alignment | None, moment: Moment, settings: BracketSettings
) -> Probe:
    """The probe of a merged bracket by the rotation (3, 3) from its camera to the world."""
    merged = hdr.merged
    image, clipped = resample_to_latlong(merged.radiance, merged.clipped, hdr.lens, rotation, settings.height)
    spot = hdr.spot
    if spot is not None:
        azimuth, elevation = map(float, angles(rotation @ spot.direction))
        spot = replace(spot, azimuth=azimuth, elevation=elevation)
    probe = Probe(image, clipped, moment, spot, None, alignment, hdr.warnings)
    if settings.fill and spot is not None and spot.clipped:
        filled, sun, fit = _fill_sun(image, clipped, spot)
        probe = replace(probe, image=filled, spot=sun, fit=fit)
    return replace(probe, warnings=(*probe.warnings, *_probe_warnings(probe)))


def _probe_warnings(probe: Probe) -> Iterator[str]:
    """What a user must know of a probe, in sentences."""
    if probe.spot is None:
        yield "No sun is seen in this probe."
    elif probe.fit is not None:
        yield "The sun is clipped in every exposure: the sky around it tells its light."
    elif probe.spot.clipped:
        yield "The sun is clipped in every exposure: it is brighter than the map says."
    if (brightest := float(probe.image.max())) > MAX_RADIANCE:
        yield f"The brightest value is {brightest:.3g}: programs that read half floats lose what exceeds 65504."
    if (share := _clipped_sky_share(probe)) > _MAX_CLIPPED_SKY:
        yield f"Beside the sun {100 * share:.1f} % of the sky is clipped in every exposure."
    if probe.sun_error is not None and probe.sun_error > _MAX_SUN_ERROR:
        yield f"The sun is {probe.sun_error:.1f} deg off the ephemeris: check the lens and the camera's tilt."
    if probe.alignment is not None and probe.alignment.tilt > _MAX_TILT:
        tilt = probe.alignment.tilt
        yield f"The camera stood {tilt:.0f} deg from how it is told: check times and UTC offset."


def _clipped_sky_share(probe: Probe) -> float:
    """Share of the upper half's pixels that are clipped and not the sun's."""
    upper = probe.clipped[: len(probe.clipped) // 2]
    if probe.spot is None:
        return float(upper.mean())
    directions = latlong_directions(len(probe.clipped))[: len(upper)]
    return float((upper & (angle_between(directions, probe.spot.direction) > probe.spot.radius + 2)).mean())


# Writing.


def probe_output_path(output: str | Path, time: datetime) -> Path:
    """Return where a probe is written.

    Args:
        output: a file that ends in .exr, or a folder to fill in the SkyDB's layout.
        time: aware, of the probe.
    """
    path = Path(output)
    return path if path.suffix.lower() == ".exr" and not path.is_dir() else probe_path(path, time)


def write_probe(probe: Probe, output: str | Path) -> Path:
    """Write a probe as OpenEXR and return its path.

    Args:
        probe: with what its header is to say.
        output: a file that ends in .exr, or a folder to fill in the SkyDB's layout.

    Raises:
        EnvironmentMapError: the map cannot be written.
        ProbeError: the folder cannot be made.
    """
    path = probe_output_path(output, probe.moment.time)
    if path != Path(output):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            sentence = f"{path.parent} cannot be made: {error.strerror or error}."
            raise ProbeError(sentence, code=ErrorCode.UNWRITABLE) from error
    write_exr(path, probe.image, compression="none", attributes=_probe_attributes(probe))  # others round values
    return path


def _probe_attributes(probe: Probe) -> dict[str, object]:
    """The header's entries: time, the ephemeris's sun, and what the sun's light rests on."""
    utc = probe.moment.time.astimezone(UTC)
    azimuth, elevation = probe.moment.sun
    attributes: dict[str, object] = {
        TIME_ATTRIBUTE: utc.isoformat(timespec="seconds"),
        "capDate": utc.strftime("%Y:%m:%d %H:%M:%S"),
        "utcOffset": 0.0,
        "lighting.sun_azimuth": azimuth,
        "lighting.sun_elevation": elevation,
        "lighting.sun_found": int(probe.spot is not None),
        "lighting.sun_clipped": int(probe.spot is not None and probe.spot.clipped),
        "lighting.sun_estimated": int(probe.fit is not None),
        "comments": " ".join(probe.warnings),
    }
    if probe.spot is not None:
        attributes["lighting.sun_irradiance"] = np.asarray(probe.spot.irradiance, dtype=np.float32)
    if probe.fit is not None:
        attributes |= {"lighting.turbidity": probe.fit.turbidity, "lighting.exposure": probe.fit.exposure}
    return attributes
