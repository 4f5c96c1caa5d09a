"""The chunks of a PNG, counted before it is decoded.

Pillow reads each chunk in Python, however small: 64 MB of empty chunks would take it most of a minute.
"""

from lighting.errors import PhotoError

MOST_CHUNKS = 20_000  # libpng writes 8 KiB each: 64 MB make 7,800

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_AROUND = 12  # bytes of a chunk beside its data: length, name, checksum


def check_chunks(data: bytes) -> None:
    """Raise PhotoError for a PNG of more than MOST_CHUNKS chunks; other bytes pass."""
    if not data.startswith(_SIGNATURE):
        return
    at = len(_SIGNATURE)
    for _ in range(MOST_CHUNKS):
        if at >= len(data):
            return
        at += _AROUND + int.from_bytes(data[at : at + 4])
    if at < len(data):
        raise PhotoError(f"The PNG has more than {MOST_CHUNKS} chunks, which no camera or editor writes.")
