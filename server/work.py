"""What a request asks of the CPU, in steps between which a request whose client has gone stops."""

from collections.abc import Sequence
from io import BytesIO

from anyio.from_thread import check_cancelled
from PIL import Image

from lighting.envmap import render
from lighting.errors import PhotoError
from lighting.formats import encode_envmap
from lighting.parameters import Lighting
from lighting.preview import draw_preview
from server.queries import EnvmapQuery, GivenQuery, LightingQuery, MapQuery
from server.service import Estimate, Service

PREVIEW_MAP_HEIGHT = 512  # rows of the map that lights the preview's spheres


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
    ((_, lighting),) = service.estimate([photo], query.given())
    check_cancelled()
    return envmap_file(lighting, query)


def preview_file(service: Service, data: bytes, query: GivenQuery) -> bytes:
    """The preview of a photo's bytes, as PNG."""
    photo = service.read(data)
    check_cancelled()
    ((prediction, lighting),) = service.estimate([photo], query.given())
    light = render(lighting, PREVIEW_MAP_HEIGHT)
    check_cancelled()
    drawing = draw_preview(photo.pixels, lighting, prediction.sun_probability, prediction.spec.sun_grid, light)
    stream = BytesIO()
    Image.fromarray(drawing).save(stream, "PNG")
    return stream.getvalue()
