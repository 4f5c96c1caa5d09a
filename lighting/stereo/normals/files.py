"""What a solved day is written as: normals, albedo and uncertainty as pictures, the surface as a mesh.

Normals are stored as (n + 1) / 2 of 16 bits in PNG, red x, green y, blue z, and as they are in EXR; outside the mask
all is 0. Uncertainty is in degrees in EXR and in hundredths of a degree in the 16-bit PNG.
"""

import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError
from lighting.files import SOFTWARE, objection_to, replacing
from lighting.geometry import Floats
from lighting.stereo.normals.frame import Pose, to_world
from lighting.stereo.normals.solve import NormalMap

Image = NDArray[np.float32]

MESH, RECORD = "mesh.ply", "normals.json"

_HUNDREDTHS = 100.0  # of a degree, in the PNG of the uncertainty


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Raise a one-sentence ParameterError where the results cannot or must not be written."""
    if objection := objection_to(folder, overwrite=overwrite):
        raise ParameterError(objection, "folder", ErrorCode.UNWRITABLE)


def write_map(folder: Path, found: NormalMap, pose: Pose) -> None:
    """Write the pictures, each as .png and .exr, into a folder that exists; each file appears when it is whole."""
    for name, plane, codes in _pictures(found, pose):
        write_png16(folder / f"{name}.png", np.where(found.mask[..., None], codes, 0))
        write_picture(folder / f"{name}.exr", plane)


def _pictures(found: NormalMap, pose: Pose) -> list[tuple[str, Image, Floats]]:
    """Name, values (H, W, C) as they are, and as numbers of 16 bits."""
    inside = found.mask[..., None]
    world = (to_world(found.normal, pose) * inside).astype(np.float32)
    error, white = found.error[..., None], 65535.0
    return [
        ("normals_camera", found.normal, (found.normal + 1) / 2 * white),
        ("normals_world", world, (world + 1) / 2 * white),
        ("albedo", found.albedo, found.albedo * white),
        ("uncertainty", error, error * _HUNDREDTHS),
    ]


def write_png16(target: Path, values: Floats) -> None:
    """Write numbers (H, W, C), C 1 or 3, rounded and cut to 0 to 65535, as a PNG of 16 bits."""
    height, width, channels = values.shape
    codes = np.clip(np.round(values), 0, 65535).astype(">u2").reshape(height, -1)
    rows = codes.view(np.uint8).astype(np.uint8)
    rows[1:] -= rows[:-1].copy()  # filter 2: less the row above
    marked = np.concatenate([np.r_[0, np.full(height - 1, 2)].astype(np.uint8)[:, None], rows], axis=1)
    kind = struct.pack(">IIBBBBB", width, height, 16, 2 if channels == 3 else 0, 0, 0, 0)
    chunks = (_chunk(b"IHDR", kind), _chunk(b"IDAT", zlib.compress(marked.tobytes(), 6)), _chunk(b"IEND", b""))
    with replacing(target) as path:
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_picture(target: Path, values: Image) -> None:
    """Write a picture (H, W, C), C 1 or 3, as 32-bit float EXR."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "software": SOFTWARE}
    plane = np.ascontiguousarray(values, dtype=np.float32)
    channels = {"RGB": plane} if plane.shape[-1] == 3 else {"Y": plane[..., 0]}
    with replacing(target) as path:
        OpenEXR.File(header, channels).write(str(path))


def write_mesh(target: Path, vertices: Floats, found: NormalMap) -> None:
    """Write points (H, W, 3) of a mask as a binary PLY mesh with normals and the albedo as colours.

    Two triangles join each four neighbours that are all in the mask, seen counter-clockwise by the camera.
    """
    mask = found.mask
    index = np.cumsum(mask).reshape(mask.shape) - 1
    whole = mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:] & mask[1:, 1:]
    a, b, c, d = (part[whole] for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    with replacing(target) as path:
        path.write_bytes(_ply_header(int(mask.sum()), len(faces)) + _points(vertices, found) + faces.tobytes())


def _points(vertices: Floats, found: NormalMap) -> bytes:
    kinds = [("point", "<f4", 3), ("normal", "<f4", 3), ("colour", "u1", 3)]
    rows = np.empty(int(found.mask.sum()), dtype=kinds)
    rows["point"], rows["normal"] = vertices[found.mask], found.normal[found.mask]
    rows["colour"] = np.clip(np.round(found.albedo[found.mask] * 255), 0, 255)
    return rows.tobytes()


def _ply_header(points: int, faces: int) -> bytes:
    names = [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    names += [f"property uchar {name}" for name in ("red", "green", "blue")]
    lines = ["ply", "format binary_little_endian 1.0", f"comment {SOFTWARE}", f"element vertex {points}", *names]
    lines += [f"element face {faces}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(lines).encode("ascii")


def write_record(target: Path, record: dict[str, Any]) -> None:
    """Write what is known of the day as JSON."""
    with replacing(target) as path:
        path.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
