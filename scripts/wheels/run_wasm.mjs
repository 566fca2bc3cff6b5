#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
// Runs a program of WebAssembly with the files and the environment of this process: run_wasm.mjs PROGRAM.wasm WORDS...
// Paths among the words begin with a slash: such a program has no current folder.
import { readFileSync } from "node:fs";

process.removeAllListeners("warning"); // node:wasi says on every start that it is experimental
process.on("warning", (warning) => warning.name === "ExperimentalWarning" || console.error(warning));
const { WASI } = await import("node:wasi");

const [program, ...words] = process.argv.slice(2);
const system = new WASI({
  version: "preview1", args: [program, ...words], env: { ...process.env, PWD: process.cwd() }, preopens: { "/": "/" }, returnOnExit: true,
});
const module = await WebAssembly.compile(readFileSync(program));
process.exitCode = system.start(await WebAssembly.instantiate(module, system.getImportObject()));
