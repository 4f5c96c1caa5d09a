"""The map that a caller asks for: of which sky, with the place or without, turned or not."""

from dataclasses import replace

from lighting.envmap.maps import Image
from lighting.envmap.render import render
from lighting.envmap.surroundings import Place, surround
from lighting.envmap.turning import rotate, turn
from lighting.records import Lighting


def view(
    lighting: Lighting,
    height: int = 512,
    *,
    sun: bool | None = None,
    yaw: float = 0.0,
    sky: str | None = None,
    place: Place | None = None,
) -> tuple[Image, Lighting]:
    """The rendered map turned by `yaw` [deg], and the lighting turned with it; other parameters as in `render`.

    `sky` is another model of SKY_MODELS than the record's. With a `place`, the map shows it as `surround` does.
    """
    lighting = lighting if sky is None else replace(lighting, sky_model=sky)
    image = render(lighting, height, sun=sun) if place is None else surround(lighting, place, height, sun=sun)
    return (rotate(image, yaw), turn(lighting, yaw)) if yaw else (image, lighting)
