/** The metadata of a file, read in the browser; nothing where there are none that can be read. */

import { type Facts, factsOf } from "./pure/facts";

export async function readFacts(file: Blob): Promise<Facts> {
  try {
    const { parse } = await import("exifr/dist/lite.esm.mjs");
    return factsOf((await parse(file, { reviveValues: false, translateValues: false })) ?? {});
  } catch {
    return {};
  }
}
