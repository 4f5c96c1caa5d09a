"""Photos: the pixels, EXIF data and time in a file, and the network's input tensor."""


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    from lighting.errors import replacement

    return replacement(__name__, name)
