// Which of a folder's EXR files three.js, parse-exr and exrs open: node --input-type=module - FOLDER < exr_readers.mjs
import fs from 'node:fs';
import path from 'node:path';
import { createRequire } from 'node:module';
import { pathToFileURL } from 'node:url';

const folder = process.argv.at(-1);
const files = fs.readdirSync(folder).filter((name) => name.endsWith('.exr')).sort();
const load = (name) => import(pathToFileURL(createRequire(path.resolve('_')).resolve(name)));
const bytes = (name) => Uint8Array.from(fs.readFileSync(path.join(folder, name))).buffer;

async function readers() {
  const three = await load('three');
  const { EXRLoader } = await load('three/examples/jsm/loaders/EXRLoader.js');
  const parse = await load('parse-exr');
  const exrs = await load('exrs');
  await exrs.init();
  const parseExr = parse.default?.default ?? parse.default;
  return {
    [`three.js r${three.REVISION}`]: (data) => new EXRLoader().setDataType(three.FloatType).parse(data).data,
    'parse-exr': (data) => parseExr(data, three.FloatType).data,
    exrs: (data) => exrs.decodeRgbExr(new Uint8Array(data)).interleavedRgbPixels,
  };
}

console.warn = console.error = () => {};
for (const [name, read] of Object.entries(await readers())) {
  const wanted = read(bytes('NO.exr'));
  const same = (pixels) => pixels.every((value, i) => Math.abs(value - wanted[i]) <= 0.3 * wanted[i]);
  const opened = files.filter((file) => {
    try {
      return same(read(bytes(file)));
    } catch {
      return false;
    }
  });
  const list = (names) => names.map((file) => file.slice(0, -4)).join(', ');
  console.log(`${name}: opened ${list(opened)}; not ${list(files.filter((file) => !opened.includes(file)))}`);
}
