/** Arrays of numpy's .npz files: a ZIP of .npy files, each with a header in Python's notation. */

export interface NumberArray {
  shape: number[];
  data: Float32Array;
}

const END = 0x06054b50; // of the ZIP's directory
const ENTRY = 0x02014b50;

/** The float32 arrays of an .npz by their names; throws a TypeError for anything else. */
export async function readNpz(bytes: ArrayBuffer): Promise<Map<string, NumberArray>> {
  const view = new DataView(bytes);
  const arrays = new Map<string, NumberArray>();
  for (const entry of entriesOf(view)) {
    arrays.set(entry.name.replace(/\.npy$/, ""), npy(await contentOf(view, entry)));
  }
  return arrays;
}

interface Entry {
  name: string;
  method: number; // 0 stored, 8 deflated
  size: number; // bytes as stored
  at: number; // of its local header
}

function entriesOf(view: DataView): Entry[] {
  let end = view.byteLength - 22;
  while (end >= 0 && view.getUint32(end, true) !== END) end--;
  if (end < 0) throw new TypeError("This is no ZIP archive.");
  const entries: Entry[] = [];
  let at = view.getUint32(end + 16, true);
  for (let left = view.getUint16(end + 10, true); left > 0 && view.getUint32(at, true) === ENTRY; left--) {
    const length = view.getUint16(at + 28, true);
    entries.push({
      name: new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset + at + 46, length)),
      method: view.getUint16(at + 10, true),
      size: view.getUint32(at + 20, true),
      at: view.getUint32(at + 42, true),
    });
    at += 46 + length + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
  }
  return entries;
}

async function contentOf(view: DataView, { method, size, at }: Entry): Promise<ArrayBuffer> {
  const start = at + 30 + view.getUint16(at + 26, true) + view.getUint16(at + 28, true);
  const stored = view.buffer.slice(view.byteOffset + start, view.byteOffset + start + size) as ArrayBuffer;
  if (method === 0) return stored;
  if (method !== 8) throw new TypeError(`The archive is compressed by method ${method}.`);
  const inflated = new Blob([stored]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Response(inflated).arrayBuffer();
}

function npy(bytes: ArrayBuffer): NumberArray {
  const view = new DataView(bytes);
  const [long, start] = view.getUint8(6) === 1 ? [view.getUint16(8, true), 10] : [view.getUint32(8, true), 12];
  const header = new TextDecoder().decode(new Uint8Array(bytes, start, long));
  const shape = /'shape': \(([\d, ]*)\)/.exec(header)?.[1];
  if (!header.includes("'<f4'") || header.includes("'fortran_order': True") || shape === undefined) {
    throw new TypeError("The array is not float32 in C order.");
  }
  const sides = shape.split(",").filter((side) => side.trim());
  return { shape: sides.map(Number), data: new Float32Array(bytes.slice(start + long)) };
}
