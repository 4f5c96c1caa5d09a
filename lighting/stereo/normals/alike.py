"""Photos of a day must not differ but in their light."""

from lighting.errors import PhotoError
from lighting.stereo.normals.images import Exposure, Shot

_ALIKE = 0.02  # relative difference of exposures that cameras round alike


def check_alike(shots: list[Shot]) -> None:
    """PhotoError unless size, colours, lens and exposure are those of the first photo throughout."""
    first = shots[0]
    for shot in shots[1:]:
        if shot.shape != first.shape:
            raise PhotoError(f"{shot.name} and {first.name} differ in size; the camera must not move or change.")
        if shot.pixels.shape != first.pixels.shape:
            raise PhotoError(f"Of {shot.name} and {first.name} one is grey and one in colour; make them alike.")
        if _differ(shot.exposure.focal_length, first.exposure.focal_length):
            raise PhotoError(f"{shot.name} and {first.name} differ in focal length; the lens must not change.")
        if _exposures_differ(shot.exposure, first.exposure):
            raise PhotoError(f"{shot.name} and {first.name} differ in exposure; fix time, aperture and ISO.")


def _exposures_differ(a: Exposure, b: Exposure) -> bool:
    pairs = ((a.seconds, b.seconds), (a.aperture, b.aperture), (a.sensitivity, b.sensitivity))
    return any(_differ(one, other) for one, other in pairs)


def _differ(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and abs(a - b) > _ALIKE * max(a, b)
