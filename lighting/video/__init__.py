"""A clip's light: the camera's path, and one sun for each shot. Streams, too, frame by frame.

It needs the extra `all` (PyAV and OpenCV), which is imported when it is used.
"""


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    from lighting.errors import replacement

    return replacement(__name__, name)
