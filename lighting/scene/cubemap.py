"""A scene's map as cubemaps, beside the scene as glTF: KTX 2 with mirror images, and each face as Radiance HDR.

The faces are OpenGL's, in the scene's own frame. The roughnesses of the levels go from 0 to 1 in equal steps. The sun
is in none of them.
"""

import numpy as np

from lighting.envmap.cubemap import FACES, face_size, level_count, prefilter_cubemap
from lighting.files.ktx import encode_ktx2
from lighting.files.radiance_hdr import encode_hdr_face
from lighting.scene.gltf import write_gltf
from lighting.scene.records import Scene
from lighting.scene.writer import Folder, write_record


def write_cubemap(scene: Scene, folder: Folder) -> None:
    """Write the scene as glTF, its map as KTX 2 with mirror images, and each face as Radiance HDR.

    Args:
        scene: made by `make_scene`.
        folder: where the files go.
    """
    write_gltf(scene, folder)
    size = face_size(scene.environment)
    levels = prefilter_cubemap(scene.environment, size, np.linspace(0, 1, level_count(size)).tolist())
    (folder / "environment.ktx2").write_bytes(encode_ktx2(levels))
    for name, face in zip(FACES, levels[0], strict=True):
        (folder / f"{name}.hdr").write_bytes(encode_hdr_face(face))
    write_record(scene, folder)
