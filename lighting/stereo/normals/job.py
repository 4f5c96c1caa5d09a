"""Normals of a thing from photos of one day: a folder in, pictures and a mesh out."""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lighting.errors import ErrorCode, ParameterError, PhotoError
from lighting.geometry import Floats
from lighting.photo import FULL_FRAME, Curve
from lighting.ranges import check_place
from lighting.records import GROUND_ALBEDO
from lighting.stereo.days import in_grey
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.day import SIZE, Shots, read_shots
from lighting.stereo.normals.depth import integrate
from lighting.stereo.normals.files import MESH, RECORD, write_map, write_mesh, write_record
from lighting.stereo.normals.frame import Pose
from lighting.stereo.normals.haze import fitted_turbidity
from lighting.stereo.normals.network import Network
from lighting.stereo.normals.probes import nearest_skies
from lighting.stereo.normals.search import Progress, quiet
from lighting.stereo.normals.solve import NOISE, NormalMap, Session, check_light, solve
from lighting.stereo.skies import HEIGHT, clear_skies, suns_at

_FITTED_HEIGHT = 32  # rows of the skies that a turbidity is found with


@dataclass(frozen=True)
class Told:
    """What is told beside the photos; None is to be found in them."""

    latitude: float | None = None  # deg, positive north
    longitude: float | None = None  # deg, positive east
    heading: float | None = None  # deg clockwise from true north, where the camera looks
    pitch: float = 0.0  # deg, positive looks up
    roll: float = 0.0  # deg, positive turns the camera clockwise as its holder sees it
    utc_offset: float | None = None  # h, of the camera's clock and of the probes' names
    turbidity: float | None = None  # of a modelled sky; None is found from the photos
    ground_albedo: float = GROUND_ALBEDO
    probes: Path | None = None  # folder of measured skies in place of a modelled one
    mask: Path | None = None
    curve: Curve | None = None  # how the photos' values are coded, where the files are not to be believed
    size: int | None = SIZE  # pixels of the longer side; None keeps all
    noise: float = NOISE  # least standard deviation of the photos' noise, as a share of the brightest pixel


@dataclass(frozen=True)
class Watch:
    """Who sees the work progress; by default nobody."""

    photos: Callable[[Sequence[Path]], Iterable[Path]] = iter
    pixels: Progress = quiet


@dataclass(frozen=True)
class Solved:
    """A day's normals and what they were found from."""

    map: NormalMap
    pose: Pose
    focal: float | None  # pixels; None without a lens known
    record: dict[str, Any]  # as JSON, for people and programs
    warnings: tuple[str, ...] = ()


def solve_day(
    folder: str | os.PathLike[str], told: Told, network: Network | None = None, watch: Watch | None = None
) -> Solved:
    """The normals of the thing that a folder's photos show.

    Raises PhotoError for photos that cannot be used and ParameterError where place or heading are not known.
    """
    folder, seen = Path(folder), watch or Watch()
    shots = read_shots(
        folder,
        mask=told.mask,
        utc_offset=told.utc_offset,
        curve=told.curve,
        size=told.size,
        progress=seen.photos,
    )
    pose = Pose(_heading(shots, told), told.pitch, told.roll)
    skies, turbidity = _skies(shots, told, pose)
    check_light(skies)
    found = solve(Session(shots.images, shots.mask, skies, pose), told.noise, network, seen.pixels)
    focal = None if shots.focal_length is None else _focal(shots.focal_length, *shots.mask.shape)
    record = _record(found, shots.names) | {"times_utc": [str(time) for time in shots.times]}
    record |= {"sun_direction": skies.sun_direction.tolist(), **asdict(pose)}
    record |= {"sky": str(told.probes or "clear"), "turbidity": turbidity}
    return Solved(found, pose, focal, record, shots.warnings)


def write_solved(folder: str | os.PathLike[str], solved: Solved) -> None:
    """Write the pictures, the mesh and the record of a solved day into a folder, which is made where its parent is."""
    folder, vertices = Path(folder), surface(solved)
    folder.mkdir(exist_ok=True)
    write_map(folder, solved.map, solved.pose)
    write_mesh(folder / MESH, vertices, solved.map)
    write_record(folder / RECORD, solved.record)


def surface(solved: Solved) -> Floats:
    """Points (H, W, 3) of the thing in the camera frame, in pixels; NaN outside the mask.

    Without a lens known the camera is orthographic; with one the thing stands a focal length away.
    """
    height, width = solved.map.mask.shape
    right = np.arange(width)[None, :] - (width - 1) / 2
    up = (height - 1) / 2 - np.arange(height)[:, None]
    depth = integrate(solved.map.normal, solved.map.mask, solved.focal)
    if solved.focal is None:
        return np.stack(np.broadcast_arrays(right, up, depth), axis=-1)
    return np.stack([right * depth, up * depth, -solved.focal * depth], axis=-1)


def _heading(shots: Shots, told: Told) -> float:
    heading = shots.heading if told.heading is None else told.heading
    if heading is None:
        raise ParameterError(
            "The photos do not say which way the camera looked; give --heading in degrees from north.",
            "heading",
            ErrorCode.MISSING,
        )
    return heading


def _skies(shots: Shots, told: Told, pose: Pose) -> tuple[Skies, float | None]:
    """Skies of the photos' moments, in as many channels as the photos have, and their turbidity if modelled."""
    if told.probes is not None:
        skies = nearest_skies(told.probes, shots.times, told.utc_offset or 0.0)
        return skies if shots.images.shape[-1] == 3 else in_grey(skies), None
    suns = _suns(shots, told)

    def session(turbidity: float, height: int = _FITTED_HEIGHT) -> Session:
        skies = clear_skies(suns, turbidity, told.ground_albedo, height)
        return Session(shots.images, shots.mask, skies if shots.images.shape[-1] == 3 else in_grey(skies), pose)

    turbidity = fitted_turbidity(session) if told.turbidity is None else told.turbidity
    return session(turbidity, HEIGHT).skies, turbidity


def _suns(shots: Shots, told: Told) -> Floats:
    """Unit vectors (T, 3) to the sun; ParameterError without a place, PhotoError for a photo of night."""
    place = (told.latitude, told.longitude)
    check_place(*place)
    latitude, longitude = place if None not in place else (shots.place or place)
    if latitude is None or longitude is None:
        raise ParameterError(
            "The photos do not say where they were taken; give --lat and --lon.", "latitude", ErrorCode.MISSING
        )
    suns = suns_at(shots.times, latitude, longitude)
    if (suns[:, 1] <= 0).any():
        night = shots.names[int(np.argmin(suns[:, 1]))]
        raise PhotoError(f"The sun is below the horizon in {night}; check its time and place, or leave it out.")
    return suns


def _focal(length: float, height: int, width: int) -> float:
    """Focal length [pixels] of one in 35 mm terms [mm], by the diagonal."""
    return length / FULL_FRAME * float(np.hypot(height, width))


def _record(found: NormalMap, names: Sequence[str]) -> dict[str, Any]:
    error = found.error[found.mask]
    return {
        "photos": list(names),
        "pixels": int(found.mask.sum()),
        "expected_error_median": round(float(np.median(error)), 2),
        "noise": round(found.noise, 4),
        "by_network": round(float(found.network[found.mask].mean()), 3),
        "frame": "x right, y up, z towards the camera; world: x east, y up, z south",
    }
