"""A scene for Filament: its map as KTX cubemaps with mirror images and harmonics, beside the scene as glTF.

The faces are OpenGL's, in the scene's own frame. The level at t, from 0 to 1, has the roughness
1 - sqrt(1 - t), as Filament reads them. The sun is in none of them.
"""

import numpy as np

from lighting.envmap.cubemap import face_size, level_count, prefilter_cubemap, to_cubemap
from lighting.files.ktx import encode_ktx1
from lighting.light_probe import encode_light_probe, shader_harmonics
from lighting.scene.gltf import write_gltf
from lighting.scene.records import Scene
from lighting.scene.writer import Folder, write_record

_NAMES = [f"L{band}{order}, irradiance, pre-scaled base" for band in range(3) for order in range(-band, band + 1)]


def write_filament(scene: Scene, folder: Folder) -> None:
    """Write the scene as glTF, its map as KTX cubemaps, sh.txt as cmgen writes it, and light.json.

    Args:
        scene: made by `make_scene`.
        folder: where the files go.
    """
    write_gltf(scene, folder)
    size = face_size(scene.environment)
    harmonics = shader_harmonics(scene.light_probe.coefficients)
    texts = [" ".join(f"{value:.6g}" for value in row) for row in harmonics]
    roughnesses = 1 - np.sqrt(1 - np.linspace(0, 1, level_count(size)))
    levels = prefilter_cubemap(scene.environment, size, roughnesses.tolist())
    (folder / "environment_ibl.ktx").write_bytes(encode_ktx1(levels, {"sh": "\n".join(texts) + "\n"}))
    (folder / "environment_skybox.ktx").write_bytes(encode_ktx1([to_cubemap(scene.environment, size)], {}))
    lines = [f"({', '.join(f'{value:18.15f}' for value in row)}); // {_NAMES[i]}" for i, row in enumerate(harmonics)]
    (folder / "sh.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "light.json").write_text(encode_light_probe(scene.light_probe, "filament") + "\n", encoding="utf-8")
    write_record(scene, folder)
