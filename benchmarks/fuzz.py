"""Read damaged photos for a while; print how many were read and refused, and whatever must not happen.

    python -m benchmarks.fuzz --minutes 60 [--seed 1] [--keep FOLDER] [--corpus FOLDER]

Small photos of every kind, with and without metadata, and the files of a corpus are changed at random: bits, numbers,
lengths, pieces cut out, doubled, moved and exchanged with other photos'. Each is read by a process of
`lighting.photo.sandbox`, as the service and a batch read it. What must not happen: a process that ends (crash), more
than 5 s of processor time (hang), more memory than `memory_budget` states (memory), and an error that is no PhotoError
(error). Such photos are kept in FOLDER. Needs Linux.
"""

import argparse
import os
import random
import struct
import sys
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image, ImageCms

from benchmarks.common import register_heif_writer
from benchmarks.decoding import photo
from lighting.errors import PhotoError
from lighting.photo.reader import MAX_BYTES, MAX_PIXELS, TARGET, memory_budget
from lighting.photo.sandbox import _DecodeRequest, _DecoderProcess

HANG = 5.0  # seconds of processor time
PATIENCE = 120.0  # seconds until a reader is killed, for machines with other work
SIZE = (96, 72)
NUMBERS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
QUIET = {"x265:pools": "none", "x265:frame-threads": "1"}


@dataclass
class Report:
    """What became of the photos."""

    counts: Counter[str] = field(default_factory=Counter)  # "read", "refused", "crash", "hang", "memory", "error"
    slowest: float = 0.0  # s of processor time
    largest: float = 0.0  # peak / allowance

    @property
    def bad(self) -> int:
        return sum(self.counts[name] for name in ("crash", "hang", "memory", "error"))

    def __str__(self) -> str:
        names = ("read", "refused", "crash", "hang", "memory", "error")
        told = ", ".join(f"{name} {self.counts[name]}" for name in names)
        extremes = f"slowest {self.slowest:.2f} s, largest {100 * self.largest:.0f} % of the memory allowed"
        return f"{self.counts.total()} photos: {told}; {extremes}"


def seeds() -> list[bytes]:
    """Small photos of every kind that is read."""
    register_heif_writer()
    picture = photo(*SIZE)
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    told = _exif()
    kinds: list[tuple[str, str, dict[str, Any]]] = [
        ("JPEG", "RGB", {}),
        ("JPEG", "RGB", {"progressive": True, "subsampling": "4:4:4"}),
        ("JPEG", "CMYK", {"quality": 60}),
        ("JPEG", "L", {"optimize": True, "restart_marker_rows": 1}),
        ("MPO", "RGB", {"save_all": True, "append_images": [picture]}),
        ("PNG", "RGB", {}),
        ("PNG", "RGBA", {}),
        ("PNG", "P", {}),
        ("PNG", "1", {}),
        ("PNG", "RGB", {"save_all": True, "append_images": [picture.rotate(180)]}),
        ("WEBP", "RGB", {}),
        ("WEBP", "RGBA", {"lossless": True}),
        ("WEBP", "RGB", {"save_all": True, "append_images": [picture.rotate(180)]}),
        ("TIFF", "RGB", {}),
        ("TIFF", "RGB", {"compression": "tiff_lzw"}),
        ("TIFF", "RGBA", {"compression": "tiff_adobe_deflate"}),
        ("TIFF", "CMYK", {"compression": "packbits"}),
        ("TIFF", "RGB", {"compression": "jpeg"}),
        ("TIFF", "1", {"compression": "group4"}),
        ("AVIF", "RGB", {"speed": 10, "max_threads": 1}),
        ("AVIF", "RGBA", {"speed": 10, "max_threads": 1}),
        ("HEIF", "RGB", {"enc_params": QUIET}),
        ("HEIF", "RGBA", {"enc_params": QUIET}),
    ]
    made = []
    for file_format, mode, options in kinds:
        made += [_saved(picture.convert(mode), file_format, **options)]
        extra = {"exif": told, "icc_profile": profile}
        made += [_saved(picture.convert(mode), file_format, **options, **extra)]
    return [*made, _raw(picture)]


def _saved(picture: Image.Image, file_format: str, **options: Any) -> bytes:
    stream = BytesIO()
    picture.save(stream, file_format, **options)
    return stream.getvalue()


def _exif() -> Image.Exif:
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    exif.get_ifd(ExifTags.IFD.Exif).update({0x9003: "2024:06:01 09:10:00", 0xA405: 26})
    exif.get_ifd(ExifTags.IFD.GPSInfo).update({1: "N", 2: (48.0, 8.0, 15.0), 3: "E", 4: (11.0, 34.0, 30.0)})
    return exif


def _raw(picture: Image.Image) -> bytes:
    """A file that passes for a DNG: a thumbnail's TIFF tags, then a JPEG preview."""
    return _saved(picture, "TIFF", tiffinfo={254: 1, 0xC612: b"\1\4\0\0"}) + _saved(picture, "JPEG")


