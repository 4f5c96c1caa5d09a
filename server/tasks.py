"""The CPU work of requests, in steps; between two steps a request stops if its client has disconnected."""

from collections.abc import Sequence
from time import monotonic
from typing import Any

import numpy as np
from anyio.from_thread import check_cancelled
from numpy.typing import NDArray

from lighting.envmap import surroundings
from lighting.envmap.relighting import adjust_lighting, edit_lighting
from lighting.envmap.shadow_mask import ground_shadow_mask
from lighting.envmap.surroundings import PhotoContext, photo_context, render_view, surroundings_gain
from lighting.errors import PhotoError
from lighting.files import MAP_FORMATS, encode_envmap, encode_jpeg, encode_png
from lighting.ground import draw_ground_mask, find_lit_spot
from lighting.light_probe import compute_light_probe, encode_light_probe
from lighting.photo.reader import TARGET, Photo
from lighting.photo_estimate import Estimate
from lighting.preview.picture import PHOTO_SIDE, draw_preview_pixels, encode_preview_png
from lighting.records import Lighting
from lighting.scene.records import PLATE_SIDE, make_scene
from lighting.scene.writer import zip_scene
from lighting.segmentation import Segments
from lighting.tracing import trace_step
from server import query_params as queries
from server.dependencies import PhotoAnswer, PhotoMatcher, Service
from server.query_params import MapQuery, SceneQuery
from server.request_body import Upload

Pixels = NDArray[np.uint8]
FileWithWarnings = tuple[bytes, tuple[str, ...]]  # a file, and sentences about it

MID_GRAY = 128  # sRGB
_MIN_DECODE_SECONDS = 0.1  # for a photo after others that took long
_MAX_NAME_LENGTH = 100  # of a file's name that an error repeats
_UPRIGHT_SIDE = 2048  # pixels, the longer side of a photo for the page
_UPRIGHT_QUALITY = 88  # of its JPEG, 1 to 100


def answer_photo(service: Service, data: bytes, query: queries.LightingQuery) -> PhotoAnswer:
    """Estimate the light of one photo.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: with `surroundings`, the answer has its gain if the network predicts surroundings.
    """
    return _answer_photo(*_estimate_photo(service, data, query), query)


def estimate_photos(service: Service, files: Sequence[Upload], query: queries.LightingsQuery) -> list[PhotoAnswer]:
    """Estimate the light of photos of one place.

    Args:
        service: reads the photos and estimates.
        files: one or more photos.
        query: with `surroundings`, each answer has its gain if the network predicts surroundings.

    Raises:
        PhotoError: a photo cannot be read; of several it names the one.
    """
    matcher = PhotoMatcher(service.settings.match_seconds) if query.needs_matching(len(files)) else None
    photos = _read_photos(service, files, matcher.target if matcher else TARGET)
    estimates = _estimate_each(service, photos, query, matcher)
    return [_answer_photo(photo, estimate, query) for photo, estimate in zip(photos, estimates, strict=True)]


def _answer_photo(photo: Photo, estimate: Estimate, query: queries.LightingQuery) -> PhotoAnswer:
    """An estimate with what else the client asks for."""
    check_cancelled()
    metadata = photo.metadata if query.photo_metadata else None
    with trace_step("map"):
        context = photo_context(estimate, photo.pixels)
        probe = compute_light_probe(estimate.lighting, context)
        gain = surroundings_gain(estimate.lighting, context) if context and query.surroundings else None
    return PhotoAnswer(estimate, probe, gain, photo.crop, metadata)


def _estimate_each(
    service: Service, photos: Sequence[Photo], query: queries.LightingsQuery, matcher: PhotoMatcher | None
) -> list[Estimate]:
    """The light of each photo, by all of them where they are of one place."""
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


def encode_envmap_of_lighting(lighting: Lighting, query: MapQuery, context: PhotoContext | None = None) -> bytes:
    """Render an environment map and encode it as a file.

    Args:
        lighting: the light.
        query: height, yaw, format and compression.
        context: the photo's surroundings, which the map then shows; None renders the sky alone.
    """
    view: Any = {"sun": query.sun_in_map, "yaw": query.yaw, "sky": query.sky, "context": context}
    with trace_step("map"):
        image, rotated = render_view(lighting, query.height, **view)
        check_cancelled()
        probe = compute_light_probe(lighting, **view) if MAP_FORMATS[query.format].has_header else None
    file: Any = {"compression": query.compression, "colours": query.colours, "probe": probe, "overwrite": True}
    with trace_step("encode"):
        return encode_envmap(image, rotated, query.format, **file)


def encode_envmap_of_photo(service: Service, data: bytes, query: queries.EnvmapQuery) -> bytes:
    """Estimate the light of a photo and encode its environment map.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, replaces and requests.
    """
    photo, estimate = _estimate_photo(service, data, query)

    def reread(side: int) -> Pixels:
        return service.reread_photo(data, side).pixels

    context = surroundings.photo_context_for_height(
        estimate,
        photo.pixels,
        query.height,
        reread,
        surroundings=query.surroundings,
        exposure=query.photo_exposure,
        detail=query.detail,
    )
    lighting = adjust_lighting(edit_lighting(estimate.lighting, query.changes()), query.adjustments())
    return encode_envmap_of_lighting(lighting, query, context)


