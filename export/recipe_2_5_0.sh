#!/usr/bin/env bash
# Network 2.5.0: D and E answer together, and a network of its own for the camera. All three go on from 1.4.0.
# Usage: export/recipe_2_5_0.sh DIR FILE [OUT], with a folder of panoramas, outdoor-1.4.0.onnx and the file to write.
# FILE: git show b32343d0^:lighting/data/outdoor-1.4.0.onnx > outdoor-1.4.0.onnx, or recipe_1_4_0.sh.
#
# Not to the bit: today's code draws other crops from the same seeds, since each effect of augmentation has a random
# stream of its own. Up to 2.4.2 the whole path of --start decided which crops were drawn, since then its last name;
# the folder from which E's last run started was named e178h. In crops of two places the light around the second had
# the exposure of the first. E's last run alone keeps the colours of its crops: their white balance spreads by 2.5 %,
# before by 10 %. Where a run was gone, its network was read back from that version's file by `unpack`.
# The history lacks three commits that the file's metadata name, all of D: d268d27, 05290c0 and 59ec2a0.
#
# On two cores D's run took 64 minutes, with MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=100000000000
# MALLOC_TOP_PAD_=1000000000 in the environment; otherwise glibc nearly doubles the time.
set -euo pipefail
data=${1:?Usage: $0 DIR FILE [OUT]}
file=${2:?Usage: $0 DIR FILE [OUT]}
out=${3:-runs/outdoor-2.5.0.onnx}

train() { python -m export train --data "$data" "$@"; }
merge() { python -m export merge "$@"; }
on=(--learning-rate 5e-4 --tune-share 0 --version 2.5.0)
sun=("${on[@]}" --joined 0.3 --aimed 0.25 --surroundings --photos-share 0.18)
towns=(--synthetic runs/towns --synthetic-share 0.15)
camera=(--tune-share 0 --version 2.5.0 --only-camera --joined 0.1)

python -m export label --data "$data"
python -m export prior --data "$data" # prints the elevation scale of the last command
python -m export synthesize --count 380

# D, which is network 1 of the file.
python -m export unpack "$file" 1 --data "$data" --out runs/d
train --start runs/d --out runs/d2 --crops 44000 "${sun[@]}"

# E, from C, which is network 2 of the file. Heads that did not ship begin with random weights.
python -m export unpack "$file" 2 --data "$data" --out runs/c
train --start runs/c --out runs/e1 --crops 40000 "${sun[@]}"
train --start runs/e1 --out runs/e2 --crops 48000 "${sun[@]}"
train --start runs/e2 --out runs/e3 --crops 48000 "${sun[@]}"
merge runs/e2 runs/e3 --out runs/e4
train --start runs/e4 --out runs/e5 --crops 48000 "${sun[@]}"
merge runs/e4 runs/e5 --out runs/e6
train --start runs/e6 --out runs/e7 --crops 48000 "${sun[@]}" "${towns[@]}"
merge runs/e6 runs/e7 --out runs/e8
train --start runs/e8 --out runs/e9 --crops 36000 "${sun[@]}" "${towns[@]}"
merge runs/e8 runs/e9 --out runs/e10
train --start runs/e10 --out runs/e11 --crops 72000 "${sun[@]}" "${towns[@]}"
merge runs/e10 runs/e11 --out runs/e12
train --start runs/e12 --out runs/e13 --crops 84000 "${sun[@]}" "${towns[@]}"
train --start runs/e13 --out runs/e15 --crops 84000 "${sun[@]}" "${towns[@]}"
train --start runs/e15 --out runs/e17 --crops 84000 "${sun[@]}" "${towns[@]}"
train --start runs/e17 --out runs/e18 --crops 84000 "${sun[@]}" "${towns[@]}"
merge runs/e17 runs/e18 --out runs/e19
train --start runs/e19 --out runs/e20 --crops 60000 "${sun[@]}" "${towns[@]}"

# The camera, from C, too.
train --start runs/c --out runs/c2 --crops 48000 "${camera[@]}" --aimed 0.1 --learning-rate 6e-4
train --start runs/c2 --out runs/c3 --crops 48000 "${camera[@]}" --learning-rate 5e-4
train --start runs/c3 --out runs/c4 --crops 48000 "${camera[@]}" --aimed 0.1 --learning-rate 5e-4
train --start runs/c4 --out runs/c5 --crops 36000 "${camera[@]}" --aimed 0.1 --learning-rate 4e-4
merge runs/c4 runs/c5 --out runs/c6

python -m export onnx runs/d2 runs/e20 --camera runs/c6 --elevation-scale 75 --temperature 0.76 --version 2.5.0 \
  --out "$out"
python -m export suitable "$out" --data "$data"

# Constants that the package has by this network; `fit ground` also takes --seen, by a network that knows fewer places.
for name in sky-color ground sun-power sun-color; do
  python -m export fit "$name" --data "$data" --model "$out"
done

# The network as in CVPR 2017, for comparison.
train --network cvpr2017 --crops 64000 --tune-share 0 --version 2.3.0
python -m export onnx runs/cvpr2017
