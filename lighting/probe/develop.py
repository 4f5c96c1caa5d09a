"""From the exposures of a bracket, a time and a place to a sky in the world's axes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ProbeError
from lighting.geometry import Floats, angle_between, angles, direction, latlong_directions
from lighting.probe.align import Alignment, align_one, align_series, yaw_rotation
from lighting.probe.exposures import Bracket
from lighting.probe.fill import fill_sun
from lighting.probe.lens import Lens, lens_of, lens_pixels, pixels_per_degree
from lighting.probe.mapping import to_latlong
from lighting.probe.merge import Merged, merge
from lighting.probe.ratios import Exposed, exposed
from lighting.probe.regions import Mask
from lighting.probe.rounding import REACH, unrounded
from lighting.probe.settings import Moment, Settings, check_day
from lighting.probe.sky_fit import SkyFit
from lighting.probe.sun_spot import SunSpot, find_spot

SEARCH_HEIGHT = 256  # rows of the map in which the sun is sought before the camera's turn is known
OFF = 1.0  # deg between the sun found and the ephemeris from which on a warning says so
TILTED = 7.0  # deg, of a series' camera from which on a warning says so: a clock an hour off looks like 10 at 47 deg
_MOST_CLIPPED = 0.001  # share of the sky that may be clipped beside the sun before a warning says so


@dataclass(frozen=True, eq=False)
class Developed:
    """A bracket merged, before it is turned to the world."""

    merged: Merged
    lens: Lens
    exposed: Exposed
    spot: SunSpot | None  # in the camera's frame, by the lens as told
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Probe:
    """A measured sky in the world's axes: centre column true north, right half east."""

    image: NDArray[np.float32]  # (H, 2H, 3), linear Rec.709, in units of full scale / relative exposure
    clipped: Mask  # (H, 2H), brighter than could be measured
    moment: Moment
    spot: SunSpot | None
    estimated: bool  # the sun's light is the model's
    fit: SkyFit | None  # the model, where it was asked for
    alignment: Alignment | None  # None where the caller told the yaw
    exposed: Exposed
    warnings: tuple[str, ...]

    @property
    def off(self) -> float | None:
        """Angle [deg] between the sun in the map and the ephemeris; None where none is seen."""
        return None if self.spot is None else float(angle_between(self.spot.direction, direction(*self.moment.sun)))


def make_probe(bracket: Bracket, moment: Moment, settings: Settings) -> Probe:
    """One probe, aligned by the yaw of its sun. Raises ProbeError by night, without a sun, and for bad exposures."""
    check_day(moment)
    developed = develop(bracket, settings)
    if settings.yaw is not None:
        return _finish(developed, yaw_rotation(settings.yaw), None, moment, settings)
    if developed.spot is None:
        raise ProbeError(
            "No sun is found in the sky, so the probe cannot be aligned; tell the camera's yaw.",
            "yaw",
            ErrorCode.MISSING,
        )
    found = (developed.spot.azimuth, developed.spot.elevation)
    alignment = align_one(developed.lens, found, moment.sun)
    return _finish(developed, alignment.rotation, alignment, moment, settings)


def make_series(
    brackets: Sequence[Callable[[], Bracket]], moments: Sequence[Moment], settings: Settings
) -> Iterator[Probe]:
    """The probes of one camera that stood still, one after the other, all aligned by all their suns.

    `brackets` are read when they are needed, twice each. Raises ProbeError by night and where too few suns are found.
    """
    for moment in moments:
        check_day(moment)
    alignment = _series_alignment(brackets, moments, settings)
    told = replace(settings, fov=alignment.lens.fov, mirrored=alignment.lens.mirrored)
    for read, moment in zip(brackets, moments, strict=True):
        developed = develop(read(), told)
        yield _finish(developed, alignment.rotation, alignment, moment, told)


