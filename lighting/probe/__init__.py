"""Measured skies: bracketed exposures become a map of radiance, and a map tells its sky."""


def __getattr__(name: str) -> object:
    """What an old public name of this package means now; AttributeError for others."""
    from lighting.errors import replacement

    return replacement(__name__, name)
