"""The CPU work of requests, in steps; between two steps a request stops if its client has disconnected."""

from collections.abc import Sequence
from dataclasses import replace
from time import monotonic

import numpy as np
from anyio.from_thread import check_cancelled
from fastapi import Request
from numpy.typing import NDArray

from lighting.envmap.relighting import light_of_map
from lighting.envmap.shadow_mask import ground_shadow_mask
from lighting.errors import PhotoError
from lighting.fields import Json
from lighting.files import encode_jpeg
from lighting.files.deflate import encode_png
from lighting.ground import draw_ground_mask, find_lit_spot
from lighting.light_probe import encode_light_probe
from lighting.photo.reader import TARGET, Photo
from lighting.photo_estimate import Estimate, compute_map_probe, render_map
from lighting.records import Lighting
from lighting.scene.records import Scene, make_scene
from lighting.scene.writer import zip_scene
from lighting.sun_study import SunStudy, plan_study
from lighting.tracing import trace_step
from server import query_params as queries
from server.dependencies import PhotoMatcher, Service
from server.query_params import MapQuery, SceneQuery
from server.request_body import Upload
from server.responses import estimate_to_json

Pixels = NDArray[np.uint8]
FileWithWarnings = tuple[bytes, tuple[str, ...]]  # a file, and sentences about it

MID_GRAY = 128  # sRGB
_MIN_DECODE_SECONDS = 0.1  # for a photo after others that took long
_MAX_NAME_LENGTH = 100  # of a file's name that an error repeats
_UPRIGHT_SIDE = 2048  # pixels, the longer side of a photo for the page
_UPRIGHT_QUALITY = 88  # of its JPEG, 1 to 100


def answer_photo(service: Service, data: bytes, query: queries.LightingQuery, request: Request) -> Json:
    """Estimate the light of one photo and make the answer's JSON.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, and what the answer includes.
        request: which asks for it.
    """
    return estimate_to_json(request, _estimate_photo(service, data, query), query)


def answer_photos(
    service: Service, files: Sequence[Upload], query: queries.LightingsQuery, request: Request
) -> list[Json]:
    """Estimate the light of photos of one place, and make the JSON of each.

    Args:
        service: reads the photos and estimates.
        files: one or more photos.
        query: what the client states, and what the answers include.
        request: which asks for them.

    Raises:
        PhotoError: a photo cannot be read; of several it names the one.
    """
    answers = []
    for estimate in estimate_photos(service, files, query):
        check_cancelled()
        answers.append(estimate_to_json(request, estimate, query))
    return answers


def estimate_photos(service: Service, files: Sequence[Upload], query: queries.LightingsQuery) -> list[Estimate]:
    """Estimate the light of photos, of each by all of them where they are of one place.

    Args:
        service: reads the photos and estimates.
        files: one or more photos.
        query: what the client states.

    Raises:
        PhotoError: a photo cannot be read; of several it names the one.
    """
    matcher = PhotoMatcher(service.settings.match_seconds) if query.needs_matching(len(files)) else None
    photos = _read_photos(service, files, matcher.target if matcher else TARGET)
    if query.together:
        return service.estimate(photos, query.user_input(), query.heading_values(), matcher)
    estimates = []
    for photo in photos:
        estimates += service.estimate([photo], query.user_input())
        check_cancelled()
    return estimates


def _read_photos(service: Service, files: Sequence[Upload], target: int) -> list[Photo]:
    """The photos of a request, which share its time limit for decoding."""
    photos = []
    until = monotonic() + service.settings.decode_seconds
    for number, file in enumerate(files, 1):
        try:
            photos.append(service.read_photo(file.data, max(until - monotonic(), _MIN_DECODE_SECONDS), target))
        except PhotoError as error:
            raise error if len(files) == 1 else type(error)(f"{_photo_label(number, files)}: {error}") from error
        check_cancelled()
    return photos


def _photo_label(number: int, files: Sequence[Upload]) -> str:
    """One of several files, by its number and its name."""
    label = f"Photo {number} of {len(files)}"
    return f"{label}, {name}" if (name := files[number - 1].name[:_MAX_NAME_LENGTH]) else label


def encode_map(service: Service, source: bytes | Lighting, query: MapQuery) -> bytes:
    """Render the environment map of a light, or of a photo's, and encode it as a file.

    Args:
        service: reads a photo and estimates.
        source: the bytes of a photo, or the light, which has sky and ground alone.
        query: how the map is rendered and written; of a photo also what the client states and replaces.
    """
    view = query.view()
    rendered = render_map(source, view) if isinstance(source, Lighting) else _edit(service, source, query).render(view)
    check_cancelled()
    return rendered.encode(query.file_options())


