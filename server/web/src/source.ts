/** Where photos come from, and how they get into the page's memory. */

import { exampleFile } from "./api";

/** A photo before it is read. */
export interface Source {
  name: string;
  load: (signal: AbortSignal) => Promise<File>;
}

const MOST = 256e6; // bytes that are kept; the service takes fewer and says so

/** A file that the user chose. */
export const chosen = (file: File): Source => ({ name: file.name, load: () => kept(file) });

/** A photo that the page has already. */
export const held = (file: File): Source => ({ name: file.name, load: () => Promise.resolve(file) });

/** One of the page's own photos, which the service holds. */
export const example = (name: string, url: string): Source => ({
  name,
  load: async (signal) => new File([await exampleFile(url, signal)], name, { type: "image/jpeg" }),
});

/** The same file in memory: a browser sends no file that was changed or moved on its disk after it was chosen. */
async function kept(file: File): Promise<File> {
  if (file.size > MOST) return file;
  try {
    return new File([await file.arrayBuffer()], file.name, { type: file.type });
  } catch {
    throw new Error(`${file.name} cannot be read: it is a folder, or was changed or moved. Choose it once more.`);
  }
}
