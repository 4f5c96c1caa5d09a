#!/usr/bin/env bash
# Blender's glTF importer divides a directional light by 683, and leaves an image-based light out.
#
# Seen on 2026-11-28 with bpy 4.5.4 and 5.0.1 of PyPI (Python 3.11, Linux x86-64).
# Guessed before: a sun of 6.83 lux arrives as a sun of strength 6.83, and the map becomes the world.
# Seen: by default lux become watts at 683 lumens a watt, so the sun arrives as 0.01 and the scene is black. With the
# lighting mode COMPAT ("Unitless") it arrives as 6.83. EXT_lights_image_based is not read: there is no world.
#
# Usage: findings/blender_gltf_sun.sh; PYTHON names a Python 3.11. It ends with 1 where Blender does otherwise now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > sun.gltf <<'GLTF'
{
  "asset": {"version": "2.0"},
  "extensionsUsed": ["KHR_lights_punctual", "EXT_lights_image_based"],
  "extensions": {
    "KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 6.83, "color": [1, 1, 1]}]},
    "EXT_lights_image_based": {"lights": [{
      "intensity": 1.0, "specularImageSize": 1, "specularImages": [[0, 0, 0, 0, 0, 0]],
      "irradianceCoefficients": [[1, 1, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
    }]}
  },
  "images": [{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg=="}],
  "nodes": [{"name": "Sun", "extensions": {"KHR_lights_punctual": {"light": 0}}}],
  "scenes": [{"nodes": [0], "extensions": {"EXT_lights_image_based": {"light": 0}}}],
  "scene": 0
}
GLTF
cat > check.py <<'PY'
import sys

import bpy

seen = []
for mode in ("SPEC", "COMPAT"):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath="sun.gltf", export_import_convert_lighting_mode=mode)
    (light,) = bpy.data.lights
    world = bpy.context.scene.world
    seen.append((round(light.energy, 4), world is None))
    print(f"Blender {bpy.app.version_string}, {mode}: a sun of strength {light.energy:.4f}, world {world}")
sys.exit(seen != [(0.01, True), (6.83, True)])
PY
for version in 4.5.4 5.0.1; do
  "${PYTHON:-python3.11}" -m venv "$version"
  "$version/bin/pip" install --quiet "bpy==$version"
  "$version/bin/python" check.py
done
