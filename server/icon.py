"""The icon that browsers ask for of their own accord."""

from functools import lru_cache

import numpy as np
from fastapi import APIRouter
from fastapi.responses import Response
from PIL import Image, ImageDraw

from lighting.files import encode_png

SIDE = 32  # pixels
SKY, GROUND, SUN = (74, 144, 217), (107, 122, 82), (255, 209, 71)

router = APIRouter(include_in_schema=False)


@router.get("/favicon.ico")
async def favicon() -> Response:
    """A sun over a horizon, as PNG, which browsers take under this name."""
    return Response(icon(), media_type="image/png", headers={"Cache-Control": "public, max-age=86400"})


@lru_cache(maxsize=1)
def icon() -> bytes:
    """The picture's file."""
    picture = Image.new("RGB", (SIDE, SIDE), SKY)
    draw = ImageDraw.Draw(picture)
    draw.ellipse((15, 4, 27, 16), fill=SUN)
    draw.rectangle((0, 22, SIDE, SIDE), fill=GROUND)
    return encode_png(np.asarray(picture))
