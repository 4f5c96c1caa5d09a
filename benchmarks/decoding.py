"""Print the peak memory of reading one photo of each kind, in bytes per pixel, and the processor time.

    python -m benchmarks.decoding [--bombs]

Each photo is read in a process of its own, at the size that the network needs; what the process held before does not
count. Needs Linux. `lighting/photo/reader.py` holds the memory that this printed, rounded up. The last column is the
time of as many megapixels as that table admits of the kind, for `sandbox.MAX_DECODE_SECONDS`.

`--bombs` prints instead what a command takes for files that are made to cost much: processor time with its decoders,
the peak memory of its largest process, its exit status and its last words.
"""

import multiprocessing
import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.common import ROOT, register_heif_writer
from lighting.photo.reader import MAX_PIXELS, TARGET, _open_photo, _pixel_limit

SIZES = ((2000, 1500), (4000, 3000))  # pixels
READ = """
import sys, time
from PIL import AvifImagePlugin
from pi_heif import options
from lighting.photo.reader import read_photo
AvifImagePlugin.DEFAULT_MAX_THREADS = options.DECODE_THREADS = 1
def peak():
    return int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1])
data = open(sys.argv[1], "rb").read()
read_photo(open(sys.argv[2], "rb").read())
before, began = peak(), time.process_time()
read_photo(data, target=int(sys.argv[3]))
print(peak() - before, time.process_time() - began)
"""


