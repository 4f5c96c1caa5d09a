"""What an answer says of its sun, in a line and on buttons; nothing here needs Blender."""

import json

from .lighting.formatting import format_azimuth, format_sun_elevation
from .lighting.records import Lighting, Trust

_HELP = {  # as long as the sidebar is wide
    Trust.SURE: "The sun is sure",
    Trust.UNSURE: "Unsure: draw a shadow or pick a sun",
    Trust.NO_SUN: "No sun is seen: set one by eye",
}


def trust_line(answer: str) -> str:
    """How far an answer's sun can be trusted, and what helps.

    Args:
        answer: the record (JSON).
    """
    return _HELP[Lighting.from_dict(json.loads(answer)).trust]


def sun_labels(answer: str) -> list[str]:
    """The suns to pick from, such as "120° left, 25° high (31 %)"; empty where there is no choice.

    Args:
        answer: the record (JSON).
    """
    suns = Lighting.from_dict(json.loads(answer)).sun_candidates
    if len(suns) < 2:
        return []
    return [
        f"{format_azimuth(sun.azimuth)}, {format_sun_elevation(sun.elevation)} ({100 * sun.probability:.0f} %)"
        for sun in suns
    ]
