"""The errors that this package raises, an answer's warnings, and those of old names: sentences for people.

Errors have a code and a field for programs, warnings a code. Exit codes of the command line and HTTP problems map from
the errors' classes; nothing reads the sentences. Old names work until a release that is named here; those of Python
warn.
"""

import reprlib
import warnings
from collections.abc import Callable
from enum import StrEnum
from importlib import import_module
from types import ModuleType
from typing import ClassVar, Self


class ErrorCode(StrEnum):
    """What is wrong, for programs: stable, unlike the sentences."""

    MISSING = "missing"
    """A needed value is missing."""
    WRONG_TYPE = "wrong-type"
    """A value is of the wrong type; the exception is a TypeError, too."""
    OUT_OF_RANGE = "out-of-range"
    """A number is outside its range, or not finite."""
    MALFORMED = "malformed"
    """A text does not read as what it should."""
    UNKNOWN = "unknown"
    """A name is unknown."""
    DUPLICATE = "duplicate"
    """A value is given twice."""
    CONTRADICTION = "contradiction"
    """A value does not fit the others."""
    NIGHT = "night"
    """The sun is below the horizon."""
    INSUFFICIENT = "insufficient"
    """There is too little for an answer."""
    UNREADABLE = "unreadable"
    """A file is not what it should be."""
    UNWRITABLE = "unwritable"
    """A file or folder cannot be written."""
    TOO_LARGE = "too-large"
    """A file has more bytes or pixels than the limit."""
    TIMEOUT = "timeout"
    """The work took longer than it may."""
    MISSING_EXTRA = "missing-extra"
    """An optional package is not installed."""
    FAILED = "failed"
    """It failed for another reason, which the sentence tells."""


_GONE_IN = "0.4.0"  # the first release without the old names
RENAMED = {  # where a public name is now, by the old one; an attribute of a class calls `warn_of_old_name` itself
    "lighting.Estimator.together": "lighting.Estimator.estimate_views",
    "lighting.Given": "lighting.UserInput",
    "lighting.MapOptions.detail": "lighting.MapOptions.around",
    "lighting.MapOptions.surroundings": "lighting.MapOptions.around",
    "lighting.Estimate.save.colours": "lighting.Estimate.save.colors",
    "lighting.UserInput.use_exif": "lighting.UserInput.metadata",
    "lighting.photo.photo_of": "lighting.photo.reader.photo_from_array",
    "lighting.photo.read_photo": "lighting.read_photo",
    "lighting.photo.read_time": "lighting.photo.timestamps.parse_time",
    "lighting.photo.reader.Photo.facts": "lighting.photo.reader.Photo.metadata",
    "lighting.probe.probes_in": "lighting.probe.bracket.probes_in",
    "lighting.video.Tracker": "lighting.video.stream.Tracker",
    "lighting.video.stream.Tracker.given": "lighting.video.stream.Tracker.user_input",
    "lighting.write_exr.colours": "lighting.write_exr.colors",
}
# What people type, without dashes, in commands, URLs and forms alike. The old names go in 0.4.0, the short ones stay.
OLD_NAMES = {"colours": "colors", "exif": "metadata", "tool": "for"}
SHORT_FORMS = {"lat": "latitude", "lon": "longitude", "fov": "vertical_fov"}
FOREIGN_NAMES = {  # of parameters in other programs, by ours: for errors, which name the right one
    **dict.fromkeys(("width", "size", "resolution", "res", "rows", "columns", "w", "h"), "height"),
    **dict.fromkeys(("turbidity", "fog", "mist"), "haze"),
    **dict.fromkeys(("out", "outfile", "output_file", "out_file", "output_dir", "out_dir", "outdir", "dest"), "output"),
    **dict.fromkeys(("force", "yes", "clobber", "replace", "f", "y"), "overwrite"),
    **dict.fromkeys(("azimuth", "elevation", "altitude", "sun_direction", "sun_position", "sun_azimuth"), "sun"),
    **dict.fromkeys(("ev", "brightness", "intensity", "gain"), "exposure"),
    **dict.fromkeys(("lng", "long"), "longitude"),
    **dict.fromkeys(("date", "datetime", "timestamp"), "time"),
    **dict.fromkeys(("timezone", "tz"), "utc_offset"),
    **dict.fromkeys(("rotate", "rotation", "rotate_z", "offset"), "yaw"),
    **dict.fromkeys(("compass", "bearing"), "heading"),
    **dict.fromkeys(("focal_length", "focal", "lens", "hfov"), "vertical_fov"),
    **dict.fromkeys(("tool", "engine", "target", "to"), "for"),
    **dict.fromkeys(("threads", "jobs", "j", "num_workers", "processes"), "workers"),
    **dict.fromkeys(("cloudy", "clouds"), "overcast"),
    **dict.fromkeys(("silent", "s"), "quiet"),
    "p": "port",
    **dict.fromkeys(("colors", "colorspace", "color_space"), "colours"),
    **dict.fromkeys(("network", "weights", "checkpoint"), "model"),
}


