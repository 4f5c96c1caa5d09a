"""The preview's headline, warnings and numbers."""

from textwrap import wrap

from PIL import Image

from lighting.drawing import MUTED, SUN, TEXT, Style, text_width, write
from lighting.preview.layout import GAP, MARGIN, WARNING, WIDTH
from lighting.records import SUITABLE, Lighting
from lighting.words import aside, azimuth_in_words, tilt_in_words

ANYWHERE = 90.0  # deg: where a tenth of the probability lies farther off than this, the sun may as well be opposite
DOUBTED = 0.25  # probability of direct sunlight from which on its absence is not certain
_LETTERS = 160  # of a line of warnings


def draw_headline(canvas: Image.Image, lighting: Lighting) -> None:
    """Write where the sun stands and how sure that is, by which network and evidence, and the warnings."""
    visible, hedge = lighting.sun_shines, _hedge(lighting)
    where = f"{azimuth_in_words(lighting.sun_azimuth)}, {lighting.sun_elevation:.0f}° high"
    none = "No direct sun" if lighting.sun_visibility < DOUBTED else "Probably no direct sun"
    title = f"Sun {hedge}{where}" if visible else none
    doubtful = lighting.suitable is not None and lighting.suitable < SUITABLE
    title = f"Perhaps no outdoor daylight photo; if it is: {title[0].lower()}{title[1:]}" if doubtful else title
    sources = _sources(lighting)
    size = _fitting(title, 28 if doubtful else 38, WIDTH - 2 * MARGIN - GAP - text_width(sources, 18))
    write(canvas, (MARGIN, MARGIN - 6), title, Style(size, TEXT if doubtful or not visible else SUN))
    if visible:
        half, most = _short(lighting.radius_50), _short(lighting.radius_90)
        spread = f"half of the probability lies within {half}°, 90 % within {most}°"
    else:
        spread = f"an overcast or shaded scene; if the sun shone, it would {hedge}stand {where}"
    write(canvas, (MARGIN, MARGIN + 40), spread, Style(20, MUTED))
    model = f"{lighting.model_name} {lighting.model_version}"
    write(canvas, (WIDTH - MARGIN, MARGIN + 40), model, Style(18, MUTED, anchor="ra"))
    write(canvas, (WIDTH - MARGIN, MARGIN + 8), sources, Style(18, MUTED, anchor="ra"))
    for number, line in enumerate(warning_lines(lighting)):
        write(canvas, (MARGIN, MARGIN + 70 + number * WARNING), line, Style(18, TEXT))


def _fitting(text: str, size: int, width: float) -> int:
    """The size of a text's letters, smaller where the text would be wider than that."""
    return min(size, int(size * width / text_width(text, size)))


def _hedge(lighting: Lighting) -> str:
    """What makes the sun's direction sound no surer than it is."""
    return "perhaps " if lighting.radius_90 > ANYWHERE else ""


def warning_lines(lighting: Lighting) -> list[str]:
    """The record's warnings, in lines as wide as the picture."""
    return [line for warning in lighting.warnings for line in wrap(f"Warning: {warning}", _LETTERS)]


def _sources(lighting: Lighting) -> str:
    """The evidence if it is more than the pixels, and the camera's heading if it is known."""
    sources = [f"from {', '.join(lighting.evidence)}"] if len(lighting.evidence) > 1 else []
    heading = [] if lighting.camera_heading is None else [f"camera heading {round(lighting.camera_heading) % 360}°"]
    return "; ".join(sources + heading)


def _short(value: float) -> str:
    """One decimal below 10."""
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _short_azimuth(azimuth: float) -> str:
    """An azimuth [deg] for a column of numbers: "ahead", "behind" or "41° left"."""
    return {0: "ahead", 180: "behind"}.get(round(abs(azimuth)), aside(azimuth))


def numbers_of(lighting: Lighting) -> list[tuple[str, str]]:
    """Names and values of the record, in words."""
    return [
        ("Sun azimuth", _short_azimuth(lighting.sun_azimuth)),
        ("Sun elevation", f"{lighting.sun_elevation:.1f}°"),
        ("50 % / 90 % within", f"{_short(lighting.radius_50)}° / {_short(lighting.radius_90)}°"),
        ("Direct sun", f"{100 * lighting.sun_visibility:.0f} %"),
        ("Turbidity", f"{lighting.turbidity:.1f}"),
        ("Exposure", f"{lighting.exposure:.3g}"),
        ("Camera elevation", tilt_in_words(lighting.camera_elevation, 1)),
        ("Camera roll", f"{round(lighting.camera_roll, 1) + 0.0:.1f}°"),
        ("Vertical field of view", f"{lighting.vertical_fov:.1f}°"),
    ]
