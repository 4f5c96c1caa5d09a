#!/usr/bin/env bash
# Debian sid with Godot 4, Blender 5.2 LTS and a C# compiler in FOLDER, for the tests of scenes.
# Debian, as root, with mmdebstrap; 1.3 GB. The tests find FOLDER by the variable LIGHTING_ENGINES.
set -euo pipefail
folder=${1:?usage: scripts/engines.sh FOLDER}
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}

# Godot renders on the software Vulkan driver of Mesa, in a window of Xvfb.
mmdebstrap --variant=apt --components=main --aptopt='Acquire::Check-Valid-Until "false"' \
  --aptopt='APT::Install-Recommends "false"' --dpkgopt='path-exclude=/usr/share/doc/*' \
  --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
  --include=godot,blender,python3-numpy,python3-cattr,python3-requests,mono-mcs,libegl1,xvfb,xauth,mesa-vulkan-drivers,libgl1-mesa-dri,ca-certificates \
  sid "$folder" "$mirror"

chroot "$folder" godot --version
chroot "$folder" blender --version
