#!/usr/bin/env bash
# trimesh reads a glTF camera as wider than it is: its horizontal angle is the vertical one times the aspect ratio.
#
# Seen on 2026-11-30 with trimesh 5.2.0 of PyPI (NumPy 2.4.6, Python 3.11, Linux x86-64).
# Guessed before: `yfov` arrives in degrees, and the horizontal angle follows by tangents.
# Seen: the vertical angle is right. Of 60 deg at 16:9 the horizontal one is 106.67 deg, where 91.49 is right, and of 90
# deg at 2:1 it is 180 deg, where 126.87 is right. So Camera.K, of 60 deg, has a focal length of 672 pixels across where
# 879 is right: rays at the side of a picture go elsewhere. The other way, a camera of 91.49 by 60 deg, whose pixels are
# square at 16:9, is written with an aspect ratio of 1.525, not 1.778.
# Take the vertical angle alone, and work out the other by the tangents.
#
# Usage: findings/trimesh_gltf_camera.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import base64
import json
import math
import sys
from pathlib import Path

import numpy as np
import trimesh

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes()
URI = "data:application/octet-stream;base64," + base64.b64encode(CORNERS).decode()


def read(vertical, aspect):
    """The angles, across and upright (degrees), that trimesh reads of a camera, and its focal lengths (pixels)."""
    perspective = {"yfov": math.radians(vertical), "aspectRatio": aspect, "znear": 0.1}
    positions = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"camera": 0}, {"mesh": 0}],
        "cameras": [{"type": "perspective", "perspective": perspective}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [positions],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": URI}],
    }
    Path("camera.gltf").write_text(json.dumps(document))
    camera = trimesh.load_scene("camera.gltf").camera
    camera.resolution = (round(1015 * aspect), 1015)
    return camera.fov, camera.K[0, 0], camera.K[1, 1]


changed = False
for vertical, aspect in ((60, 16 / 9), (90, 2)):
    right = math.degrees(2 * math.atan(aspect * math.tan(math.radians(vertical) / 2)))
    (across, upright), focal_x, focal_y = read(vertical, aspect)
    print(f"{vertical} deg at {aspect:.3f}: {across:.2f} by {upright:.2f} deg, where {right:.2f} is right")
    print(f"  focal lengths across {focal_x:.0f}, upright {focal_y:.0f} pixels")
    changed |= abs(across - vertical * aspect) > 0.01 or abs(upright - vertical) > 0.01

box = trimesh.creation.box()
wide = math.degrees(2 * math.atan(16 / 9 * math.tan(math.radians(30))))
scene = trimesh.Scene([box], camera=trimesh.scene.Camera(resolution=(1920, 1080), fov=(wide, 60)))
files = trimesh.exchange.gltf.export_gltf(scene)
written = json.loads(files["model.gltf"])["cameras"][0]["perspective"]
print("written", written)
changed |= abs(written["aspectRatio"] - wide / 60) > 0.001
sys.exit(bool(changed))
PY
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet trimesh==5.2.0 numpy==2.4.6
venv/bin/python check.py