class LightingError(Exception):
    """Base of every error that this package raises on purpose.

    Args:
        text: one clear sentence.
        field: the parameter at fault, as Python names it; None where no single one is.
        code: what is wrong; by default what the class stands for.
    """

    default_code: ClassVar[ErrorCode] = ErrorCode.FAILED

    def __new__(cls, text: str = "", field: str | None = None, code: ErrorCode | None = None) -> Self:  # noqa: ARG004
        """Make an error, which about a wrong type is a TypeError, too."""
        kind = cls
        if code is ErrorCode.WRONG_TYPE:
            ours = (other for other in cls.__subclasses__() if other.__module__ == __name__)
            kind = next((other for other in ours if issubclass(other, TypeError)), cls)
        return super().__new__(kind, text)

    def __init__(self, text: str, field: str | None = None, code: ErrorCode | None = None) -> None:
        super().__init__(text)
        self.field = field
        self.code = code or self.default_code
        self._predicate: str | None = None

    @classmethod
    def about(cls, field: str, predicate: str, code: ErrorCode) -> Self:
        """Make the error whose sentence is a field's name and a predicate; a surface can spell the name its own way.

        Args:
            field: the parameter at fault, as Python names it.
            predicate: the rest of the sentence.
            code: what is wrong.
        """
        error = cls(f"{field} {predicate}", field, code)
        error._predicate = predicate
        return error

    @classmethod
    def wrong_type(cls, field: str, expected: str, value: object) -> Self:
        """Make the error about a value of another type, as `about` does.

        Args:
            field: the parameter at fault, as Python names it.
            expected: what it must be, such as "a text".
            value: what it is.
        """
        return cls.about(field, f"must be {expected}, not {reprlib.repr(value)}.", ErrorCode.WRONG_TYPE)

    def renamed(self, name_of: Callable[[str], str]) -> Self:
        """Return the same error with the field under the name that a surface has for it, in the sentence too.

        Args:
            name_of: from a field's name in Python to the surface's.
        """
        if self.field is None:
            return self
        name = name_of(self.field)
        if self._predicate is not None:
            return self.about(name, self._predicate, self.code)
        return type(self)(str(self), name, self.code)

    def prefixed(self, subject: str) -> Self:
        """Return the same error with a sentence that begins with what it is about.

        Args:
            subject: such as a file's name.
        """
        return type(self)(f"{subject}: {self}", self.field, self.code)


class PhotoError(LightingError):
    """The bytes given are not a photo that can be read."""

    default_code = ErrorCode.UNREADABLE


class PhotoTooLargeError(PhotoError):
    """The photo exceeds the limit on bytes or pixels."""

    default_code = ErrorCode.TOO_LARGE


class ParameterError(LightingError, ValueError):
    """A lighting parameter is missing, of the wrong type or outside its range."""


