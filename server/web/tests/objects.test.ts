import { describe, expect, it } from "vitest";
import { createShape, heightAboveOrigin, readModel } from "../src/scene/objects";

function joinBytes(...parts: (string | Uint8Array)[]): Uint8Array<ArrayBuffer> {
  const bytes = parts.map((part) => (typeof part === "string" ? new TextEncoder().encode(part) : part));
  return Uint8Array.from(bytes.flatMap((part) => [...part]));
}

/** A .glb of one triangle, x and y as long as stated, turned by a quaternion. */
function triangle(x: number, y: number, rotation = [0, 0, 0, 1]): File {
  const points = new Uint8Array(Float32Array.of(0, 0, 0, x, 0, 0, 0, y, 0).buffer);
  const text = JSON.stringify({
    ...{ asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0, rotation }] },
    ...{ meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }], buffers: [{ byteLength: points.length }] },
    bufferViews: [{ buffer: 0, byteLength: points.length }],
    accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", max: [x, y, 0], min: [0, 0, 0] }],
  });
  const json = text.padEnd(Math.ceil(text.length / 4) * 4);
  const words = (...values: number[]): Uint8Array => new Uint8Array(Uint32Array.from(values).buffer);
  const chunks = [words(json.length, 0x4e4f534a), json, words(points.length, 0x004e4942), points] as const;
  const whole = joinBytes("glTF", words(2, 12 + joinBytes(...chunks).length), ...chunks);
  return new File([whole], "triangle.glb");
}

describe("an object's height at radius 1", () => {
  it("is that of its shape", () => {
    expect(heightAboveOrigin(createShape("sphere"))).toBeCloseTo(2);
    expect(heightAboveOrigin(createShape("box"))).toBeCloseTo(1.4);
  });

  it("is its own where another side is the longest", async () => {
    expect(heightAboveOrigin(await readModel(triangle(4, 1)))).toBeCloseTo(0.5);
    expect(heightAboveOrigin(await readModel(triangle(1, 4)))).toBeCloseTo(2);
  });

  it("is that of the vertices, not of a box turned with them", async () => {
    const eighth = [0, 0, Math.sin(Math.PI / 8), Math.cos(Math.PI / 8)]; // of a turn, about the view's axis
    const height = heightAboveOrigin(await readModel(triangle(1, 1, eighth)));
    expect(height).toBeCloseTo(1); // both legs rise to 0.707 and reach 1.414 across
  });
});
