// SPDX-License-Identifier: Apache-2.0
// What the build puts in (vite.config.js): the mode "serverless" makes the page without a server.
interface ImportMeta {
  readonly env: { readonly MODE: string };
  readonly url: string;
}
