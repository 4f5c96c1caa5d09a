// Prints what a .ktx2 file holds as JSON: its header, and the 16-bit words of each level.
import { readFileSync } from "node:fs";
import { read } from "ktx-parse";

const file = read(new Uint8Array(readFileSync(process.argv[2])));
const levels = file.levels.map(({ levelData }) => [...new Uint16Array(levelData.slice().buffer)]);
console.log(
  JSON.stringify({
    format: file.vkFormat,
    width: file.pixelWidth,
    height: file.pixelHeight,
    faces: file.faceCount,
    descriptor: file.dataFormatDescriptor[0],
    levels,
  }),
);