def changed(data: bytes, others: Sequence[bytes], chance: random.Random) -> bytes:
    """The bytes with one to eight changes; half of the changed PNGs get right checksums again."""
    for _ in range(chance.choice((1, 1, 2, 3, 8))):
        data = chance.choice(CHANGES)(data, others, chance) or data
    return _checked(data) if data.startswith(b"\x89PNG") and chance.random() < 0.5 else data


def _flip(data: bytes, _: Sequence[bytes], chance: random.Random) -> bytes:
    at = chance.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << chance.randrange(8)]) + data[at + 1 :]


def _number(data: bytes, _: Sequence[bytes], chance: random.Random) -> bytes:
    """A number of one, two or four bytes, most often near the beginning, where lengths and sizes stand."""
    at = int(len(data) * chance.random() ** chance.choice((1, 3)))
    value, kind = chance.choice(NUMBERS), chance.choice(("B", ">H", "<H", ">I", "<I"))
    packed = struct.pack(kind, value & (1 << 8 * struct.calcsize(kind)) - 1)
    return data[:at] + packed + data[at + len(packed) :]


def _noise(data: bytes, _: Sequence[bytes], chance: random.Random) -> bytes:
    at = chance.randrange(len(data))
    noise = chance.randbytes(chance.choice((1, 4, 64)))
    return data[:at] + noise + data[at + len(noise) :]


def _cut(data: bytes, _: Sequence[bytes], chance: random.Random) -> bytes:
    return data[: chance.randrange(1, len(data) + 1)]


def _without(data: bytes, _: Sequence[bytes], chance: random.Random) -> bytes:
    start, end = _piece(data, chance)
    return data[:start] + data[end:]


def _doubled(data: bytes, _: Sequence[bytes], chance: random.Random) -> bytes:
    start, end = _piece(data, chance)
    return data[:end] + data[start:end] * chance.choice((1, 2, 200)) + data[end:]


def _exchanged(data: bytes, others: Sequence[bytes], chance: random.Random) -> bytes:
    start, end = _piece(data, chance)
    other = chance.choice(others)
    first, last = _piece(other, chance)
    return data[:start] + other[first:last] + data[end:]


def _piece(data: bytes, chance: random.Random) -> tuple[int, int]:
    start = chance.randrange(len(data))
    return start, min(len(data), start + chance.choice((1, 4, 16, 256, 4096)))


CHANGES: tuple[Callable[[bytes, Sequence[bytes], random.Random], bytes], ...] = (
    _flip, _number, _number, _number, _noise, _cut, _without, _doubled, _exchanged,
)  # fmt: skip


def _checked(data: bytes) -> bytes:
    """A PNG with the checksums that its chunks ask for, as far as they follow each other."""
    out, at = bytearray(data[:8]), 8
    while at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4])
        body = data[at + 4 : end]
        out += data[at : at + 4] + body + struct.pack(">I", zlib.crc32(body))
        at = end + 4
    return bytes(out)


def fuzz(known: Sequence[bytes], chance: random.Random, going: Callable[[int], bool], keep: Path | None) -> Report:
    """Read changed photos while `going` says so of their number."""
    report, decoder = Report(), _DecoderProcess()
    try:
        while going(report.counts.total()):
            data = changed(chance.choice(known), known, chance)
            outcome = _outcome(decoder, data, report)
            report.counts[outcome] += 1
            if keep and outcome not in ("read", "refused"):
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{outcome}-{report.counts.total():07}").write_bytes(data)
    finally:
        decoder.end()
    return report


def _outcome(decoder: _DecoderProcess, data: bytes, report: Report) -> str:
    decoder.prepare()
    pid = decoder.pid
    before, held = _seconds(pid), _rested(pid)
    try:
        decoder.read(_DecodeRequest(len(data), MAX_BYTES, MAX_PIXELS, TARGET, PATIENCE), data)
        outcome = "read"
    except PhotoError as error:
        outcome = "memory" if "more memory" in str(error) else "refused"
    except Exception as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return "error"
    if decoder.pid != pid:
        return "crash"
    seconds, share = _seconds(pid) - before, (_peak(pid) - held) / memory_budget(len(data), MAX_PIXELS, TARGET)
    report.slowest, report.largest = max(report.slowest, seconds), max(report.largest, share)
    return "hang" if seconds > HANG else "memory" if share > 1 else outcome


def _seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _rested(pid: int) -> int:
    """Bytes that a process holds; from here on its peak is counted anew."""
    Path(f"/proc/{pid}/clear_refs").write_text("5")
    return _peak(pid)


def _peak(pid: int) -> int:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def _corpus(folder: Path | None) -> Iterator[bytes]:
    for path in sorted(folder.rglob("*")) if folder else ():
        if path.is_file() and 0 < path.stat().st_size < 1_000_000:
            yield path.read_bytes()


def main() -> int:
    """Fuzz and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for photos that must not happen")
    parser.add_argument("--corpus", type=Path, help="folder of photos, whole or damaged, to change as well")
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    known = [*seeds(), *_corpus(options.corpus)]
    report = fuzz(known, random.Random(options.seed), lambda _: time.monotonic() < end, options.keep)
    print(f"{options.minutes:g} minutes, {len(known)} photos changed at random, seed {options.seed}\n{report}")
    return 1 if report.bad else 0


if __name__ == "__main__":
    sys.exit(main())
