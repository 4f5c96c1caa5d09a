/** The metadata of a file, read in the browser. */

import { exifBlock, isJpeg } from "./pure/container";
import { type Facts, factsOf, isTurned } from "./pure/metadata";

const MOST = 256e6; // bytes that are looked at; photos have fewer
const OPTIONS = { reviveValues: false, translateValues: false };

export async function readFacts(file: Blob): Promise<Facts> {
  try {
    const bytes = new Uint8Array(await file.slice(0, MOST).arrayBuffer());
    const block = exifBlock(bytes);
    if (!block) return {};
    const { parse } = await import("exifr/dist/full.esm.mjs");
    const tags = (await parse(block, OPTIONS)) ?? {};
    return { ...factsOf(tags), ...(isTurned(tags) && !isJpeg(bytes) ? { turned: true } : {}) };
  } catch {
    return { unread: true };
  }
}
