// Puts a gzipped copy beside each file of the built page that gets smaller by it; the service sends these.
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const dist = new URL("dist/", import.meta.url);

for (const name of readdirSync(dist, { recursive: true })) {
  if (!/\.(html|css|js|svg)$/.test(name)) continue; // pictures and tables are compressed already
  writeFileSync(new URL(`${name}.gz`, dist), gzipSync(readFileSync(new URL(name, dist)), { level: 9 }));
}
