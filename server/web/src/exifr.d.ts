declare module "exifr/dist/full.esm.mjs" {
  export function parse(
    file: Uint8Array,
    options: Record<string, unknown>,
  ): Promise<Record<string, unknown> | undefined>;
}
