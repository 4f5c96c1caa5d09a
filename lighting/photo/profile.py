"""What a file's ICC profile and gamma tag say of values that are to be linear: their primaries, and whether by a curve.

Pillow converts by profiles in 8 bits alone, so linear values are converted by the profile's matrix.
"""

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms

_GAMMA_TAG = (0.9, 1.1)  # of a PNG whose values are linear
_LINEAR = ("linear", "g10")  # in the names of profiles without a curve
_SAME = 2e-3  # of a matrix's entries, by which profiles of the same primaries differ


def profile_to_rec709(profile: bytes | None) -> NDArray[np.float32] | None:
    """The matrix (3, 3) from an ICC profile's primaries to Rec.709's; None where they are the same or not told."""
    try:
        said = ImageCms.ImageCmsProfile(BytesIO(profile or b"")).profile
        wanted = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).profile
        matrix = np.linalg.solve(_to_xyz(wanted), _to_xyz(said))
    except Exception:  # a bad profile, or one of tables, must not reject a photo
        return None
    unfit = not np.isfinite(matrix).all() or np.allclose(matrix, np.eye(3), rtol=0.0, atol=_SAME)
    return None if unfit else np.asarray(matrix, dtype=np.float32)


def _to_xyz(profile: Any) -> NDArray[np.float64]:
    """The matrix (3, 3) from linear red, green and blue to XYZ under D50, to which profiles adapt their white."""
    return np.array([profile.red_colorant[0], profile.green_colorant[0], profile.blue_colorant[0]]).T


def says_gamma(header: Image.Image) -> bool:
    """Whether an opened picture says that its values are coded by a curve."""
    gamma = header.info.get("gamma")
    if "srgb" in header.info or (gamma is not None and not _GAMMA_TAG[0] <= float(gamma) <= _GAMMA_TAG[1]):
        return True
    try:
        profile = ImageCms.ImageCmsProfile(BytesIO(header.info["icc_profile"]))
        return not is_linear(ImageCms.getProfileDescription(profile))
    except (KeyError, OSError, TypeError, ImageCms.PyCMSError):
        return False


def is_linear(name: str) -> bool:
    """Whether an ICC profile's name says that its values are linear."""
    return any(word in name.lower() for word in _LINEAR)
