"""Warnings of an answer: sentences for people, each with a stable code for programs."""

from enum import StrEnum
from typing import Self


class WarningCode(StrEnum):
    """What a warning is about, for programs: stable, unlike its sentence."""

    ELEVATION_CONTRADICTED = "elevation-contradicted"
    """The pixels contradict the sun's elevation by time and place."""
    HEADING_CONTRADICTED = "heading-contradicted"
    """The pixels contradict the camera's heading."""
    LENS_CONTRADICTED = "lens-contradicted"
    """The pixels contradict the file's lens."""
    GRAVITY_CONTRADICTED = "gravity-contradicted"
    """The pixels contradict the file's gravity, which is not used."""
    SHADOW_CONTRADICTED = "shadow-contradicted"
    """The pixels contradict a shadow that the user marked."""
    CLOCK_CONTRADICTED = "clock-contradicted"
    """GPS contradicts the camera's clock, or no clock shows such a time."""
    OFFSET_REPLACED = "offset-replaced"
    """The user's offset from UTC replaces the file's."""
    BORDER = "border"
    """The photo has a border, without which it counts."""
    COLLAGE = "collage"
    """The picture is made of several photos."""
    CURVE = "curve"
    """The clip is in a camera's logarithm, or looks as if it were."""
    OVERLAY = "overlay"
    """Lettering stands still in the clip's picture."""
    THERMAL = "thermal"
    """The picture is of a thermal camera."""
    PANORAMA = "panorama"
    """By its file, the picture is a panorama."""
    LENS_OPEN = "lens-open"
    """The file's lens was cropped: the pixels chose it, or it was not used."""
    LOCATION_OPEN = "location-open"
    """The file states no hemisphere: the zone chose it, or the place was not used."""
    TURN_INFERRED = "turn-inferred"
    """The photos have nothing in common that says how they are turned."""
    OTHER = "other"
    """Any other warning."""


class CodedWarning(str):
    """A warning's sentence with its code; everywhere else, in JSON too, it is a text like any other."""

    code: WarningCode

    def __new__(cls, sentence: str, code: WarningCode = WarningCode.OTHER) -> Self:
        """Make one of a sentence and its code."""
        made = super().__new__(cls, sentence)
        made.code = code
        return made


def warning_code(warning: str) -> WarningCode:
    """Return the code of a warning.

    Args:
        warning: a sentence; a plain text, as one in a record that was read, has the code OTHER.
    """
    return warning.code if isinstance(warning, CodedWarning) else WarningCode.OTHER
