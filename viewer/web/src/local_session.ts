// SPDX-License-Identifier: Apache-2.0
// The session in a worker of this browser: pointfair as WebAssembly (module_worker.ts). A run cannot be interrupted there, so
// what must not wait for it ends the worker; a new one reads the file again, unseen.

import { decode } from "./protocol";
import type { Given, Listener, Transport } from "./transport";

const kMostBytes = 1 << 30; // of a file; addresses have 32 bits, and there are copies

/** What the page tells its worker. */
export type Order =
  | { module: WebAssembly.Module }
  | { greet: true }
  | { text: string }
  | { file: ArrayBuffer; name: string; named: boolean }; // by the scan that comes next

/** What the worker tells its page; anything else is a message of the session. */
export type Notice = { busy: boolean } | { failed: string };

// Lets the service worker (offline.ts) keep what the page consists of. Where a page may have none, it needs its network.
async function keepForLater(): Promise<void> {
  if (!("serviceWorker" in navigator)) return;
  await navigator.serviceWorker.register(new URL("./offline.js", document.baseURI));
  if (!navigator.serviceWorker.controller)
    await new Promise((resolve) => navigator.serviceWorker.addEventListener("controllerchange", resolve, { once: true }));
  const used = performance.getEntriesByType("resource").map(({ name }) => name);
  await Promise.all([location.pathname, "./icon.svg", "./module_worker.js", ...used].map((name) => fetch(name)));
  document.body.dataset.offline = "true";
}

export class LocalSession implements Transport {
  isOpen = false;
  private module: WebAssembly.Module | null = null;
  private worker: Worker | null = null;
  private busy = false; // an order is on its way, or a step
  private unseen = false; // until the cloud is read again
  private shown: Given | null = null; // the cloud that the page has
  private coming: Given | null = null;

  constructor(private readonly listener: Listener) {
    void this.load();
  }

  send(text: string): void {
    this.order({ text });
  }

  cancel(text: string): void {
    if (this.busy) void this.restart().then(() => this.send(text));
    else this.send(text);
  }

  async open(scan: Given): Promise<void> {
    const { file } = scan;
    if (file.size > kMostBytes)
      throw new Error(`${file.name} is larger than 1 GiB, which this page cannot hold: install pointfair, whose viewer and program can`);
    if (!this.module) throw new Error("pointfair is still loading; try again");
    if (this.busy) await this.restart();
    await this.read(scan);
    this.coming = scan;
  }

  private async load(): Promise<void> {
    try {
      this.module = await WebAssembly.compileStreaming(fetch(new URL("./pointfair.wasm", document.baseURI)));
      this.start();
      this.isOpen = true;
      this.listener.opened();
      this.order({ greet: true });
      void keepForLater().catch(() => undefined);
    } catch (error) {
      this.listener.failed(`pointfair could not be loaded: ${String(error)}; reload the page`);
    }
  }

  private start(): void {
    this.worker?.terminate();
    const worker = new Worker(new URL("./module_worker.js", document.baseURI), { type: "module" });
    this.worker = worker;
    worker.onmessage = ({ data }: MessageEvent<ArrayBuffer | Notice>) => {
      if (worker !== this.worker) return; // sent before it was ended
      if (data instanceof ArrayBuffer) this.arrived(data);
      else if ("busy" in data) this.busy = data.busy;
      else this.broke(data.failed);
    };
    worker.onerror = (event) => this.broke(event.message);
    this.order({ module: this.module! });
  }

  private async restart(): Promise<void> {
    this.start();
    if (!this.shown) return;
    this.unseen = true;
    await this.read(this.shown);
  }

  private async read({ file, named }: Given): Promise<void> {
    for (const one of named) await this.give(one, true);
    await this.give(file, false);
  }

  private async give(file: File, named: boolean): Promise<void> {
    let bytes: ArrayBuffer;
    try {
      bytes = await file.arrayBuffer();
    } catch {
      throw new Error(`${file.name} cannot be read; was it changed or removed?`);
    }
    this.order({ file: bytes, name: file.name, named }, [bytes]);
  }

  private order(order: Order, moved: Transferable[] = []): void {
    this.busy = true;
    this.worker?.postMessage(order, moved);
  }

  private arrived(frame: ArrayBuffer): void {
    const { type } = decode(frame).head;
    const passed = !this.unseen || type === "error";
    if (type === "cloud") {
      if (!this.unseen) this.shown = this.coming ?? this.shown;
      this.unseen = false;
      this.coming = null;
    }
    if (passed) this.listener.arrived(frame);
  }

  // The module cannot go on: memory ran out where nothing can say so, or it has a fault.
  private broke(words: string): void {
    this.coming = null;
    void this.restart().catch(() => undefined);
    this.listener.failed(`pointfair stopped (${words}); it started again. Try fewer points, or install pointfair`);
  }
}
