#!/usr/bin/env bash
# Blender's USD importer makes a DistantLight four times as strong and twice as wide, and keeps its exposure apart.
#
# Seen on 2026-11-28 with bpy 4.5.4 and 5.0.1 of PyPI (Python 3.11, Linux x86-64).
# Guessed before: strength and angle arrive as they are, perhaps times pi.
# Seen: intensity 2, angle 0.53 deg becomes a sun of strength 8 and 1.06 deg. Exposure 3 stays a number of its own, as
# three stops, while intensity 1 becomes 4. So a white level plane under a USD sun is four times too bright.
# For light in Blender, write a scene of Blender's own, or divide the strength by four after the import.
#
# Usage: findings/blender_usd_sun.sh; PYTHON names a Python 3.11. It ends with 1 where Blender does otherwise now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > sun.usda <<'USD'
#usda 1.0
(
  defaultPrim = "World"
  upAxis = "Z"
  metersPerUnit = 1
)
def Xform "World" {
  def DistantLight "Sun" {
    float inputs:intensity = 2
    float inputs:angle = 0.53
  }
  def DistantLight "Stops" {
    float inputs:intensity = 1
    float inputs:exposure = 3
    float inputs:angle = 0.53
  }
}
USD
cat > check.py <<'PY'
import math
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath="sun.usda")
seen = {}
for name in ("Sun", "Stops"):
    light = bpy.data.objects[name].data
    seen[name] = (round(light.energy, 3), round(math.degrees(light.angle), 3), getattr(light, "exposure", 0.0))
    print(f"Blender {bpy.app.version_string}: {name}: strength %.3f, angle %.3f deg, exposure %.1f" % seen[name])
sys.exit(seen != {"Sun": (8.0, 1.06, 0.0), "Stops": (4.0, 1.06, 3.0)})
PY
for version in 4.5.4 5.0.1; do
  "${PYTHON:-python3.11}" -m venv "$version"
  "$version/bin/pip" install --quiet "bpy==$version"
  "$version/bin/python" check.py
done
