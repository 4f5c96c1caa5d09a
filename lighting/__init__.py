"""Light from one outdoor photo: sun, sky, camera, and an HDR environment map."""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes
from lighting.version import __version__

if TYPE_CHECKING:
    from lighting.envmap import render
    from lighting.evidence import Given
    from lighting.files import read_exr, write_exr
    from lighting.pipeline import Estimator, estimate
    from lighting.records import Estimate, Lighting

__all__ = ["Estimate", "Estimator", "Given", "Lighting", "__version__", "estimate", "read_exr", "render", "write_exr"]

_HOME = {
    "Estimate": "records",
    "Estimator": "pipeline",
    "estimate": "pipeline",
    "Given": "evidence",
    "render": "envmap",
    "Lighting": "records",
    "read_exr": "files",
    "write_exr": "files",
}


__getattr__ = from_homes(__name__, _HOME)  # so that `lighting --help` stays quick


def __dir__() -> list[str]:
    """With the public names, for completion."""
    return sorted({*globals(), *__all__})
