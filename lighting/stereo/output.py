"""Normals of a thing from photos of one day: a folder in, pictures, a mesh and a record out.

Normals are stored as (n + 1) / 2 of 16 bits in PNG: red x, green y, blue z. In EXR they are as they are. Outside the
mask all is 0. Uncertainty is in degrees in EXR and in hundredths of a degree in the 16-bit PNG.

Depth: between two neighboring pixels it changes by the mean of their slopes. Each such pair is one equation, weighted
by how much both face the camera, since slopes at grazing normals are large and uncertain. The sparse system is solved
directly (scipy). With a focal length the slopes are those of the logarithm of depth (Durou et al., Normal
Integration: A Survey, JMIV 2018), without one the camera is orthographic.
"""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError, PhotoError, require_extra
from lighting.fields import Json, check_location
from lighting.files import atomic_write, write_file
from lighting.files.deflate import encode_png
from lighting.files.exr import SOFTWARE
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats
from lighting.photo.camera import FULL_FRAME_DIAGONAL
from lighting.photo.linear import Curve
from lighting.records import GROUND_ALBEDO
from lighting.stereo.capture import MAX_SIZE, DayPhotos, read_day_photos, read_nearest_skies
from lighting.stereo.light_vectors import SKY_HEIGHT, Skies, clear_skies, gray_skies, sun_directions
from lighting.stereo.normal_network import Network
from lighting.stereo.normal_search import Pose, SearchProgress, camera_to_world, ignore_progress
from lighting.stereo.solver import (
    MIN_NOISE,
    NormalMap,
    Session,
    find_other_heading,
    fit_turbidity,
    raise_error,
    solve_normals,
)
from lighting.tracing import trace_step

Image = NDArray[np.float32]

MESH_FILE, RECORD_FILE = "mesh.ply", "normals.json"

_HUNDREDTHS = 100.0  # of a degree, in the PNG of the uncertainty
_MIN_SUN_MOTION = np.radians(2.0)  # apart, for light to differ


def _encode_pictures(normals: NormalMap, pose: Pose) -> list[tuple[str, Image, Floats]]:
    """Name, values (H, W, C) as they are, and as numbers of 16 bits."""
    in_mask = normals.mask[..., None]
    world = (camera_to_world(normals.normal, pose) * in_mask).astype(np.float32)
    error, white = normals.error[..., None], 65535.0
    return [
        ("normals_camera", normals.normal, (normals.normal + 1) / 2 * white),
        ("normals_world", world, (world + 1) / 2 * white),
        ("albedo", normals.albedo, normals.albedo * white),
        ("uncertainty", error, error * _HUNDREDTHS),
    ]


