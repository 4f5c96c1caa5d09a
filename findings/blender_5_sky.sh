#!/usr/bin/env bash
# Blender 5's Sky Texture has no NISHITA, and a new one is another model: 1.6 times brighter and bluer overhead.
#
# Seen on 2026-11-30 with bpy 4.5.4 and 5.0.1 of PyPI (Python 3.11, Linux x86-64).
# Guessed before: the name NISHITA stays, and a node that a script adds makes the same light.
# Seen: 5.0 refuses NISHITA; SINGLE_SCATTERING is that model, within half a percent. But a node that is added begins as
# MULTIPLE_SCATTERING: with the sun 30 deg high its upper half is 1.6 times as bright in the mean, and the zenith has
# 1.9 times the blue and 1.2 times the red. Set sky_type by name, by Blender's version.
#
# Usage: findings/blender_5_sky.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > render.py <<'PY'
import math
import os
import sys

import bpy
import numpy as np

out, kind = sys.argv[1:3]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene, world = bpy.context.scene, bpy.data.worlds.new("World")
scene.world, world.use_nodes = world, True
tree = world.node_tree
sky = tree.nodes.new("ShaderNodeTexSky")
if kind != "as added":
    sky.sky_type = kind
sky.sun_elevation, sky.sun_rotation, sky.sun_disc, sky.altitude = math.radians(30), 0.0, False, 0.0
background = next(node for node in tree.nodes if node.type == "BACKGROUND")
tree.links.new(sky.outputs[0], background.inputs[0])
camera = bpy.data.cameras.new("Camera")
camera.type = "PANO"
(camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
scene.camera = bpy.data.objects.new("Camera", camera)
scene.camera.rotation_euler = math.pi / 2, 0, 0
scene.collection.objects.link(scene.camera)
scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 4, False
scene.render.resolution_x, scene.render.resolution_y = 64, 32
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = os.path.abspath("sky.exr")
bpy.ops.render.render(write_still=True)
pixels = np.array(bpy.data.images.load(scene.render.filepath).pixels[:]).reshape(32, 64, 4)[::-1, :, :3]
np.save(out, [*pixels[1].mean(axis=0), pixels[:16].mean()])  # the zenith's color, and the upper half
print(bpy.app.version_string, sky.sky_type)
PY
cat > check.py <<'PY'
import sys

import numpy as np

nishita, single, added = (np.load(f"{name}.npy") for name in ("nishita", "single", "added"))
print("zenith and upper half over those of 4.5's NISHITA:", single / nishita, added / nishita)
same = np.allclose(single, nishita, rtol=0.01)
sys.exit(not (same and np.allclose(added / nishita, [1.23, 1.59, 1.87, 1.58], rtol=0.03)))
PY
for version in 4.5.4 5.0.1; do
  "${PYTHON:-python3.11}" -m venv "blender-$version"
  "blender-$version/bin/pip" install --quiet "bpy==$version"
done
blender-4.5.4/bin/python render.py nishita.npy NISHITA | tail -n 1
blender-5.0.1/bin/python render.py single.npy SINGLE_SCATTERING | tail -n 1
blender-5.0.1/bin/python render.py added.npy "as added" | tail -n 1
if blender-5.0.1/bin/python render.py none.npy NISHITA > refused.txt 2>&1; then
  echo "Blender 5 takes NISHITA again"
  exit 1
fi
grep -o 'enum "NISHITA" not found' refused.txt | tail -n 1
blender-5.0.1/bin/python check.py
