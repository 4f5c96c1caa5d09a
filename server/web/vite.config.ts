import { defineConfig } from "vite";

const folder = new URL(".", import.meta.url).pathname.replace(/\/$/, "");
const repository = new URL("../..", import.meta.url).pathname;

export default defineConfig({
  base: "./", // also behind a proxy's prefix
  build: {
    target: "es2022",
    assetsInlineLimit: 0, // the page's Content-Security-Policy wants files
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 2000, // Swagger UI at /docs; three.js is 800, loaded when the first photo has its answer
    rollupOptions: { input: [`${folder}/index.html`, `${folder}/docs.html`] },
  },
  server: { fs: { allow: [repository] }, proxy: { "/v1": "http://127.0.0.1:8000" } },
});