def _estimate_photo(service: Service, data: bytes, query: queries.UserInputQuery) -> Estimate:
    """Read a photo and estimate its light."""
    photo = service.read_photo(data)
    check_cancelled()
    (estimate,) = service.estimate([photo], query.user_input())
    check_cancelled()
    return estimate


def _edit(service: Service, data: bytes, query: queries.Query) -> Estimate:
    """Estimate the light of a photo, with the fields that the client replaces."""
    assert isinstance(query, queries.PhotoEditQuery)
    return _estimate_photo(service, data, query).edit(query.changes(), query.photo_exposure)


def encode_upright_jpeg(service: Service, data: bytes) -> bytes:
    """Convert a photo of any type to an upright JPEG.

    Args:
        service: reads the photo.
        data: the bytes of a photo.
    """
    pixels = service.read_photo(data, target=_UPRIGHT_SIDE).pixels
    with trace_step("encode"):
        return encode_jpeg(pixels, _UPRIGHT_QUALITY)


def encode_probe(service: Service, source: bytes | Lighting, query: queries.ProbeQuery) -> bytes:
    """Compute the light probe of a light, or of a photo's, and encode it as JSON.

    Args:
        service: reads a photo and estimates.
        source: the bytes of a photo, or the light, which has sky and ground alone.
        query: the engine, yaw and sky; of a photo also what the client states and replaces.
    """
    view = query.view()
    if isinstance(source, Lighting):
        probe = compute_map_probe(source, view)
    else:
        probe = _edit(service, source, query).probe(view)
    with trace_step("encode"):
        return encode_light_probe(probe, query.tool).encode()


def encode_preview(service: Service, data: bytes, query: queries.PreviewQuery) -> bytes:
    """Estimate the light of a photo and draw its preview as PNG.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, and what the map shows.
    """
    picture = _estimate_photo(service, data, query).preview(query.view())
    with trace_step("encode"):
        return encode_png(np.asarray(picture))


def encode_ground(service: Service, data: bytes, query: queries.GroundQuery) -> bytes:
    """Estimate the light of a photo and draw what it shows of the ground as PNG.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, and whether the sun shines.
    """
    mask = _draw_ground(service, data, query)
    with trace_step("encode"):
        return encode_png(mask)


def find_lit_spot_in_photo(service: Service, data: bytes, query: queries.LitSpotQuery) -> tuple[float, float] | None:
    """Estimate the light of a photo and find the nearest ground in the sun.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, and the point from which the spot is sought.
    """
    return find_lit_spot(_draw_ground(service, data, query), (query.x, query.y))


def _draw_ground(service: Service, data: bytes, query: queries.GroundQuery) -> Pixels:
    estimate = _estimate_photo(service, data, query)
    with trace_step("map"):
        lit = ground_shadow_mask(estimate.photo.pixels, estimate.lighting, sun=query.sun, segments=estimate.segments)
        return draw_ground_mask(lit, estimate.lighting, estimate.segments)


def plan_day(service: Service, data: bytes, query: queries.DayQuery) -> SunStudy:
    """Estimate the light of a photo, and that of a day at its place.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, the day and its steps.
    """
    user_input = query.user_input()
    (estimate,) = service.estimate([service.read_photo(data)], replace(user_input, keep_location=True))
    check_cancelled()
    keep, heading = user_input.keep_location, user_input.heading
    return plan_study(estimate.lighting, query.day, query.every, heading=heading, keep_location=keep)


def zip_scene_of_photo(service: Service, data: bytes, query: queries.PhotoSceneQuery) -> FileWithWarnings:
    """Estimate the light of a photo and make a scene as a ZIP archive.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: the tool, its options, and what the client states and replaces.
    """
    return _zip_scene(_edit(service, data, query).make_scene(query.view()), query)


def zip_scene_of_sky(query: queries.SkySceneQuery) -> FileWithWarnings:
    """Make a scene as a ZIP archive, with a gray image in the place of a photo.

    Args:
        query: the tool, its options, the sky and the size of the gray image.
    """
    width, height, view = query.plate_width, query.plate_height, query.view()
    plate = Photo(np.full((height, width, 3), MID_GRAY, dtype=np.uint8), width, height, "PNG")
    with trace_step("map"):
        light = light_of_map(query.to_lighting(), view)
        scene = make_scene(plate, light, map_height=view.height, sun=view.sun)
    return _zip_scene(scene, query)


def _zip_scene(scene: Scene, query: SceneQuery) -> FileWithWarnings:
    check_cancelled()
    with trace_step("encode"):
        return zip_scene(scene, query.tool, **query.options()), scene.warnings
