"""The errors that this package raises; each text is one sentence for people.

Exit codes of the command line and HTTP problems map from these classes alone.
"""


class LightingError(Exception):
    """Base of every error this package raises on purpose; its text is one clear sentence."""


class PhotoError(LightingError):
    """The bytes given are not a photo that can be read."""


class PhotoTooLargeError(PhotoError):
    """The photo exceeds the limit on bytes or pixels."""


class ParameterError(LightingError, ValueError):
    """A lighting parameter is missing, of the wrong type or outside its range.

    `field` names the one at fault as the record that refuses it does, or None where no single one is.
    """

    def __init__(self, text: str, field: str | None = None) -> None:
        super().__init__(text)
        self.field = field


class ModelError(LightingError):
    """The network's file is missing, damaged or of an unknown layout."""


class EnvironmentMapError(LightingError):
    """A file is not an environment map that can be read, or cannot be written."""


class ProbeError(LightingError):
    """Exposures do not make a sky, or a sky does not tell what was asked of it."""


class SceneError(LightingError):
    """A scene's tool is unknown, or its folder cannot be written."""


class BatchError(LightingError):
    """A batch of photos cannot start or continue; finished results stay."""


class MissingExtraError(LightingError):
    """An optional package, which one of this package's extras installs, is missing."""


class PhotoExtraError(PhotoError, MissingExtraError):
    """Photos of this kind need an optional package that is missing."""


class TurnsError(LightingError):
    """How photos are turned against each other cannot be found within the time or memory allowed."""


class VideoError(LightingError):
    """A file is not a clip that can be read, or nothing in it can be followed."""


def reason(error: Exception) -> str:
    """An error as one sentence, without the name of the file that an OSError carries."""
    return f"{error.strerror or error}." if isinstance(error, OSError) else str(error)
