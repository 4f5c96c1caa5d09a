"""The CPU work of requests, in steps; between two steps a request stops if its client has disconnected."""

from collections.abc import Sequence
from time import monotonic

import numpy as np
from anyio.from_thread import check_cancelled
from numpy.typing import NDArray

from lighting.envmap.relighting import edit_lighting
from lighting.envmap.surroundings import (
    PhotoContext,
    photo_context,
    photo_context_for_height,
    render_view,
    surroundings_gain,
)
from lighting.errors import PhotoError
from lighting.files import encode_envmap
from lighting.files.atomic import encode_jpeg
from lighting.photo.reader import TARGET, Photo
from lighting.preview.picture import PHOTO_SIDE, preview_png
from lighting.records import Estimate, Lighting
from lighting.scene.records import PLATE_SIDE, make_scene
from lighting.scene.writer import zip_scene
from server.dependencies import Matching, PhotoAnswer, Service
from server.query_params import (
    EnvmapQuery,
    GivenQuery,
    LightingQuery,
    MapQuery,
    PhotoSceneQuery,
    PreviewQuery,
    SceneQuery,
    SkySceneQuery,
)
from server.request_body import Upload

Pixels = NDArray[np.uint8]
Warned = tuple[bytes, tuple[str, ...]]  # a file, and sentences about it

MID_GREY = 128  # sRGB
LEAST_SECONDS = 0.1  # for a photo after others that took long
NAME_LETTERS = 100  # of a file's name that an answer repeats
SHOWN_SIDE = 2048  # pixels, the longer side of a photo for the page
SHOWN_QUALITY = 88  # of its JPEG, 1 to 100


def estimated_together(service: Service, files: Sequence[Upload], query: LightingQuery) -> list[PhotoAnswer]:
    """The light of photos of one place; raises PhotoError, which names one of several.

    Where the query asks for it and the network says what lies around, each comes with `place_factors`.
    """
    matching = Matching(service.settings.match_seconds) if query.matched(len(files)) else None
    photos = _read_together(service, files, matching.target if matching else TARGET)
    found = service.estimate(photos, query.given(), query.turns(), matching)
    if not query.surroundings:
        return [PhotoAnswer(estimate) for estimate in found]
    answers = []
    for photo, estimate in zip(photos, found, strict=True):
        check_cancelled()
        place = photo_context(estimate, photo.pixels)
        answers.append(PhotoAnswer(estimate, surroundings_gain(estimate.lighting, place) if place else None))
    return answers


def _read_together(service: Service, files: Sequence[Upload], target: int) -> list[Photo]:
    """The photos of a request; the time that it has for decoding is that of all of them together."""
    photos = []
    until = monotonic() + service.settings.decode_seconds
    for number, file in enumerate(files, 1):
        try:
            photos.append(service.read(file.data, max(until - monotonic(), LEAST_SECONDS), target))
        except PhotoError as error:
            raise error if len(files) == 1 else type(error)(f"{_which(number, files)}: {error}") from error
        check_cancelled()
    return photos


def _which(number: int, files: Sequence[Upload]) -> str:
    """Which of several files is meant, by its place and its name."""
    place = f"Photo {number} of {len(files)}"
    return f"{place}, {name}" if (name := files[number - 1].name[:NAME_LETTERS]) else place


def envmap_file(lighting: Lighting, query: MapQuery, place: PhotoContext | None = None) -> bytes:
    """The environment map of a light as a file."""
    image, turned = render_view(lighting, query.height, sun=query.sun, yaw=query.yaw, sky=query.sky, context=place)
    check_cancelled()
    return encode_envmap(image, turned, query.format, compression=query.compression)


def envmap_file_of_photo(service: Service, data: bytes, query: EnvmapQuery) -> bytes:
    """The same from a photo's bytes."""
    photo, estimate = _estimated(service, data, query)

    def finer(side: int) -> Pixels:
        return service.read_finer(data, side).pixels

    context = photo_context_for_height(
        estimate, photo.pixels, query.height, finer, surroundings=query.surroundings, exposure=query.photo_exposure
    )
    return envmap_file(edit_lighting(estimate.lighting, query.changes()), query, context)


def _estimated(service: Service, data: bytes, query: GivenQuery) -> tuple[Photo, Estimate]:
    """A photo's bytes as a photo, and its light."""
    photo = service.read(data)
    check_cancelled()
    (estimate,) = service.estimate([photo], query.given())
    check_cancelled()
    return photo, estimate


def upright_file(service: Service, data: bytes) -> bytes:
    """A photo's bytes, of any type that is read, as an upright JPEG."""
    return encode_jpeg(service.read_finer(data, SHOWN_SIDE).pixels, SHOWN_QUALITY)


def preview_file(service: Service, data: bytes, query: PreviewQuery) -> bytes:
    """The preview of a photo's bytes, as PNG."""
    _, estimate = _estimated(service, data, query)
    pixels = service.read_finer(data, PHOTO_SIDE).pixels
    return preview_png(pixels, estimate, surroundings=query.surroundings)


def _scene_file(plate: Photo, lighting: Lighting, query: SceneQuery, place: PhotoContext | None = None) -> Warned:
    """A scene as a ZIP archive, and its warnings; with a `place`, its map shows it."""
    scene = make_scene(plate, lighting, map_height=query.height, sun=query.sun, context=place)
    check_cancelled()
    return zip_scene(scene, query.tool, **query.options()), scene.warnings


def scene_file_of_photo(service: Service, data: bytes, query: PhotoSceneQuery) -> Warned:
    """The same from a photo's bytes."""
    _, estimate = _estimated(service, data, query)
    lighting = edit_lighting(estimate.lighting, query.changes())
    plate = service.read_finer(data, PLATE_SIDE)
    place = photo_context(estimate, plate.pixels, surroundings=query.surroundings, exposure=query.photo_exposure)
    return _scene_file(plate, lighting, query, place)


def scene_file_of_sky(query: SkySceneQuery) -> Warned:
    """The same from parameters alone; a grey plate stands where one's own picture of that size goes."""
    width, height = query.plate_width, query.plate_height
    grey = np.full((height, width, 3), MID_GREY, dtype=np.uint8)
    return _scene_file(Photo(grey, width, height, "PNG"), query.lighting(), query)
