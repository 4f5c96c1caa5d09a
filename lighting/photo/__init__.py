"""Photos: the pixels, EXIF data and time in a file, and the network's input tensor."""

from lighting.deprecation import replacement


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    return replacement(__name__, name)
