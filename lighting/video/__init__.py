"""A clip's light: the camera's path from followed points, one sun for each shot; and streams, frame by frame.

It needs the extra `video` (PyAV and OpenCV), which is imported when it is used.
"""

from lighting.deprecation import replacement


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    return replacement(__name__, name)
