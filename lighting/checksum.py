"""Checksums of this package's networks and tables: a damaged file gives an error in place of another light.

Each file is read as rows of 4 KiB, in columns of 8 bytes. The checksum is a CRC-32 [1] of each row's XOR, of each
column's sum, and of the rest: a parity check in two dimensions. It takes a third of the time of a CRC of all bytes.
`python -m scripts.checksums` writes the list.

References:
    [1] ISO/IEC/IEEE 8802-3, "Frame check sequence".
"""

import zlib
from functools import lru_cache
from io import BufferedIOBase, BytesIO
from pathlib import Path

import numpy as np

from lighting.errors import ErrorCode, ModelError

DATA_FOLDER = Path(__file__).parent / "data"
CHECKSUMS = "CHECKSUMS"  # in it, a line for each file: its checksum and its name
CHECKED_SUFFIXES = (".onnx", ".data", ".f32", ".f16", ".npy")  # of networks, their weights, and tables

_COLUMNS = 512  # of 8 bytes
_CHUNK = 64 * _COLUMNS * 8  # bytes that are read at once, so that they stay in the processor's cache


def compute_checksum(stream: BufferedIOBase) -> str:
    """Return the checksum of what a binary stream holds, as eight hexadecimal digits.

    Args:
        stream: at its beginning; it is read to its end.
    """
    buffer = bytearray(_CHUNK)
    rows = np.frombuffer(buffer, "<u8").reshape(-1, _COLUMNS)
    columns, checksum = np.zeros(_COLUMNS, "<u8"), 0
    while (size := stream.readinto(buffer)) == _CHUNK:
        checksum = zlib.crc32(np.bitwise_xor.reduce(rows, axis=1).data, checksum)
        columns += np.add.reduce(rows, axis=0)
    checksum = zlib.crc32(memoryview(buffer)[:size], zlib.crc32(columns.data, checksum))
    return f"{checksum:08x}"


def verify_checksum(file: Path) -> None:
    """Raise ModelError for a file of this package that is damaged or missing; any other file passes.

    Args:
        file: a network, its weights or a table.
    """
    if file.parent != DATA_FOLDER:
        return
    if file.is_file():
        with file.open("rb") as stream:
            _compare(file.name, compute_checksum(stream))
    elif file.name in _read_list():
        raise _damage(file.name, "missing")


def read_checked(name: str) -> bytes:
    """Return what a table of this package holds.

    Args:
        name: of the file.

    Raises:
        ModelError: it is damaged or missing.
    """
    try:
        data = (DATA_FOLDER / name).read_bytes()
    except FileNotFoundError as error:
        raise _damage(name, "missing") from error
    _compare(name, compute_checksum(BytesIO(data)))
    return data


def verify_checksums() -> int:
    """Check every network and table of this package, and return how many there are.

    Raises:
        ModelError: one is damaged or missing.
    """
    names = _read_list()
    for name in names:
        verify_checksum(DATA_FOLDER / name)
    return len(names)


def list_checksums() -> str:
    """Return what the file CHECKSUMS should hold for the files that are there."""
    files = sorted(path for path in DATA_FOLDER.iterdir() if path.suffix in CHECKED_SUFFIXES)
    return "".join(f"{compute_checksum(BytesIO(path.read_bytes()))}  {path.name}\n" for path in files)


@lru_cache(maxsize=1)
def _read_list() -> dict[str, str]:
    """The checksums by name."""
    try:
        lines = (DATA_FOLDER / CHECKSUMS).read_text(encoding="ascii").splitlines()
        return {name: checksum for checksum, name in (line.split() for line in lines)}
    except (FileNotFoundError, ValueError) as error:
        raise _damage(CHECKSUMS, "damaged or missing") from error


def _compare(name: str, checksum: str) -> None:
    if _read_list().get(name) != checksum:
        raise _damage(name, "damaged")


def _damage(name: str, state: str) -> ModelError:
    return ModelError(f"{DATA_FOLDER / name} is {state}; install this package again.", code=ErrorCode.UNREADABLE)
