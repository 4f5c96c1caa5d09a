"""Make lighting/data/hosek_wilkie.f32: the Hosek-Wilkie RGB coefficients out of the file that Mitsuba 3 ships.

    python -m export.data.hosek_wilkie_table [sunsky_datasets.bin]

Without an argument the file is taken from the installed `mitsuba` package.
"""

import argparse
import importlib.util
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

TABLE = Path(__file__).parents[2] / "lighting" / "data" / "hosek_wilkie.f32"
FIELDS = {  # name in Mitsuba's file: name in ours, with the meaning of the axes
    "sky_params_rgb": "sky",  # turbidity 1..10, albedo 0 and 1, control point, channel, parameter
    "sky_rad_rgb": "sky_radiance",  # turbidity, albedo, control point, channel
    "sun_rad_rgb": "sun",  # turbidity, elevation segment, channel, power of elevation, power of the limb's cosine
}
_MAGIC = b"tensor_file\0"
_TYPES = {10: "<f4", 11: "<f8"}


def _read_tensors(data: bytes) -> dict[str, NDArray[Any]]:
    """Named arrays of a Mitsuba tensor file; ValueError for anything else."""
    if not data.startswith(_MAGIC):
        raise ValueError("not a Mitsuba tensor file")
    position = len(_MAGIC) + 2  # two bytes of version
    (count,) = struct.unpack_from("<I", data, position)
    position += 4
    tensors = {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, position)
        name = data[position + 2 : position + 2 + length].decode()
        position += 2 + length
        rank, kind, offset = struct.unpack_from("<HBQ", data, position)
        shape = struct.unpack_from(f"<{rank}Q", data, position + 11)
        position += 11 + 8 * rank
        tensors[name] = np.frombuffer(data, _TYPES[kind], int(np.prod(shape)), offset).reshape(shape)
    return tensors


def _installed_datasets() -> Path:
    """The data file inside the installed `mitsuba` package, which is not imported."""
    spec = importlib.util.find_spec("mitsuba")
    if spec is None or spec.origin is None:
        raise SystemExit("Install mitsuba (pip install mitsuba) or name its sunsky_datasets.bin.")
    return Path(spec.origin).parent / "data" / "sunsky" / "sunsky_datasets.bin"


def _make_table(source: Path, target: Path = TABLE) -> None:
    """Write the arrays of FIELDS to `target`, one behind the other, as little-endian float32."""
    tensors = _read_tensors(source.read_bytes())
    target.write_bytes(b"".join(tensors[name].astype("<f4").tobytes() for name in FIELDS))


def _main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", nargs="?", type=Path, help="Mitsuba's sunsky_datasets.bin")
    source = parser.parse_args().source or _installed_datasets()
    _make_table(source)
    print(f"{TABLE}: {TABLE.stat().st_size} bytes from {source}")


if __name__ == "__main__":
    _main()
