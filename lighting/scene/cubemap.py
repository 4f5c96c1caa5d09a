"""A scene's map as cubemaps beside the scene as glTF: for Filament, and for three.js and other engines.

Filament takes KTX 1 [1] with packed floats [2], others KTX 2 with half floats and mirror images, and each face as
Radiance HDR. The faces are OpenGL's, in the scene's own frame. The sun is in none of them. The roughnesses of the
levels go from 0 to 1 in equal steps. For Filament the level at t, from 0 to 1, has the roughness 1 - sqrt(1 - t).

References:
    [1] Khronos, KTX File Format Specification, versions 1.0 and 2.0.
    [2] Khronos, EXT_packed_float and Data Format Specification 1.3.
"""

import struct
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import FACES, face_size, level_count, prefilter_cubemap, to_cubemap
from lighting.files.exr import SOFTWARE
from lighting.files.radiance_hdr import encode_hdr_face
from lighting.light_probe import encode_light_probe, shader_harmonics
from lighting.scene import RECORD
from lighting.scene.gltf import encode_gltf
from lighting.scene.records import Scene
from lighting.scene.writer import Files, encode_record

Levels = Sequence[NDArray[np.float32]]  # each (6, size, size, 3) of half the size of the one before

_KTX1_MAGIC, _KTX2_MAGIC = b"\xabKTX 11\xbb\r\n\x1a\n", b"\xabKTX 20\xbb\r\n\x1a\n"
_ENDIANNESS = 0x04030201
# OpenGL's R11F_G11F_B10F as the type, of one byte a word, RGB, and again: what Filament's cmgen writes and reads
_PACKED_FORMATS = (0x8C3A, 1, 0x1907, 0x8C3A, 0x8C3A)
_HALF_RGBA = 97  # Vulkan's R16G16B16A16_SFLOAT
_MAX_PACKED = 64512.0  # that ten bits hold
_MAX_HALF = 65504.0


def _encode_ktx1(levels: Levels, metadata: Mapping[str, str]) -> bytes:
    """Return a cubemap as KTX 1 with 11, 11 and 10 bits of float a pixel.

    Args:
        levels: linear radiance, the largest first.
        metadata: texts by their keys.
    """
    size, pairs = levels[0].shape[1], _key_value_data(metadata)
    header = struct.pack("<13I", _ENDIANNESS, *_PACKED_FORMATS, size, size, 0, 0, 6, len(levels), len(pairs))
    images = b"".join(struct.pack("<I", 4 * faces[0, ..., 0].size) + _pack_floats(faces) for faces in levels)
    return _KTX1_MAGIC + header + pairs + images


def _encode_ktx2(levels: Levels) -> bytes:
    """Return a cubemap as KTX 2 with four half floats a pixel, the last of them 1.

    Args:
        levels: linear radiance, the largest first.
    """
    size, descriptor = levels[0].shape[1], _half_descriptor()
    pairs = _key_value_data({"KTXorientation": "rd", "KTXwriter": SOFTWARE})
    start = len(_KTX2_MAGIC) + 36 + 32 + 24 * len(levels)
    header = struct.pack("<9I", _HALF_RGBA, 2, size, size, 0, 0, 6, len(levels), 0)
    index = struct.pack("<4I2Q", start, len(descriptor), start + len(descriptor), len(pairs), 0, 0)
    images, places, position = b"", [], start + len(descriptor) + len(pairs)
    for faces in reversed(levels):  # the smallest lies first
        padding = -position % 8
        data = _half_rgba(faces)
        images += b"\0" * padding + data
        places.append(struct.pack("<3Q", position + padding, len(data), len(data)))
        position += padding + len(data)
    return _KTX2_MAGIC + header + index + b"".join(reversed(places)) + descriptor + pairs + images


def _key_value_data(texts: Mapping[str, str]) -> bytes:
    """Texts by their keys, as both versions have them: each with its length before it, padded to four bytes."""
    pairs = [key.encode() + b"\0" + text.encode() + b"\0" for key, text in texts.items()]
    return b"".join(struct.pack("<I", len(pair)) + pair + b"\0" * (-len(pair) % 4) for pair in pairs)


def _pack_floats(radiance: NDArray[np.float32]) -> bytes:
    """Colors (..., 3) in 32 bits each: five of exponent a channel, and six, six and five of mantissa [2]."""
    halves = np.clip(radiance, 0.0, _MAX_PACKED).astype(np.float16).view(np.uint16).astype(np.uint32)
    red, green = (np.minimum(halves[..., channel] + 8 >> 4, 0x7BF) for channel in (0, 1))
    blue = np.minimum(halves[..., 2] + 16 >> 5, 0x3DF)
    return bytes((red | green << 11 | blue << 22).astype("<u4").tobytes())


def _half_rgba(radiance: NDArray[np.float32]) -> bytes:
    colors = np.clip(radiance, 0.0, _MAX_HALF)
    return bytes(np.concatenate([colors, np.ones_like(colors[..., :1])], axis=-1).astype("<f2").tobytes())


def _half_descriptor() -> bytes:
    """The basic data format descriptor of linear Rec.709 in half floats: four samples of 16 signed float bits."""
    samples = b""
    for i, channel in enumerate((0, 1, 2, 15)):  # red, green, blue, alpha
        samples += struct.pack("<HBB4B2I", 16 * i, 15, channel | 0xC0, 0, 0, 0, 0, 0xBF800000, 0x3F800000)
    block = struct.pack("<IHH8B8B", 0, 2, 24 + len(samples), 1, 1, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0)
    return struct.pack("<I", 4 + len(block) + len(samples)) + block + samples


def encode_cubemap(scene: Scene) -> Files:
    """Return the scene as glTF, its map as KTX 2 with mirror images, and each face as Radiance HDR.

    Args:
        scene: made by `make_scene`.
    """
    size = face_size(scene.environment)
    levels = prefilter_cubemap(scene.environment, size, np.linspace(0, 1, level_count(size)).tolist())
    faces = {f"{name}.hdr": encode_hdr_face(face) for name, face in zip(FACES, levels[0], strict=True)}
    return {**encode_gltf(scene), "environment.ktx2": _encode_ktx2(levels), **faces, RECORD: encode_record(scene)}


_NAMES = [f"L{band}{order}, irradiance, pre-scaled base" for band in range(3) for order in range(-band, band + 1)]


def encode_filament(scene: Scene) -> Files:
    """Return the scene as glTF, its map as KTX cubemaps, sh.txt as cmgen writes it, and light.json.

    Args:
        scene: made by `make_scene`.
    """
    size = face_size(scene.environment)
    harmonics = shader_harmonics(scene.light_probe.coefficients)
    texts = [" ".join(f"{value:.6g}" for value in row) for row in harmonics]
    roughnesses = 1 - np.sqrt(1 - np.linspace(0, 1, level_count(size)))
    levels = prefilter_cubemap(scene.environment, size, roughnesses.tolist())
    lines = [f"({', '.join(f'{value:18.15f}' for value in row)}); // {_NAMES[i]}" for i, row in enumerate(harmonics)]
    return {
        **encode_gltf(scene),
        "environment_ibl.ktx": _encode_ktx1(levels, {"sh": "\n".join(texts) + "\n"}),
        "environment_skybox.ktx": _encode_ktx1([to_cubemap(scene.environment, size)], {}),
        "sh.txt": ("\n".join(lines) + "\n").encode(),
        "light.json": (encode_light_probe(scene.light_probe, "filament") + "\n").encode(),
        RECORD: encode_record(scene),
    }