def photo(width: int, height: int) -> Image.Image:
    """A gradient with noise: it has more colors than a palette holds, and compresses within seconds."""
    tile = np.random.default_rng(0).integers(0, 60, (64, 64, 3), dtype=np.uint8)
    noise = np.tile(tile, (-(-height // 64), -(-width // 64), 1))[:height, :width]
    return Image.fromarray(noise + np.linspace(0, 190, width).astype(np.uint8)[:, None])


def _saved(image: Image.Image, file_format: str, **options: object) -> bytes:
    stream = BytesIO()
    image.save(stream, file_format, **options)
    return stream.getvalue()


def _deep(width: int, height: int) -> bytes:
    gray = np.asarray(photo(width, height).convert("L")).astype(np.uint16) * 257
    return _saved(Image.fromarray(gray), "PNG", compress_level=1)


def _jpeg(mode: str, **options: object) -> Callable[[int, int], bytes]:
    return lambda w, h: _saved(photo(w, h).convert(mode), "JPEG", **options)


def _other(file_format: str, mode: str = "RGB", **options: object) -> Callable[[int, int], bytes]:
    return lambda w, h: _saved(photo(w, h).convert(mode), file_format, **options)


def _tiff(mode: str, compression: str) -> Callable[[int, int], bytes]:
    """A picture that is one strip, which libtiff decodes at once."""
    return lambda w, h: _saved(
        photo(w, h).convert(mode), "TIFF", compression=compression, strip_size=w * h * len(mode), tiffinfo={278: h}
    )


def _flat(mode: str) -> Callable[[int, int], bytes]:
    threads = {"x265:pools": "none", "x265:frame-threads": "1"}  # its pool can hang on a busy machine
    return lambda w, h: _saved(Image.new(mode, (w, h), "skyblue"), "HEIF", quality=30, enc_params=threads)


KINDS: dict[str, Callable[[int, int], bytes]] = {
    "JPEG, baseline 4:2:0": _jpeg("RGB"),
    "JPEG, baseline CMYK": _jpeg("CMYK"),
    "JPEG, progressive gray": _jpeg("L", progressive=True),
    "JPEG, progressive 4:2:0": _jpeg("RGB", progressive=True),
    "JPEG, progressive 4:2:2": _jpeg("RGB", progressive=True, subsampling="4:2:2"),
    "JPEG, progressive 4:4:4": _jpeg("RGB", progressive=True, subsampling="4:4:4"),
    "JPEG, progressive CMYK": _jpeg("CMYK", progressive=True),
    "MPO": lambda w, h: _saved(photo(w, h), "MPO", save_all=True, append_images=[photo(w, h)]),
    "PNG, RGB": _other("PNG", compress_level=1),
    "PNG, RGBA": _other("PNG", "RGBA", compress_level=1),
    "PNG, gray": _other("PNG", "L", compress_level=1),
    "PNG, 16-bit gray": _deep,
    "PNG, palette": _other("PNG", "P", compress_level=1),
    "WebP, lossy": _other("WEBP", method=0),
    "WebP, lossy with alpha": _other("WEBP", "RGBA", method=0),
    "WebP, lossless": _other("WEBP", lossless=True, quality=0, method=0),
    "TIFF, one strip": _tiff("RGB", "tiff_lzw"),
    "TIFF, one strip, RGBA": _tiff("RGBA", "tiff_adobe_deflate"),
    "TIFF, one strip, CMYK": _tiff("CMYK", "tiff_lzw"),
    "TIFF, raw": _other("TIFF"),
    "TIFF, JPEG inside": _other("TIFF", compression="jpeg"),
    "AVIF": _other("AVIF", speed=10, max_threads=1),
    "AVIF, 4:4:4 with alpha": _other("AVIF", "RGBA", speed=10, max_threads=1, subsampling="4:4:4"),
    "HEIC": _flat("RGB"),  # encoding noise would take minutes, and the decoder's memory depends on the size alone
    "HEIC, RGBA": _flat("RGBA"),
}


def cost(path: Path, small: Path, target: int = TARGET) -> tuple[int, float]:
    """Bytes by which reading the photo raises the peak of a process that has read a small one, and CPU seconds."""
    command = [sys.executable, "-c", READ, str(path), str(small), str(target)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    peak, seconds = done.stdout.split()
    return int(peak) * 1024, float(seconds)


def measured(kind: str, size: tuple[int, int], target: int = TARGET) -> tuple[float, float, int]:
    """Bytes and CPU microseconds per pixel of reading a photo of that kind and size, and the pixels admitted."""
    with tempfile.TemporaryDirectory() as folder:
        paths = Path(folder) / "large", Path(folder) / "small"
        for path, (width, height) in zip(paths, (size, (96, 64)), strict=True):
            path.write_bytes(KINDS[kind](width, height))
        peak, seconds = cost(*paths, target)
        data = paths[0].read_bytes()
        most, _ = _pixel_limit(_open_photo(data), data, MAX_PIXELS)
    pixels = size[0] * size[1]
    return peak / pixels, 1e6 * seconds / pixels, most


def _lines() -> Iterator[str]:
    yield f"{'kind':26}" + "".join(f"{w * h / 1e6:10g} MP" for w, h in SIZES) + f"{'admitted':>13}{'takes':>10}"
    for kind in KINDS:
        results = [measured(kind, size) for size in SIZES]
        _, each, most = results[-1]
        memory = "".join(f"{per_pixel:13.2f}" for per_pixel, _, _ in results)
        yield f"{kind:26}{memory}{most / 1e6:10.0f} MP{each * most / 1e6:8.1f} s"


def _write_zeros(path: Path) -> None:
    """An EXR of 16000 x 8000 pixels: the block of a file of 16 rows, 500 times."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.zeros((16, 16000, 3), np.float32)}).write(str(path))
    data = path.read_bytes()
    begin = data.index(b"scanlineimage\0") + 14  # of the table, in which one block stands
    block = data[begin + 12 :]  # without its row
    first = begin + 8 * 500
    table = struct.pack("<500Q", *range(first, first + 500 * (4 + len(block)), 4 + len(block)))
    head = data[:begin].replace(struct.pack("<2i", 15999, 15), struct.pack("<2i", 15999, 7999))
    path.write_bytes(head + table + b"".join(struct.pack("<i", 16 * row) + block for row in range(500)))


def _write_segments(path: Path) -> None:
    jpeg = _saved(photo(640, 480), "JPEG")
    segment = b"\xff\xe1" + struct.pack(">H", 65535) + b"Exif\0\0" + bytes(65527)
    path.write_bytes(jpeg[:2] + 900 * segment + jpeg[2:])


def _write_tags(path: Path) -> None:
    tags = b"".join(struct.pack("<HHII", 40000 + i % 20000, 4, 1, i) for i in range(60_000))
    exif = b"Exif\0\0II*\0\x08\0\0\0" + struct.pack("<H", 60_000) + tags + bytes(4)
    path.write_bytes(_saved(photo(640, 480), "WEBP", exif=exif))


def _clip(width: int, height: int, frames: int) -> Callable[[Path], None]:
    """A clip of flat frames."""

    def write(path: Path) -> None:
        import av

        with av.open(str(path), "w") as film:
            stream = film.add_stream("libx264", rate=30, options={"preset": "ultrafast"})
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            frame = av.VideoFrame.from_ndarray(np.full((height, width, 3), 128, np.uint8), format="rgb24")
            for _ in range(frames):
                frame.pts = None
                film.mux(stream.encode(frame))
            film.mux(stream.encode())

    return write


BOMBS: dict[str, tuple[str, str, Callable[[Path], None]]] = {  # the command and the file's suffix
    "EXR, 16000 x 8000 zeros": ("info", ".exr", _write_zeros),
    "JPEG, 900 EXIF segments": ("estimate", ".jpg", _write_segments),
    "WebP, EXIF of 60,000 tags": ("estimate", ".webp", _write_tags),
    "clip, 200 flat frames": ("video", ".mp4", _clip(640, 360, 200)),
    "clip, 8000 x 8000": ("video", ".mp4", _clip(8000, 8000, 3)),
}


def _bomb_lines() -> Iterator[str]:
    yield f"{'file':26}{'kB':>8}{'CPU s':>8}{'peak MB':>9}{'exit':>6}"
    for name, (command, suffix, write) in BOMBS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"bomb{suffix}")
            writer = multiprocessing.get_context("fork").Process(target=write, args=(path,))
            writer.start()  # in a process of its own, whose memory would count as the command's
            writer.join()
            output = ["-o", str(Path(folder, "out"))] if command == "video" else []
            words = [sys.executable, "-m", "lighting", command, str(path), *output]
            with Path(folder, "log").open("w+") as log:
                process = subprocess.Popen(words, cwd=ROOT, stdout=log, stderr=log)
                _, status, usage = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
                log.seek(0)
                last = (log.read().splitlines() or [""])[-1].replace(f"{path}: ", "")[:90]
            seconds, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3
            size = path.stat().st_size / 1e3
            yield f"{name:26}{size:8.0f}{seconds:8.2f}{memory:9.0f}{process.returncode:6}  {last}"


if __name__ == "__main__":
    register_heif_writer()
    for line in _bomb_lines() if "--bombs" in sys.argv[1:] else _lines():
        print(line, flush=True)
