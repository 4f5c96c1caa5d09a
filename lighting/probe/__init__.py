"""Measured skies: bracketed exposures become a map of radiance in the world's axes, and a map tells its sky."""

from lighting.deprecation import replacement


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    return replacement(__name__, name)
