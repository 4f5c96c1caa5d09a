"""The CPU work of requests, in steps; between two steps a request stops if its client has disconnected."""

from collections.abc import Iterator, Sequence
from datetime import date
from typing import Any

import numpy as np
from anyio.from_thread import check_cancelled

from lighting import stereo
from lighting.envmap import render
from lighting.errors import PhotoError
from lighting.files import encode_envmap
from lighting.photo import Photo
from lighting.preview import PHOTO_SIDE, preview_png
from lighting.records import Estimate, Lighting
from lighting.scene import PLATE_SIDE, make_scene, zip_scene
from server.plans import PlanQuery
from server.queries import EnvmapQuery, GivenQuery, LightingQuery, MapQuery, PhotoSceneQuery, SceneQuery, SkySceneQuery
from server.service import Service

MID_GREY = 128  # sRGB


def estimated_together(service: Service, files: Sequence[bytes], query: LightingQuery) -> list[Estimate]:
    """The light of the bytes of photos of one place; raises PhotoError, which names one of several."""
    photos = []
    for number, data in enumerate(files, 1):
        try:
            photos.append(service.read(data))
        except PhotoError as error:
            raise error if len(files) == 1 else type(error)(f"Photo {number} of {len(files)}: {error}") from error
        check_cancelled()
    return service.estimate(photos, query.given(), query.turns())


def envmap_file(lighting: Lighting, query: MapQuery) -> bytes:
    """The environment map of a light as a file."""
    image = render(lighting, query.height, sun=query.sun)
    check_cancelled()
    return encode_envmap(image, lighting, query.format)


def envmap_file_of_photo(service: Service, data: bytes, query: EnvmapQuery) -> bytes:
    """The same from a photo's bytes."""
    photo = service.read(data)
    check_cancelled()
    (estimate,) = service.estimate([photo], query.given())
    check_cancelled()
    return envmap_file(estimate.lighting, query)


def preview_file(service: Service, data: bytes, query: GivenQuery) -> bytes:
    """The preview of a photo's bytes, as PNG."""
    photo = service.read(data)
    check_cancelled()
    (estimate,) = service.estimate([photo], query.given())
    check_cancelled()
    return preview_png(service.read_finer(data, PHOTO_SIDE).pixels, estimate)


def scene_file(plate: Photo, lighting: Lighting, query: SceneQuery) -> bytes:
    """A scene as a ZIP archive."""
    scene = make_scene(plate, lighting, map_height=query.height, sun=query.sun)
    check_cancelled()
    return zip_scene(scene, query.tool, **query.options())


def scene_file_of_photo(service: Service, data: bytes, query: PhotoSceneQuery) -> bytes:
    """The same from a photo's bytes."""
    photo = service.read(data)
    check_cancelled()
    (estimate,) = service.estimate([photo], query.given())
    check_cancelled()
    return scene_file(service.read_finer(data, PLATE_SIDE), estimate.lighting, query)


def scene_file_of_sky(query: SkySceneQuery) -> bytes:
    """The same from parameters alone; a grey plate stands where one's own picture of that size goes."""
    width, height = query.plate_width, query.plate_height
    grey = np.full((height, width, 3), MID_GREY, dtype=np.uint8)
    return scene_file(Photo(grey, width, height, "PNG"), query.lighting(), query)


def plan_record(query: PlanQuery) -> dict[str, Any]:
    """When to photograph for photometric stereo, as JSON."""
    skies = query.skies()
    return stereo.plan_record(skies, stereo.plan_photos(skies, query.question(), _cancellable))


def _cancellable(days: Sequence[date]) -> Iterator[date]:
    for day in days:
        check_cancelled()
        yield day