def _estimate_photo(service: Service, data: bytes, query: queries.UserInputQuery) -> tuple[Photo, Estimate]:
    """Read a photo and estimate its light."""
    photo = service.read_photo(data)
    check_cancelled()
    (estimate,) = service.estimate([photo], query.user_input())
    check_cancelled()
    return photo, estimate


def encode_upright_jpeg(service: Service, data: bytes) -> bytes:
    """Convert a photo of any type to an upright JPEG.

    Args:
        service: reads the photo.
        data: the bytes of a photo.
    """
    pixels = service.reread_photo(data, _UPRIGHT_SIDE).pixels
    with trace_step("encode"):
        return encode_jpeg(pixels, _UPRIGHT_QUALITY)


def encode_probe_of_lighting(
    lighting: Lighting, query: queries.ProbeQuery, context: PhotoContext | None = None
) -> bytes:
    """Compute a light probe and encode it as JSON.

    Args:
        lighting: the light.
        query: the engine, yaw and sky.
        context: the photo's surroundings, which the probe then holds; None: the sky alone.
    """
    with trace_step("map"):
        probe = compute_light_probe(lighting, context, sun=query.sun_in_map, yaw=query.yaw, sky=query.sky)
    with trace_step("encode"):
        return encode_light_probe(probe, query.format).encode()


def encode_probe_of_photo(service: Service, data: bytes, query: queries.PhotoProbeQuery) -> bytes:
    """Estimate the light of a photo and encode its probe as JSON.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: the engine, and what the client states and replaces.
    """
    photo, estimate = _estimate_photo(service, data, query)
    context = photo_context(
        estimate, photo.pixels, surroundings=query.surroundings, exposure=query.photo_exposure, detail=False
    )
    lighting = adjust_lighting(edit_lighting(estimate.lighting, query.changes()), query.adjustments())
    return encode_probe_of_lighting(lighting, query, context)


def encode_preview(service: Service, data: bytes, query: queries.PreviewQuery) -> bytes:
    """Estimate the light of a photo and draw its preview as PNG.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: what the client states, and whether the map shows the surroundings.
    """
    _, estimate = _estimate_photo(service, data, query)
    pixels = service.reread_photo(data, PHOTO_SIDE).pixels
    lighting = adjust_lighting(estimate.lighting, query.adjustments())
    with trace_step("map"):
        picture = draw_preview_pixels(
            pixels,
            estimate,
            surroundings=query.surroundings,
            detail=query.detail,
            lighting=lighting,
            sun=query.sun_in_map,
        )
    with trace_step("encode"):
        return encode_preview_png(picture)


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
    photo, estimate = _estimate_photo(service, data, query)
    with trace_step("map"):
        lit = ground_shadow_mask(photo.pixels, estimate.lighting, sun=query.sun, segments=estimate.segments)
        return draw_ground_mask(lit, estimate.lighting, estimate.segments)


def _zip_scene_of_plate(
    plate: Photo,
    lighting: Lighting,
    query: SceneQuery,
    context: PhotoContext | None = None,
    segments: Segments | None = None,
) -> FileWithWarnings:
    with trace_step("map"):
        scene = make_scene(
            plate, lighting, map_height=query.height, sun=query.sun_in_map, context=context, segments=segments
        )
    check_cancelled()
    with trace_step("encode"):
        return zip_scene(scene, query.tool, **query.options()), scene.warnings


def zip_scene_of_photo(service: Service, data: bytes, query: queries.PhotoSceneQuery) -> FileWithWarnings:
    """Estimate the light of a photo and make a scene as a ZIP archive.

    Args:
        service: reads the photo and estimates.
        data: the bytes of a photo.
        query: the tool, its options, and what the client states and replaces.
    """
    _, estimate = _estimate_photo(service, data, query)
    lighting = adjust_lighting(edit_lighting(estimate.lighting, query.changes()), query.adjustments())
    plate = service.reread_photo(data, PLATE_SIDE)
    context = photo_context(
        estimate,
        plate.pixels,
        surroundings=query.surroundings,
        exposure=query.photo_exposure,
        detail=query.detail,
    )
    return _zip_scene_of_plate(plate, lighting, query, context, estimate.segments)


def zip_scene_of_sky(query: queries.SkySceneQuery) -> FileWithWarnings:
    """Make a scene as a ZIP archive, with a gray image in the place of a photo.

    Args:
        query: the tool, its options, the sky and the size of the gray image.
    """
    width, height = query.plate_width, query.plate_height
    gray = np.full((height, width, 3), MID_GRAY, dtype=np.uint8)
    return _zip_scene_of_plate(Photo(gray, width, height, "PNG"), query.to_lighting(), query)