def _write_picture(target: Path, values: Image) -> None:
    """Write a picture (H, W, C), C 1 or 3, as 32-bit float EXR."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "software": SOFTWARE}
    plane = np.ascontiguousarray(values, dtype=np.float32)
    channels = {"RGB": plane} if plane.shape[-1] == 3 else {"Y": plane[..., 0]}
    with atomic_write(target) as path:
        OpenEXR.File(header, channels).write(str(path))


def _write_mesh(target: Path, vertices: Floats, normals: NormalMap) -> None:
    """Write points (H, W, 3) of a mask as a binary PLY mesh with normals and the albedo as colors.

    Two triangles join each four neighbors that are all in the mask, seen counter-clockwise by the camera.
    """
    mask = normals.mask
    index = np.cumsum(mask).reshape(mask.shape) - 1
    whole = mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:] & mask[1:, 1:]
    a, b, c, d = (part[whole] for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    rows = np.empty(int(mask.sum()), dtype=[("point", "<f4", 3), ("normal", "<f4", 3), ("colour", "u1", 3)])
    rows["point"], rows["normal"] = vertices[mask], normals.normal[mask]
    rows["colour"] = np.clip(np.round(normals.albedo[mask] * 255), 0, 255)
    names = [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    names += [f"property uchar {name}" for name in ("red", "green", "blue")]
    lines = ["ply", "format binary_little_endian 1.0", f"comment {SOFTWARE}", f"element vertex {len(rows)}", *names]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    header = "\n".join(lines).encode("ascii")
    write_file(target, header + rows.tobytes() + faces.tobytes())


# Depth from normals.

_MIN_SLOPE_Z = 0.05  # the least n_z that slopes are taken from
_ANCHOR_WEIGHT = 1e-9  # weight that holds each piece of the surface near 0


def integrate_normals(normal: Image, mask: NDArray[np.bool_], focal: float | None = None) -> Floats:
    """Integrate normals to the surface whose slopes agree best with them, by weighted least squares.

    Pieces of the mask that do not touch each have the mean 0, or the mean logarithm 0.

    Args:
        normal: (H, W, 3) unit vectors in the camera frame.
        mask: (H, W).
        focal: pixels, focal length; None is an orthographic camera.

    Returns:
        Heights (H, W) towards the camera in pixels, or with `focal` distances from it; NaN outside the mask.

    Raises:
        MissingExtraError: scipy is not installed.

    References:
        [1] Durou et al., Normal Integration: A Survey, JMIV 2018.
    """
    slopes = _slopes(normal, focal)
    value = np.full(mask.shape, np.nan)
    value[mask] = _solve_depth(slopes, mask, np.maximum(normal[..., 2], _MIN_SLOPE_Z))
    return value if focal is None else np.exp(value)


def _slopes(normal: Image, focal: float | None) -> tuple[Floats, Floats]:
    """Changes (H, W) of the height, or of the logarithm of the distance, to the next pixel right and down."""
    x, y, z = np.moveaxis(normal.astype(np.float64), -1, 0)
    if focal is None:
        z = np.maximum(z, _MIN_SLOPE_Z)
        return -x / z, y / z
    height, width = z.shape
    right = np.arange(width) - (width - 1) / 2
    up = (height - 1) / 2 - np.arange(height)
    depth_slope = np.maximum(focal * z - right[None, :] * x - up[:, None] * y, _MIN_SLOPE_Z * focal)
    return x / depth_slope, -y / depth_slope


def _solve_depth(slopes: tuple[Floats, Floats], mask: NDArray[np.bool_], facing: Floats) -> Floats:
    """Values (P,) of the mask's pixels that fit the slopes best."""
    sparse = require_extra("scipy.sparse", "Depth needs scipy", "all")
    from scipy.sparse.linalg import splu

    index = np.cumsum(mask).reshape(mask.shape) - 1
    count, pairs = int(mask.sum()), []  # of neighbors: numbers of the pixel and the next one, change and its weight
    for slope, here, beyond in ((slopes[0], np.s_[:, :-1], np.s_[:, 1:]), (slopes[1], np.s_[:-1], np.s_[1:])):
        both = mask[here] & mask[beyond]
        steepness = (slope[here] + slope[beyond])[both] / 2
        certainty = np.minimum(facing[here], facing[beyond])[both] ** 2
        pairs.append((index[here][both], index[beyond][both], steepness, certainty))
    first, second, change, weight = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    rows = np.arange(len(first))
    entries = np.concatenate([-np.ones(len(first)), np.ones(len(first))])
    positions = (np.concatenate([rows, rows]), np.concatenate([first, second]))
    steps = sparse.coo_matrix((entries, positions), shape=(len(first), count)).tocsr()
    weighted = steps.multiply(weight[:, None]).tocsr()
    square = (weighted.T @ steps + _ANCHOR_WEIGHT * sparse.identity(count)).tocsc()
    factors = splu(square, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    value = factors.solve(weighted.T @ change)
    return np.asarray(value - value.mean())


def depth_error(estimated: Floats, truth: Floats, mask: NDArray[np.bool_]) -> float:
    """Return the mean absolute difference of two heights, after the offset that makes it least.

    Args:
        estimated: (H, W).
        truth: (H, W), in the same unit.
        mask: (H, W).
    """
    difference = (estimated - truth)[mask]
    return float(np.mean(np.abs(difference - np.median(difference))))


# From a folder of photos to its normals.

_MAX_MISFIT = 0.002  # of the brightest pixel, that neighbors share beyond noise; exact skies leave half of it
_MAX_HEADING_RATIO = 0.85  # of the unexplained, below which another heading is the better one
_TURBIDITY_SKY_HEIGHT = 32  # rows of the skies that a turbidity is found with


@dataclass(frozen=True)
class NormalsOptions:
    """What is told beside the photos; None is to be found in them."""

    latitude: float | None = None
    """Deg, positive north."""
    longitude: float | None = None
    """Deg, positive east."""
    heading: float | None = None
    """Deg clockwise from true north, where the camera looks."""
    camera_elevation: float = 0.0
    """Deg, positive looks up."""
    camera_roll: float = 0.0
    """Deg, positive turns the camera clockwise as its holder sees it."""
    utc_offset: float | None = None
    """Hours, of the camera's clock and of the probes' names."""
    turbidity: float | None = None
    """Of a modeled sky; None is found from the photos."""
    ground_albedo: float = GROUND_ALBEDO
    """Share of light, 0 to 1, that the ground reflects."""
    probes: Path | None = None
    """Folder of measured skies in place of a modeled one."""
    mask: Path | None = None
    """A picture, white where the thing is. None: all counts."""
    curve: Curve | None = None
    """How the photos' values are coded, where the files are not to be believed."""
    size: int | None = MAX_SIZE
    """Pixels of the longer side; None keeps all."""
    noise: float = MIN_NOISE
    """Least standard deviation of the photos' noise, as a share of the brightest pixel."""


@dataclass(frozen=True)
class NormalsProgress:
    """Who sees the work progress; by default nobody."""

    photos: Callable[[Sequence[Path]], Iterable[Path]] = iter
    """Puts the photos behind a progress bar."""
    pixels: SearchProgress = ignore_progress
    """Is told how far the search has come."""


@dataclass(frozen=True)
class NormalsResult:
    """A day's normals and what they were found from."""

    map: NormalMap
    """The normals."""
    pose: Pose
    """How the camera stood."""
    focal: float | None
    """Pixels; None without a lens known."""
    record: Json
    """As JSON, for people and programs."""
    warnings: tuple[str, ...] = ()
    """Sentences for people."""


def estimate_normals(
    folder: str | os.PathLike[str],
    options: NormalsOptions,
    network: Network | None = None,
    progress: NormalsProgress | None = None,
) -> NormalsResult:
    """Estimate the normals of the thing that a folder's photos show.

    Args:
        folder: of photos of one day.
        options: what is known beside the photos.
        network: improves what the search finds; None searches alone.
        progress: watches the work; None is nobody.

    Raises:
        PhotoError: the photos cannot be used.
        ParameterError: location or heading are not known.
    """
    progress = progress or NormalsProgress()
    with trace_step("decode"):
        photos = read_day_photos(
            Path(folder),
            mask=options.mask,
            user_input=UserInput(utc_offset=options.utc_offset, latitude=options.latitude, longitude=options.longitude),
            curve=options.curve,
            size=options.size,
            progress=progress.photos,
        )
    heading = photos.heading if options.heading is None else options.heading
    if heading is None:
        sentence = "The photos do not say which way the camera looked; give --heading in degrees from north."
        raise ParameterError(sentence, "heading", ErrorCode.MISSING)
    pose = Pose(heading, options.camera_elevation, options.camera_roll)
    with trace_step("map"):
        skies, turbidity = _skies(photos, options, pose)
    _check_sun_moves(skies)
    session = Session(photos.images, photos.mask, skies, pose)
    with trace_step("network"):
        normals, doubts = _doubt_model(session, solve_normals(session, options.noise, network, progress.pixels))
    diagonal = float(np.hypot(*photos.mask.shape))  # pixels
    focal = None if photos.focal_length is None else photos.focal_length / FULL_FRAME_DIAGONAL * diagonal
    record: Json = {
        "photos": list(photos.names),
        "pixels": int(normals.mask.sum()),
        "expected_error_median": round(float(np.median(normals.error[normals.mask])), 2),
        "noise": round(normals.noise, 4),
        "misfit": round(normals.median_misfit, 4),
        "by_network": round(float(normals.network[normals.mask].mean()), 3),
        "frame": "x right, y up, z towards the camera; world: x east, y up, z south",
        "times_utc": [str(time) for time in photos.times],
        "sun_direction": skies.sun_direction.tolist(),
        "heading": pose.heading,
        "camera_elevation": pose.elevation,
        "camera_roll": pose.roll,
        "sky": str(options.probes or "clear"),
        "turbidity": turbidity,
    }
    return NormalsResult(normals, pose, focal, record, (*photos.warnings, *doubts))


def _doubt_model(session: Session, normals: NormalMap) -> tuple[NormalMap, tuple[str, ...]]:
    """Warn where the photos contradict the light that they were told, and expect more error of another heading."""
    misfit = normals.median_misfit
    if misfit < _MAX_MISFIT:
        return normals, ()
    warnings = [
        f"The modeled light misses the photos by {100 * misfit:.1f} %: check heading, times, place and exposure."
    ]
    heading, ratio, angle = find_other_heading(session)
    if ratio < _MAX_HEADING_RATIO:
        warnings.append(
            f"A heading of {heading:.0f}° explains the photos better than {session.pose.heading % 360:.0f}°: "
            f"normals differ by {angle:.0f}°."
        )
        normals = raise_error(normals, angle)
    return normals, tuple(warnings)


def write_normals(folder: str | os.PathLike[str], result: NormalsResult) -> None:
    """Write the pictures, the mesh and the record of a day.

    Args:
        folder: made where its parent is.
        result: of `estimate_normals`.
    """
    folder = Path(folder)
    with trace_step("encode"):
        vertices = _surface_points(result)
        folder.mkdir(exist_ok=True)
        for name, plane, codes in _encode_pictures(result.map, result.pose):
            numbers = np.where(result.map.mask[..., None], np.clip(np.round(codes), 0, 65535), 0)
            write_file(folder / f"{name}.png", encode_png(numbers.astype(np.uint16)))
            _write_picture(folder / f"{name}.exr", plane)
        _write_mesh(folder / MESH_FILE, vertices, result.map)
        write_file(folder / RECORD_FILE, (json.dumps(result.record, indent=2) + "\n").encode())


def _surface_points(result: NormalsResult) -> Floats:
    """Points (H, W, 3) of the thing in the camera frame, in pixels; NaN outside the mask.

    Without a lens known the camera is orthographic; with one the thing stands a focal length away.
    """
    height, width = result.map.mask.shape
    right = np.arange(width)[None, :] - (width - 1) / 2
    up = (height - 1) / 2 - np.arange(height)[:, None]
    depth = integrate_normals(result.map.normal, result.map.mask, result.focal)
    if result.focal is None:
        return np.stack(np.broadcast_arrays(right, up, depth), axis=-1)
    return np.stack([right * depth, up * depth, -result.focal * depth], axis=-1)


def _skies(photos: DayPhotos, options: NormalsOptions, pose: Pose) -> tuple[Skies, float | None]:
    """Skies of the photos' moments, in as many channels as the photos have, and their turbidity if modeled."""
    if options.probes is not None:
        skies = read_nearest_skies(options.probes, photos.times, options.utc_offset or 0.0)
        return skies if photos.images.shape[-1] == 3 else gray_skies(skies), None
    suns = _sun_directions(photos, options)

    def session(turbidity: float, height: int = _TURBIDITY_SKY_HEIGHT) -> Session:
        skies = clear_skies(suns, turbidity, options.ground_albedo, height)
        return Session(photos.images, photos.mask, skies if photos.images.shape[-1] == 3 else gray_skies(skies), pose)

    turbidity = fit_turbidity(session) if options.turbidity is None else options.turbidity
    return session(turbidity, SKY_HEIGHT).skies, turbidity


def _sun_directions(photos: DayPhotos, options: NormalsOptions) -> Floats:
    """Unit vectors (T, 3) to the sun; ParameterError without a place, PhotoError for a photo of night."""
    location = (options.latitude, options.longitude)
    check_location(*location)
    latitude, longitude = location if None not in location else (photos.location or location)
    if latitude is None or longitude is None:
        sentence = "The photos do not say where they were taken; give --lat and --lon."
        raise ParameterError(sentence, "latitude", ErrorCode.MISSING)
    suns = sun_directions(photos.times, latitude, longitude)
    if (suns[:, 1] <= 0).any():
        night = photos.names[int(np.argmin(suns[:, 1]))]
        raise PhotoError(f"The sun is below the horizon in {night}; check its time and place, or leave it out.")
    return suns


def _check_sun_moves(skies: Skies) -> None:
    """Check that the light of the moments differs.

    Args:
        skies: of all photos.

    Raises:
        PhotoError: the sun does not move.
    """
    suns = skies.sun_direction
    if np.arccos(np.clip(suns @ suns.T, -1, 1)).max() < _MIN_SUN_MOTION:
        raise PhotoError("The sun is in the same place in all photos; take them over hours.")
