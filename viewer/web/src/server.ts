// SPDX-License-Identifier: Apache-2.0
// The session of `pointfair view`, over a WebSocket and POST.

import type { Given, Listener, Transport } from "./transport";

const kRetry = 1500;

export class Server implements Transport {
  private socket: WebSocket | null = null;
  private readonly token = new URLSearchParams(location.search).get("token");

  constructor(private readonly listener: Listener) {
    this.connect();
  }

  get isOpen(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }
  send(text: string): void {
    if (this.isOpen) this.socket!.send(text);
  }
  cancel(text: string): void {
    this.send(text);
  }

  async open({ file, named }: Given): Promise<void> {
    for (const one of named) await this.post(one, { named: "1" });
    await this.post(file, {});
  }

  private async post(file: File, words: Record<string, string>): Promise<void> {
    const query = new URLSearchParams({ name: file.name, ...words });
    if (this.token) query.set("token", this.token);
    let response: Response;
    try {
      response = await fetch(`/upload?${query}`, { method: "POST", body: file });
    } catch {
      throw new Error(`${file.name} could not be sent.`);
    }
    if (!response.ok) throw new Error(await response.text());
  }

  private connect(): void {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const query = this.token ? `?token=${encodeURIComponent(this.token)}` : "";
    const socket = new WebSocket(`${scheme}//${location.host}/session${query}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.listener.opened();
    socket.onmessage = (event) => this.listener.arrived(event.data as ArrayBuffer);
    socket.onclose = () => {
      this.socket = null;
      if (this.listener.closed()) setTimeout(() => this.connect(), kRetry);
    };
    this.socket = socket;
  }
}
