"""Coded values of HDR video to the sRGB that a photo of the same scene would have.

The curves are those of Rec. ITU-R BT.2100: hybrid log-gamma (HLG) and the perceptual quantiser (PQ, also SMPTE ST
2084). Diffuse white, which is 1 in a photo, is where Report ITU-R BT.2408 puts it: 75 % of HLG's signal, 203 cd/m2 of
PQ. What is brighter is clipped, as photos clip it. Primaries go from BT.2020 to BT.709 by the matrix of Rec. BT.2087.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.colour import srgb_encode
from lighting.geometry import Floats

CURVES = {16: "pq", 18: "hlg"}  # the numbers of ITU-T H.273 for transfer characteristics; all others count as sRGB
WIDE = 9  # H.273's number of the primaries of BT.2020

_A = 0.17883277  # a, b and c of HLG
_B, _C = 1.0 - 4.0 * _A, 0.5 - _A * math.log(4.0 * _A)
_M1, _M2 = 2610 / 16384, 2523 / 32  # m1 and m2, c1 to c3 of PQ
_C1, _C2, _C3 = 3424 / 4096, 2413 / 128, 2392 / 128
_PEAK, _WHITE = 10000.0, 203.0  # cd/m2, of the largest PQ signal and of diffuse white
_HLG_WHITE = 0.75  # signal of diffuse white
_TO_709 = np.array(  # from BT.2020
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]], dtype=np.float32
)
_FULL = 65280  # 255 x 256, which libswscale makes of the largest signal where it converts to 16 bits
_STEPS = 4096  # of the table of sRGB's curve


def hlg_decode(signal: ArrayLike) -> Floats:
    """Scene light, 1 at diffuse white, of HLG signals in [0, 1] (inverse OETF)."""
    return _hlg(np.asarray(signal, dtype=np.float64)) / float(_hlg(np.array(_HLG_WHITE)))


def _hlg(signal: Floats) -> Floats:
    bright = (np.exp((np.maximum(signal, 0.5) - _C) / _A) + _B) / 12.0
    return np.where(signal <= 0.5, np.square(signal) / 3.0, bright)


def pq_decode(signal: ArrayLike) -> Floats:
    """Display light, 1 at 203 cd/m2, of PQ signals in [0, 1] (EOTF)."""
    root = np.asarray(signal, dtype=np.float64) ** (1.0 / _M2)
    return np.asarray((np.maximum(root - _C1, 0.0) / (_C2 - _C3 * root)) ** (1.0 / _M1) * (_PEAK / _WHITE))


def to_srgb(coded: NDArray[np.uint16], curve: str, primaries: int) -> NDArray[np.uint8]:
    """8-bit sRGB (..., 3) of 16-bit coded values (..., 3), as PyAV has them, under `curve`, "hlg" or "pq"."""
    linear = _table(curve).take(coded)
    if primaries == WIDE:
        linear = linear @ _TO_709.T
    return _encoding().take((np.clip(linear, 0.0, 1.0) * np.float32(_STEPS) + np.float32(0.5)).astype(np.intp))


@lru_cache(maxsize=2)
def _table(curve: str) -> NDArray[np.float32]:
    decode = {"hlg": hlg_decode, "pq": pq_decode}[curve]
    return decode(np.minimum(np.arange(65536) / _FULL, 1.0)).astype(np.float32)


@lru_cache(maxsize=1)
def _encoding() -> NDArray[np.uint8]:
    return np.round(srgb_encode(np.arange(_STEPS + 1) / _STEPS) * 255.0).astype(np.uint8)
