// Prints what Filament's own loader finds in a .ktx file: format, size, levels, its text, and the words of each level.
const { readFileSync } = require("node:fs");
const { dirname, join } = require("node:path");
const create = require("filament");

const wasm = join(dirname(require.resolve("filament")), "filament.wasm");
create({ wasmBinary: readFileSync(wasm) }).then((module) => {
  Object.assign(create, module).loadClassExtensions();
  const data = readFileSync(process.argv[2]);
  const buffer = new module.driver$BufferDescriptor(data.length);
  buffer.getBytes().set(data);
  const bundle = new module.Ktx1Bundle(buffer);
  const info = bundle.info();
  const levels = [];
  for (let level = 0; level < bundle.getNumMipLevels(); level++) {
    const bytes = bundle.getCubeBlob(level).slice();
    levels.push([...new Uint32Array(bytes.buffer)]);
  }
  const cubemap = bundle.isCubemap();
  const sh = bundle.getMetadata("sh");
  console.log(JSON.stringify({ format: info.glInternalFormat, width: info.pixelWidth, cubemap, sh, levels }));
});
