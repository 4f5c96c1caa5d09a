"""Photos: the pixels in a file, and what it says of camera, time and place."""


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    from lighting.errors import replacement

    return replacement(__name__, name)
