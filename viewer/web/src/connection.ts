// SPDX-License-Identifier: Apache-2.0
// The WebSocket: one run at a time on its way. Newer parameters wait until the server has shown something for the last
// ones, so that a drag is a row of answers and not a row of cancelled runs; the server then stops what it still does.

import { decode, type Message, type Recipe, type Request } from "./protocol";

const kPatience = 400; // ms without an answer after which newer parameters are sent all the same
const kRetry = 1500;

export interface Asked extends Recipe {
  focus?: number[];
  held: boolean; // the hand still holds the slider
  output: string;
  encoding: string;
}

export class Connection {
  private socket: WebSocket | null = null;
  private ids = 0;
  private waiting: Asked | null = null;
  private answered = true;
  private sent = 0;
  private timer = 0;
  lastRun = 0; // id of the newest run asked for

  constructor(
    private readonly receive: (message: Message) => void,
    private readonly changed: (state: "open" | "closed" | "taken") => void,
  ) {
    this.open();
  }

  run(asked: Asked): void {
    this.waiting = asked;
    this.flush();
  }

  /** True from asking until the whole result is here. */
  get busy(): boolean {
    return this.waiting !== null || this.lastDone !== this.lastRun;
  }
  private lastDone = 0;

  send(request: Request): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }
  nextId(): number {
    return ++this.ids;
  }
  cancel(): void {
    this.waiting = null;
    this.send({ type: "cancel", id: this.nextId() });
  }

  private open(): void {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const token = new URLSearchParams(location.search).get("token");
    const socket = new WebSocket(
      `${scheme}//${location.host}/session${token ? `?token=${encodeURIComponent(token)}` : ""}`,
    );
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.answered = true;
      this.changed("open");
    };
    let taken = false;
    socket.onmessage = (event) => {
      const message = decode(event.data as ArrayBuffer);
      taken ||= message.head.type === "taken";
      this.note(message);
      this.receive(message);
    };
    socket.onclose = () => {
      this.socket = null;
      this.changed(taken ? "taken" : "closed");
      if (!taken) setTimeout(() => this.open(), kRetry); // two pages would take it from each other for ever
    };
    this.socket = socket;
  }

  private note({ head }: Message): void {
    const ends = head.type === "result" || head.type === "error" || head.type === "cancelled";
    if ((head.type === "preview" && !head.more) || ends) this.answered = true;
    if (ends && (head.type !== "result" || head.id === this.lastRun)) this.lastDone = this.lastRun;
    if (head.type === "cloud") {
      this.answered = true;
      this.lastDone = this.lastRun;
    }
    // after the message has been shown
    if (this.waiting) setTimeout(() => this.flush());
  }

  private flush(): void {
    clearTimeout(this.timer);
    if (!this.waiting || this.socket?.readyState !== WebSocket.OPEN) return;
    const age = performance.now() - this.sent;
    if (!this.answered && age < kPatience) {
      this.timer = window.setTimeout(() => this.flush(), kPatience - age);
      return;
    }
    this.lastRun = this.nextId();
    this.send({ type: "run", id: this.lastRun, ...this.waiting });
    this.waiting = null;
    this.answered = false;
    this.sent = performance.now();
  }
}
