// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from "vite";

// The mode "serverless" makes the page that has its session in a worker: what serves it sets no headers.
const kPolicy = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self'; " +
  "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'";
const policy = {
  name: "policy",
  transformIndexHtml: () => [{ tag: "meta", attrs: { "http-equiv": "Content-Security-Policy", content: kPolicy }, injectTo: "head-prepend" }],
};
const kWorkers = ["module_worker", "offline"];
const withWorkers = {
  input: ["index.html", ...kWorkers.map((name) => `src/${name}.ts`)],
  output: { entryFileNames: ({ name }) => (kWorkers.includes(name) ? "[name].js" : "assets/[name]-[hash].js") },
};

// Everything from this server: no outside address, nothing inlined that the content security policy would refuse.
export default defineConfig(({ mode }) => ({
  base: "./",
  plugins: mode === "serverless" ? [policy] : [],
  build: {
    target: "es2022", assetsInlineLimit: 0, modulePreload: { polyfill: false }, chunkSizeWarningLimit: 1000,
    rollupOptions: mode === "serverless" ? withWorkers : {},
  },
}));
