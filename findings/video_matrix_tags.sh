#!/usr/bin/env bash
# The same clip has other colors by version: PyAV before 17 and OpenCV before 4.13 decode BT.709 by BT.601's matrix.
#
# Seen on 2026-11-30 with PyAV 16.1.0, 17.0.0 and 18.1.0, OpenCV 4.12.0.88, 4.13.0.90 and 5.0.0.93 of PyPI (headless;
# NumPy 2.2.6, Python 3.11, Linux x86-64).
# Guessed before: PyAV's to_ndarray goes by the clip's tag, OpenCV's VideoCapture takes BT.601 whatever the clip says.
# Seen: PyAV 16.1 and OpenCV 4.12 ignore the tag, and the later ones obey it. Nothing is said. Grass of (80, 140, 40) in
# a 720p clip tagged BT.709 is read as (83, 150, 42) by the older, and a sky of (110, 170, 235) as (114, 170, 231). Gray
# stays. A clip that names no matrix, as many do, is read by BT.601 by all of them, at 720p too.
# So measured colors move when a library is updated. Name the matrix: with PyAV by `src_colorspace` of `reformat`, and
# another `dst_colorspace`, without which 16.1 does not look at it in a tagged clip.
#
# Usage: findings/video_matrix_tags.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > make.py <<'PY'
import av
import numpy as np

WIDTH, HEIGHT = 1280, 720
KR, KB = 0.2126, 0.0722  # of BT.709


def luma_and_chroma(red, green, blue):
    """Bytes of limited range by BT.709's matrix."""
    luma = KR * red + (1 - KR - KB) * green + KB * blue
    chroma = (blue - luma) / (2 - 2 * KB), (red - luma) / (2 - 2 * KR)
    return round(16 + 219 / 255 * luma), *(round(128 + 224 / 255 * value) for value in chroma)


sky, grass = luma_and_chroma(110, 170, 235), luma_and_chroma(80, 140, 40)
planes = []
for plane, (above, below) in enumerate(zip(sky, grass)):
    rows, columns = (HEIGHT, WIDTH) if plane == 0 else (HEIGHT // 2, WIDTH // 2)
    planes.append(np.repeat([above, below], rows // 2 * columns))
pixels = np.concatenate(planes).astype(np.uint8).reshape(-1, WIDTH)
for name, matrix in (("tagged.mp4", 1), ("untagged.mp4", 2)):  # 1 is BT.709, 2 is unspecified
    with av.open(name, "w") as clip:
        stream = clip.add_stream("libx264", rate=24, options={"crf": "1"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.codec_context.colorspace = matrix
        stream.codec_context.color_range = 1
        frame = av.VideoFrame.from_ndarray(pixels, format="yuv420p")
        frame.colorspace, frame.color_range = matrix, 1
        for packet in (*stream.encode(frame), *stream.encode()):
            clip.mux(packet)
PY
cat > read.py <<'PY'
import json
import sys

colors = {}
for name in ("tagged.mp4", "untagged.mp4"):
    if sys.argv[1] == "PyAV":
        import av

        with av.open(name) as clip:
            pixels = next(clip.decode(video=0)).to_ndarray(format="rgb24")
    else:
        import cv2

        pixels = cv2.VideoCapture(name).read()[1][..., ::-1]
    colors[name] = [pixels[row, 640].tolist() for row in (180, 540)]
print(json.dumps(colors))
PY
cat > check.py <<'PY'
import json
import subprocess
import sys

RIGHT, WRONG = [(110, 170, 235), (80, 140, 40)], [(114, 170, 231), (83, 150, 42)]
changed = False
for venv, expected in (("old", WRONG), ("new", RIGHT), ("newest", RIGHT)):
    for reader in ("PyAV", "OpenCV"):
        colors = json.loads(subprocess.check_output([f"{venv}/bin/python", "read.py", reader]))
        for name, seen in colors.items():
            wanted = expected if name == "tagged.mp4" else WRONG
            print(venv, reader, name, seen)
            changed |= any(abs(a - b) > 2 for have, want in zip(seen, wanted) for a, b in zip(have, want))
sys.exit(bool(changed))
PY
for versions in "old 16.1.0 4.12.0.88" "new 17.0.0 4.13.0.90" "newest 18.1.0 5.0.0.93"; do
  read -r venv av opencv <<< "$versions"
  "${PYTHON:-python3.11}" -m venv "$venv"
  "$venv/bin/pip" install --quiet "av==$av" "opencv-python-headless==$opencv" numpy==2.2.6
done
new/bin/python make.py
new/bin/python check.py
