// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from "vite";

// Everything from this server: no outside address, nothing inlined that the content security policy would refuse.
export default defineConfig({
  base: "./",
  build: { target: "es2022", assetsInlineLimit: 0, modulePreload: { polyfill: false }, chunkSizeWarningLimit: 1000 },
});
