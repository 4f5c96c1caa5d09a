"""Light from one outdoor photo: sun, sky, camera, and an HDR environment map."""

from typing import TYPE_CHECKING

from lighting.version import __version__

if TYPE_CHECKING:
    from lighting.estimator import Estimator, estimate
    from lighting.estimator import render_lighting as render
    from lighting.files.exr import read_exr, write_exr
    from lighting.fusion.user_input import UserInput
    from lighting.map_options import MapOptions
    from lighting.photo.reader import read_photo
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting

__all__ = [
    "Estimate",
    "Estimator",
    "Lighting",
    "MapOptions",
    "UserInput",
    "__version__",
    "estimate",
    "read_exr",
    "read_photo",
    "render",
    "write_exr",
]

_HOMES = {  # module, and the name in it where that differs
    "Estimate": "photo_estimate",
    "Estimator": "estimator",
    "Lighting": "records",
    "MapOptions": "map_options",
    "UserInput": "fusion.user_input",
    "estimate": "estimator",
    "read_exr": "files.exr",
    "read_photo": "photo.reader",
    "render": "estimator:render_lighting",
    "write_exr": "files.exr",
}

if not TYPE_CHECKING:  # a type checker knows the names above, and no other

    def __getattr__(name: str) -> object:
        """A public name, imported on its first use so that `lighting --help` stays quick."""
        from importlib import import_module

        if name in _HOMES:
            module, _, own_name = _HOMES[name].partition(":")
            return getattr(import_module(f"lighting.{module}"), own_name or name)
        return import_module("lighting.errors").replacement("lighting", name)


def __dir__() -> list[str]:
    """With the public names, for completion."""
    return sorted({*globals(), *__all__})
