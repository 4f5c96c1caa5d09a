"""The scans of a JPEG, counted before it is decoded.

A decoder goes through the whole picture once per scan, however few bytes the scan has: a picture of 4000 x 4000 pixels
whose 343 kB hold one scan 5,000 times takes 36 s. The markers are found as libjpeg finds them (ITU-T T.81, B.1.1).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lighting.errors import PhotoError

MOST_SCANS = 40  # libjpeg writes 10 of a colour picture and 18 of a CMYK one, mozjpeg's search ends at about as many
MOST_SEGMENTS = 4096  # 64 MB need 1,000 of full length; Pillow takes microseconds for each

_SOI, _EOI, _SOS = 0xD8, 0xD9, 0xDA
_SEQUENTIAL = (0xC0, 0xC1, 0xC9)  # SOF0 and SOF1, and SOF9 with arithmetic coding
_FRAMES = (*_SEQUENTIAL, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF)
_DCT = (0xC0, 0xC1, 0xC2)  # what any decoder reads
_FEW, _MANY = 1 << 9, 1 << 17  # bytes searched at once: first few, since segments follow each other closely


def check_scans(data: bytes) -> None:
    """Raise PhotoError for a JPEG of more than MOST_SCANS scans or MOST_SEGMENTS segments; other bytes pass.

    What follows the scan of a picture that is decoded row by row is not looked at: a decoder refuses another scan.
    """
    if not data.startswith(b"\xff\xd8\xff"):
        return
    scans, frame = 0, None
    for number, (marker, at) in enumerate(_segments(data), 1):
        if number > MOST_SEGMENTS:
            raise PhotoError(f"The JPEG has more than {MOST_SEGMENTS} segments, which no camera or editor writes.")
        frame = at if marker in _FRAMES else frame
        if marker != _SOS:
            continue
        if scans == 0 and _is_by_rows(data, frame, at):
            return
        scans += 1
        if scans > MOST_SCANS:
            raise PhotoError(f"The JPEG has more than {MOST_SCANS} scans, which no camera or editor writes.")


def coefficients(data: bytes) -> float:
    """The DCT coefficients per pixel that a decoder holds in memory; 0 for a JPEG that it decodes row by row.

    It holds all of a progressive picture and of any whose first scan lacks a component (T.81, A.2). Chroma at half the
    resolution each way makes 1.5 of them, CMYK 4.
    """
    frame = None
    for marker, at in _segments(data):
        if marker == _SOS:
            if _is_by_rows(data, frame, at):
                return 0.0
            break
        frame = at if marker in _FRAMES else frame
    if frame is None:
        raise PhotoError("The JPEG announces no picture.")
    factors = [divmod(data[frame + 11 + 3 * i], 16) for i in range(data[frame + 9])]
    whole = max(wide for wide, _ in factors) * max(high for _, high in factors)
    return sum(wide * high for wide, high in factors) / whole


def _is_by_rows(data: bytes, frame: int | None, scan: int) -> bool:
    """Whether a first scan holds every component of a sequential frame; both are places of their markers."""
    if frame is None or data[frame + 1] not in _SEQUENTIAL:
        return False
    return data[scan + 4 : scan + 5] == data[frame + 9 : frame + 10] != b""


def frame_size(data: bytes) -> tuple[int, int]:
    """Width and height that a JPEG's first frame announces; 0, 0 for a lossless one, and where none is found."""
    for marker, at in _segments(data):
        if marker in _DCT and len(data) >= at + 9:
            return int.from_bytes(data[at + 7 : at + 9]), int.from_bytes(data[at + 5 : at + 7])
        if marker in _FRAMES or marker == _SOS:
            break
    return 0, 0


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Marker and place of each of the first picture's segments; not what they hold, nor what follows EOI."""
    view = np.frombuffer(data, dtype=np.uint8)
    at = _next_marker(view, 2)
    while at is not None and (marker := data[at + 1]) not in (_SOI, _EOI):
        yield marker, at
        length = int.from_bytes(data[at + 2 : at + 4])
        at = _next_marker(view, at + 2 + max(2, length))


def _next_marker(view: NDArray[np.uint8], start: int) -> int | None:
    """The index of the first 0xFF from `start` on that a marker's code follows."""
    size = _FEW
    while start < view.size - 1:
        part = view[start : start + size + 1]
        found = (part[:-1] == 0xFF) & (part[1:] != 0)  # rare in a picture, where every 0xFF is stuffed with a 0
        if found.any():
            found &= _is_code(part[1:])
            first = int(found.argmax())
            if found[first]:
                return start + first
        start, size = start + size, min(2 * size, _MANY)
    return None


def _is_code(values: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether each byte after 0xFF begins a segment: not a stuffed byte, TEM (0 and 1), RST0 to RST7 or fill (0xFF)."""
    below, above = values - np.uint8(0x02), values - np.uint8(0xD8)  # these wrap round: one comparison for two
    return (below < 0xD0 - 0x02) | (above < 0xFF - 0xD8)
