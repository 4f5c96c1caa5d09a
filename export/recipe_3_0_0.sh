#!/usr/bin/env bash
# Network 3.0.0: D and E answer together, and a network of its own for the camera. All three go on from 2.5.0.
# Usage: export/recipe_3_0_0.sh DIR FILE [OUT], with a folder of panoramas, outdoor-2.5.0.onnx and the file to write.
# FILE: git show 47c0695c:lighting/data/outdoor-2.5.0.onnx > outdoor-2.5.0.onnx, its .data likewise.
# First: git show 36dd47ee:lighting/data/segments-1.1.0.onnx > segments-1.1.0.onnx
#
# Not to the bit. An H200 trained for 8 and for 11 minutes, by scripts over the same functions that are not kept: networks
# shared their crops, and rates fell by time. The teachers d31 and e31 saw 970 panoramas, packed to 1280 x 640; d34, e34
# and c34 saw 875 (at most seven of a place), as they are. Of mirror images d34 and e34 had their teachers' answers alone.
# The teachers of 2.5.0 did not answer for the light around. The head of `segments` was learned by such a script, too.
set -euo pipefail
data=${1:?Usage: $0 DIR FILE [OUT]}
file=${2:?Usage: $0 DIR FILE [OUT]}
out=${3:-runs/outdoor-3.0.0.onnx}

train() { python -m export train --data "$data" --tune-share 0 --version 3.0.0 --batch 64 "$@"; }
unpack() { python -m export unpack "$file" "$1" --data "$data" --out "$2"; }
crops=(--joined 0.3 --aimed 0.25 --photos-share 0.33)
teachers=(--teacher runs/d31 --teacher runs/e31 --teacher runs/d25 --teacher runs/e25)

python -m export label --data "$data"
python -m export prior --data "$data" # prints the elevation scale of the last command
unpack 0 runs/d25
unpack 1 runs/e25
unpack 2 runs/c25

# Teachers: 2.5.0's two, further on all places.
for name in d e; do
  train --start "runs/${name}25" --out "runs/${name}31" --crops 338560 --learning-rate 7e-4 --surroundings "${crops[@]}"
done

# What the four answer together, taught to two.
for name in d e; do
  train --start "runs/${name}31" --out "runs/${name}34" --crops 298000 --learning-rate 6e-4 --surroundings --mirrored \
    "${crops[@]}" "${teachers[@]}"
done

train --start runs/c25 --out runs/c34 --crops 298000 --learning-rate 3.6e-4 --only-camera --mirrored "${crops[@]}"

python -m export segments --data "$data" --teacher segments-1.1.0.onnx
python -m export onnx runs/d34 runs/e34 --camera runs/c34 --segments runs/segments --elevation-scale 60 \
  --temperature 0.8 --version 3.0.0 --out "$out"
python -m export suitable "$out" --data "$data"
