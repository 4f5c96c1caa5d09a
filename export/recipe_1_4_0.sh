#!/usr/bin/env bash
# Network 1.4.0, from which 2.5.0 goes on: three networks in one file, each the mean of several runs' weights.
# Usage: export/recipe_1_4_0.sh DIR [OUT], with a folder of panoramas and the ONNX file to write.
# Today's code draws other crops from the same seeds: each effect of augmentation has a random stream of its own.
# The first runs had the augmentation of their time, and rare sun elevations had less weight in them.
# The file's metadata (`training`) hold each run's settings and commit, of which bc2e535 stands for one that is lost.
set -euo pipefail
data=${1:?Usage: $0 DIR [OUT]}
out=${2:-runs/outdoor-1.4.0.onnx}

train() { python -m export train --data "$data" "$@"; }
merge() { python -m export merge "$@"; }
more=(--synthetic runs/towns --tune-share 0)
on=("${more[@]}" --learning-rate 4e-4)
both=("${more[@]}" --joined 0.4 --surroundings)
both_on=("${both[@]}" --learning-rate 4e-4)
seen=(--tune-share 0 --only-seen --aimed 0.6 --learning-rate 2e-3 --batch 16 --crops 20000)

python -m export label --data "$data"
python -m export synthesize --count 480

# A. Its first run is that of 1.0.0.
train
train --start runs/outdoor --learning-rate 4e-4 --crops 112000 --out runs/outdoor-1.1
merge runs/outdoor runs/outdoor-1.1 --out runs/outdoor-a
train "${on[@]}" --start runs/outdoor-a --crops 44000 --out runs/outdoor-1.3a
merge runs/outdoor-a runs/outdoor-1.3a --out runs/outdoor-a3
train "${seen[@]}" --start runs/outdoor-a3 --out runs/outdoor-a3-seen

# C.
train "${more[@]}" --crops 112000 --out runs/outdoor-1.3
train "${on[@]}" --start runs/outdoor-1.3 --crops 32000 --out runs/outdoor-1.4c
merge runs/outdoor-1.3 runs/outdoor-1.4c --out runs/outdoor-c3
train "${on[@]}" --start runs/outdoor-c3 --crops 40000 --out runs/outdoor-1.4d
merge runs/outdoor-c3 runs/outdoor-1.4d --out runs/outdoor-c4
train "${seen[@]}" --start runs/outdoor-c4 --out runs/outdoor-c4-seen

# D.
train "${both[@]}" --crops 96000 --out runs/outdoor-1.5
train "${both[@]}" --learning-rate 5e-4 --start runs/outdoor-1.5 --crops 48000 --out runs/outdoor-1.5d
merge runs/outdoor-1.5 runs/outdoor-1.5d --out runs/outdoor-d3
train "${both_on[@]}" --start runs/outdoor-d3 --crops 48000 --out runs/outdoor-1.5e
merge runs/outdoor-d3 runs/outdoor-1.5e --out runs/outdoor-d4
train "${both_on[@]}" --start runs/outdoor-d4 --crops 48000 --out runs/outdoor-1.5f
merge runs/outdoor-d4 runs/outdoor-1.5f --out runs/outdoor-d5
train "${both_on[@]}" --start runs/outdoor-d5 --crops 48000 --out runs/outdoor-1.5g
merge runs/outdoor-d5 runs/outdoor-1.5g --out runs/outdoor-d6
train "${seen[@]}" --start runs/outdoor-d6 --out runs/outdoor-d6-seen

python -m export onnx runs/outdoor-a3-seen runs/outdoor-d6-seen runs/outdoor-c4-seen \
  --temperature 1.04 --version 1.4.0 --out "$out"