def _series_alignment(
    brackets: Sequence[Callable[[], Bracket]], moments: Sequence[Moment], settings: Settings
) -> Alignment:
    """How the camera of a series stood, by the suns that its probes show; ProbeError where they are too few."""
    pixels, truth, lens = [], [], None
    for read, moment in zip(brackets, moments, strict=True):
        developed = develop(read(), settings)
        lens = developed.lens
        if developed.spot is not None:
            pixels.append(lens_pixels(lens, developed.spot.direction))
            truth.append(direction(*moment.sun))
    if lens is None or not pixels:
        raise ProbeError("No sun is found in any probe of the series, so it cannot be aligned.")
    return align_series(lens, np.array(pixels), np.array(truth))


def develop(bracket: Bracket, settings: Settings) -> Developed:
    """The bracket merged, and its sun in the camera's frame."""
    lengths = exposed(bracket)
    relative = lengths.relative / 2.0**settings.nd
    merged = merge(bracket, relative)
    height, width = merged.clipped.shape
    lens = lens_of(
        settings.kind,
        width,
        height,
        fov=settings.fov,
        centre=settings.centre,
        radius=settings.radius,
        pitch=settings.pitch,
        mirrored=settings.mirrored,
    )
    merged = unrounded(merged, bracket, relative, REACH * pixels_per_degree(lens))
    spot = find_spot(*to_latlong(merged.radiance, merged.clipped, lens, np.eye(3), SEARCH_HEIGHT))
    return Developed(merged, lens, lengths, spot, (*bracket.warnings, *lengths.warnings))


def _finish(
    developed: Developed, rotation: Floats, alignment: Alignment | None, moment: Moment, settings: Settings
) -> Probe:
    """The probe of a merged bracket by the rotation (3, 3) from its camera to the world."""
    merged = developed.merged
    image, clipped = to_latlong(merged.radiance, merged.clipped, developed.lens, rotation, settings.height)
    spot = None if developed.spot is None else _turned(developed.spot, rotation)
    probe = Probe(image, clipped, moment, spot, False, None, alignment, developed.exposed, developed.warnings)
    if settings.fill and spot is not None and spot.clipped:
        filled, sun, fit = fill_sun(image, clipped, spot)
        probe = replace(probe, image=filled, spot=sun, estimated=True, fit=fit)
    return replace(probe, warnings=(*probe.warnings, *_said(probe)))


def _turned(spot: SunSpot, rotation: Floats) -> SunSpot:
    """The sun of a camera's frame in the world's, by the rotation (3, 3) between them."""
    azimuth, elevation = angles(rotation @ spot.direction)
    return replace(spot, azimuth=float(azimuth), elevation=float(elevation))


def _said(probe: Probe) -> Iterator[str]:
    """What a user must know of a probe, in sentences."""
    if probe.spot is None:
        yield "No sun is seen in this probe."
    elif probe.estimated:
        yield "The sun is clipped in every exposure; its light is estimated by the model of the sky around it."
    elif probe.spot.clipped:
        yield "The sun is clipped in every exposure: it is brighter than the map says by an unknown factor."
    share = _clipped_sky(probe)
    if share > _MOST_CLIPPED:
        yield f"Beside the sun {100 * share:.1f} % of the sky is clipped in every exposure."
    if probe.off is not None and probe.off > OFF:
        yield (
            f"The sun in the map is {probe.off:.1f} deg off the ephemeris: the lens's field of view, its centre or the "
            f"camera's tilt is not as told; several probes of a day find them with --series."
        )
    if probe.alignment is not None and probe.alignment.tilt > TILTED:
        yield (
            f"The camera stood {probe.alignment.tilt:.0f} deg from how it is told, or the times are wrong: a clock or "
            f"an offset from UTC that is an hour off looks like a tilt."
        )


def _clipped_sky(probe: Probe) -> float:
    """Share of the upper half's pixels that are clipped and not the sun's."""
    upper = probe.clipped[: len(probe.clipped) // 2]
    if probe.spot is None:
        return float(upper.mean())
    towards = latlong_directions(len(probe.clipped))[: len(upper)]
    return float((upper & (angle_between(towards, probe.spot.direction) > probe.spot.radius + 2)).mean())
