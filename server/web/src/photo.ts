/** A photo as the page shows it. */

export interface Photo {
  name: string;
  url: string;
  picture: HTMLCanvasElement; // upright, for the stage
}

const LONGEST = 2048; // pixels of the stage's backdrop

/** Decodes a file; null where this browser cannot, as most cannot with HEIC. */
export async function decodePhoto(file: File): Promise<Photo | null> {
  const image = new Image();
  image.src = URL.createObjectURL(file);
  try {
    await image.decode();
  } catch {
    URL.revokeObjectURL(image.src);
    return null;
  }
  return { name: file.name, url: image.src, picture: pictureOf(image) };
}

export function pictureOf(image: HTMLImageElement): HTMLCanvasElement {
  const { naturalWidth: width, naturalHeight: height } = image;
  const scale = Math.min(1, LONGEST / Math.max(width, height));
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(width * scale));
  canvas.height = Math.max(1, Math.round(height * scale));
  canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
  return canvas;
}
