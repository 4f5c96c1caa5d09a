"""The size of a WebP, read before Pillow opens it.

Pillow reads every WebP as an animation and makes room for two of its pictures when it opens one, before it tells their
size; in a process whose memory is bounded, a large one would then look damaged.
"""

_HEAD = 30  # bytes
_START_OF_FRAME = b"\x9d\x01\x2a"
_LOSSLESS = 0x2F


def canvas(data: bytes) -> tuple[int, int] | None:
    """Width and height in pixels of a WebP (RFC 9649, 2.5 to 2.7); None for other bytes and for a head that is none."""
    if len(data) < _HEAD or not data.startswith(b"RIFF") or data[8:12] != b"WEBP":
        return None
    kind, head = data[12:16], data[20:_HEAD]
    if kind == b"VP8X":
        return int.from_bytes(head[4:7], "little") + 1, int.from_bytes(head[7:10], "little") + 1
    if kind == b"VP8L" and head[0] == _LOSSLESS:
        bits = int.from_bytes(head[1:5], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 " and head[3:6] == _START_OF_FRAME:
        return int.from_bytes(head[6:8], "little") & 0x3FFF, int.from_bytes(head[8:10], "little") & 0x3FFF
    return None
