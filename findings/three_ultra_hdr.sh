#!/usr/bin/env bash
# three.js' UltraHDRLoader refuses an Ultra HDR photo whose gain map is told by ISO 21496-1 alone, which it says it reads.
#
# Seen on 2026-11-28 with three 0.187.0 of npm and Pillow 12.0.0 of PyPI (Python 3.11, Node 20, Linux x86-64).
# Guessed before: it reads both kinds, by ISO and by XMP, as its comment says.
# Seen: by XMP the photo gets as far as the decoding of pictures, which Node cannot do. By ISO it is "Not a valid UltraHDR
# image": the loader looks for the segment's name two bytes before it, so that it finds none.
#
# Usage: findings/three_ultra_hdr.sh; PYTHON names a Python of 3.11 to 3.14. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > make.py <<'PY'
import io
import struct

from PIL import Image


def segment(marker, data):
    return bytes([0xFF, marker]) + struct.pack(">H", 2 + len(data)) + data


def jpeg(size, *segments):
    file = io.BytesIO()
    Image.new("RGB", size, (120, 130, 140)).save(file, "JPEG")
    return file.getvalue()[:2] + b"".join(segments) + file.getvalue()[2:]


def mpf(first, offset, second):
    """Two pictures of such sizes, the second so far behind this segment's own start."""
    head = b"MM\0\x2a" + struct.pack(">IH", 8, 3) + struct.pack(">HHI4s", 0xB000, 7, 4, b"0100")
    head += struct.pack(">HHII", 0xB001, 4, 1, 2) + struct.pack(">HHIII", 0xB002, 7, 32, 50, 0)
    entries = struct.pack(">IIIHH", 0x030000, first, 0, 0, 0) + struct.pack(">IIIHH", 0, second, offset, 0, 0)
    return segment(0xE2, b"MPF\0" + head + entries)


def photo(name, base_segment, map_segment):
    gain_map = jpeg((16, 12), map_segment)
    place = 2 + len(base_segment) + 8  # of the header of MPF, from which offsets count
    size = len(jpeg((64, 48), base_segment, mpf(0, 0, 0)))
    open(name, "wb").write(jpeg((64, 48), base_segment, mpf(size, size - place, len(gain_map))) + gain_map)


rationals = [(0, 1), (2, 1), (0, 1), (2, 1), (1, 1), (1, 64), (1, 64)]  # headrooms, least, most, gamma, offsets
numbers = b"".join(struct.pack(">iI", *pair) for pair in rationals)
iso = b"urn:iso:std:iso:ts:21496:-1\0" + struct.pack(">HH", 0, 0)
photo("iso.jpg", segment(0xE2, iso), segment(0xE2, iso + b"\x40" + numbers))

values = 'GainMapMin="0" GainMapMax="2" Gamma="1" OffsetSDR="0.015625" OffsetHDR="0.015625" HDRCapacityMin="0" HDRCapacityMax="2"'
names = " ".join(f"hdrgm:{pair}" for pair in ['Version="1.0"', *values.split()])
xmp = '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description '
xmp += f'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" {names}/></rdf:RDF></x:xmpmeta>'
packet = segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + xmp.encode())
photo("xmp.jpg", packet, packet)
PY
cat > check.mjs <<'JS'
import { readFileSync } from "node:fs";
import { UltraHDRLoader } from "three/addons/loaders/UltraHDRLoader.js";

globalThis.DOMParser = class {
  parseFromString(text) {
    const attributes = Object.fromEntries([...text.matchAll(/(hdrgm:\w+)="([^"]*)"/g)].map((found) => [found[1], found[2]]));
    const element = { getAttribute: (name) => attributes[name] ?? null };
    return { getElementsByTagName: (name) => (name === "rdf:Description" ? [element] : []) };
  }
};
function refusal(name) {
  const data = readFileSync(name);
  try {
    new UltraHDRLoader().parse(data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength), () => {});
    return "none";
  } catch (error) {
    return error.message;
  }
}
const [iso, xmp] = ["iso.jpg", "xmp.jpg"].map(refusal);
console.log(`ISO: ${iso}\nXMP: ${xmp}`);
process.exit(iso.includes("Not a valid UltraHDR image") && !xmp.includes("Not a valid") ? 0 : 1);
JS
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pillow==12.0.0
venv/bin/python make.py
npm install --silent --no-audit --no-fund three@0.187.0
node check.mjs