class ModelError(LightingError):
    """The network's file is missing, damaged or of an unknown layout."""

    default_code = ErrorCode.UNREADABLE


class EnvironmentMapError(LightingError):
    """A file is not an environment map that can be read, or cannot be written."""

    default_code = ErrorCode.UNREADABLE


class ProbeError(LightingError):
    """Exposures do not make a sky, or a sky does not tell what was asked of it."""

    default_code = ErrorCode.INSUFFICIENT


class SceneError(LightingError):
    """A scene's tool is unknown, or its folder cannot be written."""

    default_code = ErrorCode.UNWRITABLE


class BatchError(LightingError):
    """A batch of photos cannot start or continue; finished results stay."""


class MissingExtraError(LightingError):
    """An optional package is missing; `extra` is the extra of this package that installs it.

    `of` words it, and `require_extra` raises it.
    """

    default_code = ErrorCode.MISSING_EXTRA
    extra = ""

    @classmethod
    def of(cls, need: str, extra: str) -> Self:
        """Make the error of a need.

        Args:
            need: such as "Parquet needs pyarrow".
            extra: the extra of this package that installs it.
        """
        error = cls(f"{need}: {install_command(extra)}.")
        error.extra = extra
        return error


class PhotoExtraError(PhotoError, MissingExtraError):
    """Photos of this kind need an optional package that is missing."""

    default_code = ErrorCode.MISSING_EXTRA


class TurnsError(LightingError):
    """How photos are turned against each other cannot be found within the time or memory allowed."""


class VideoError(LightingError):
    """A file is not a clip that can be read, or nothing in it can be followed."""

    default_code = ErrorCode.UNREADABLE


class _ParameterTypeError(ParameterError, TypeError):
    """A parameter is of the wrong type."""


class _PhotoTypeError(PhotoError, TypeError):
    """What is given is neither a photo nor where one is."""


class _ModelTypeError(ModelError, TypeError):
    """What is given is not where a network is."""


class _EnvironmentMapTypeError(EnvironmentMapError, TypeError):
    """What is given is neither an environment map nor where one is written."""


class _SceneTypeError(SceneError, TypeError):
    """What is given is neither a scene nor where one is written."""


def require_extra(module: str, need: str, extra: str, error: type[MissingExtraError] = MissingExtraError) -> ModuleType:
    """Import a module of an optional package.

    Args:
        module: its full name.
        need: how the error's sentence begins, such as "Parquet needs pyarrow".
        extra: the extra of this package that installs it.
        error: the class to raise where it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as cause:
        raise error.of(need, extra) from cause


def install_command(extra: str) -> str:
    """Return the command that installs an extra of this package.

    Args:
        extra: its name.
    """
    return f"pip install 'outdoor-lighting[{extra}]'"


def describe_error(error: Exception) -> str:
    """Return an error as one sentence, without the name of the file that an OSError carries.

    Args:
        error: any.
    """
    return f"{error.strerror or error}." if isinstance(error, OSError) else str(error)


# Old names.


def replacement(package: str, name: str) -> object:
    """Warn of an old public name of a package, and return what it means now.

    Args:
        package: full name, such as lighting.photo; its `__getattr__` calls this.
        name: the old name in it.

    Raises:
        AttributeError: the name has never been public.
    """
    old = f"{package}.{name}"
    if old not in RENAMED:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    warn_of_old_name(old, stacklevel=4)
    module, _, new = RENAMED[old].rpartition(".")
    return getattr(import_module(module), new)


def warn_of_old_name(old: str, stacklevel: int = 3) -> None:
    """Warn that a name has another in its place, and when the old one goes.

    Args:
        old: a key of RENAMED.
        stacklevel: whose line the warning names; 3 is the caller of the function that calls this.
    """
    sentence = f"{old} is now {RENAMED[old]}; the old name goes in {_GONE_IN}."
    warnings.warn(sentence, DeprecationWarning, stacklevel)


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
