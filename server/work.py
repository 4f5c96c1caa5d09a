"""What a request asks of the CPU, in steps between which a request whose client has gone stops."""

from io import BytesIO

from anyio.from_thread import check_cancelled
from PIL import Image

from lighting.envmap import render
from lighting.formats import encode_envmap
from lighting.parameters import Lighting, Prediction
from lighting.preview import draw_preview
from server.schemas import MapQuery
from server.service import Service

PREVIEW_MAP_HEIGHT = 512  # rows of the map that lights the preview's spheres


def estimated(service: Service, data: bytes) -> tuple[Prediction, Lighting]:
    """The light of a photo's bytes; raises PhotoError."""
    photo = service.read(data)
    check_cancelled()
    return service.estimate(photo)


def envmap_file(lighting: Lighting, query: MapQuery) -> bytes:
    """The environment map of a light as a file."""
    image = render(lighting, query.height, sun=query.sun)
    check_cancelled()
    return encode_envmap(image, lighting, query.format)


def envmap_file_of_photo(service: Service, data: bytes, query: MapQuery) -> bytes:
    """The same from a photo's bytes."""
    _, lighting = estimated(service, data)
    check_cancelled()
    return envmap_file(lighting, query)


def preview_file(service: Service, data: bytes) -> bytes:
    """The preview of a photo's bytes, as PNG."""
    photo = service.read(data)
    check_cancelled()
    prediction, lighting = service.estimate(photo)
    light = render(lighting, PREVIEW_MAP_HEIGHT)
    check_cancelled()
    drawing = draw_preview(photo.pixels, lighting, prediction.sun_probability, prediction.spec.sun_grid, light)
    stream = BytesIO()
    Image.fromarray(drawing).save(stream, "PNG")
    return stream.getvalue()
