// SPDX-License-Identifier: Apache-2.0
// The worker that holds pointfair as WebAssembly. It passes orders of the page to the module (viewer/module.cpp), lets it work
// in steps, and hears what came meanwhile between two steps.

import type { Notice, Order } from "./local_session";

interface Module {
  memory: WebAssembly.Memory;
  _initialize(): void;
  allocate(size: number): number;
  greet(): void;
  open(bytes: number, size: number, name: number, nameSize: number, named: number): void;
  receive(text: number, size: number): void;
  step(): number;
}

const scope = self as unknown as { postMessage(message: unknown, moved?: Transferable[]): void };
const tell = (notice: Notice) => scope.postMessage(notice);
const turns = new MessageChannel(); // its messages queue behind the page's
let timer = 0;
let module: Module;

const kNoFile = 8; // errno of WASI: bad file descriptor
const view = () => new DataView(module.memory.buffer);

// The module asks its system for little: there are no files, no arguments and no environment.
const system: Record<string, (...words: never[]) => number> = {
  clock_time_get: (clock: number, _precision: bigint, out: number) => {
    const now = clock === 0 ? Date.now() : performance.now();
    view().setBigUint64(out, BigInt(Math.round(now * 1e6)), true);
    return 0;
  },
  random_get: (out: number, size: number) => {
    crypto.getRandomValues(new Uint8Array(module.memory.buffer, out, size));
    return 0;
  },
  environ_sizes_get: (count: number, size: number) => {
    view().setUint32(count, 0, true);
    view().setUint32(size, 0, true);
    return 0;
  },
  environ_get: () => 0,
  proc_exit: (code: number) => {
    throw new Error(`it ended with ${code}`);
  },
};

function importsOf(compiled: WebAssembly.Module): WebAssembly.Imports {
  const send = (bytes: number, size: number) => {
    const frame = module.memory.buffer.slice(bytes, bytes + size);
    scope.postMessage(frame, [frame]);
  };
  const names = WebAssembly.Module.imports(compiled).filter((one) => one.module !== "page").map(({ name }) => name);
  return {
    page: { send },
    wasi_snapshot_preview1: Object.fromEntries(names.map((name) => [name, system[name] ?? (() => kNoFile)])),
  };
}

function given(bytes: Uint8Array): [number, number] {
  const at = module.allocate(bytes.length);
  if (at === 0) throw new Error("out of memory");
  new Uint8Array(module.memory.buffer, at, bytes.length).set(bytes);
  return [at, bytes.length];
}

function obey(order: Order): void {
  if ("module" in order) {
    module = new WebAssembly.Instance(order.module, importsOf(order.module)).exports as unknown as Module;
    module._initialize();
  } else if ("greet" in order) {
    module.greet();
  } else if ("file" in order) {
    module.open(...given(new Uint8Array(order.file)), ...given(new TextEncoder().encode(order.name)), Number(order.named));
  } else {
    module.receive(...given(new TextEncoder().encode(order.text)));
  }
}

function turn(): void {
  clearTimeout(timer);
  tell({ busy: true });
  const wait = module.step();
  tell({ busy: wait === 0 });
  if (wait === 0) turns.port2.postMessage(null);
  if (wait > 0) timer = self.setTimeout(() => turns.port2.postMessage(null), wait);
}

function guarded(act: () => void): void {
  try {
    act();
  } catch (error) {
    tell({ failed: error instanceof Error ? error.message : "out of memory" });
  }
}

turns.port1.onmessage = () => guarded(turn);
self.onmessage = ({ data }: MessageEvent<Order>) =>
  guarded(() => {
    obey(data);
    turns.port2.postMessage(null);
  });
