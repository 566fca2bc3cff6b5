// SPDX-License-Identifier: Apache-2.0
// What is asked of the session: one run at a time on its way. Newer parameters wait until the server has shown something for the last
// ones, so that a drag is a row of answers and not a row of cancelled runs; the server then stops what it still does.

import { decode, type Message, type Recipe, type Request } from "./protocol";
import { LocalSession } from "./local_session";
import { Server } from "./server";
import type { Given, Listener, Transport } from "./transport";

/** Whether files, runs and results stay in this browser: the build decides (vite.config.js). */
export const kIsLocal = import.meta.env.MODE === "serverless";

const startTransport = (listener: Listener): Transport => (kIsLocal ? new LocalSession(listener) : new Server(listener));

const kPatience = 400; // ms without an answer after which newer parameters are sent all the same

export interface Asked extends Recipe {
  focus?: number[];
  held: boolean; // the hand still holds the slider
  output: string;
  encoding: string;
}

export class Connection {
  private readonly transport: Transport;
  private taken = false; // by another page; two would take it from each other for ever
  private ids = 0;
  private waiting: Asked | null = null;
  private answered = true;
  private sent = 0;
  private timer = 0;
  private readonly runs = new Map<number, Asked>(); // by id, from the one with the newest result on
  lastRun = 0; // id of the newest run asked for

  constructor(
    private readonly receive: (message: Message) => void,
    private readonly changed: (state: "open" | "closed" | "taken") => void,
  ) {
    this.transport = startTransport({
      opened: () => {
        this.answered = true;
        this.taken = false;
        this.changed("open");
      },
      arrived: (frame) => this.take(decode(frame)),
      failed: (words) => this.take({ head: { type: "error", id: this.busy ? this.lastRun : null, message: words }, arrays: {} }),
      closed: () => {
        this.changed(this.taken ? "taken" : "closed");
        return !this.taken;
      },
    });
  }

  run(asked: Asked): void {
    this.waiting = asked;
    this.flush();
  }

  /** What a run was asked with, by its id: a result may come when newer parameters have been asked for. */
  askedBy(id: number): Asked | undefined {
    return this.runs.get(id);
  }

  /** True from asking until the whole result is here. */
  get busy(): boolean {
    return this.waiting !== null || this.lastDone !== this.lastRun;
  }
  private lastDone = 0;

  send(request: Request): void {
    this.transport.send(JSON.stringify(request));
  }
  nextId(): number {
    return ++this.ids;
  }
  cancel(): void {
    this.waiting = null;
    this.transport.cancel(JSON.stringify({ type: "cancel", id: this.nextId() } satisfies Request));
  }

  /** Gives a scan to the session, which answers with its cloud or an error. Throws with why it cannot be given. */
  open(scan: Given): Promise<void> {
    return this.transport.open(scan);
  }

  private take(message: Message): void {
    this.taken ||= message.head.type === "taken";
    this.note(message);
    this.receive(message);
  }

  private note({ head }: Message): void {
    // other requests fail beside a run, which goes on
    const ends = head.type === "result" || head.type === "cancelled" || (head.type === "error" && head.id !== null && this.runs.has(head.id));
    if ((head.type === "preview" && !head.more) || ends) this.answered = true;
    if (ends && head.id! >= this.lastRun) this.lastDone = this.lastRun;
    if (head.type === "result") for (const id of this.runs.keys()) if (id < head.id) this.runs.delete(id);
    if (head.type === "cloud") {
      this.answered = true;
      this.lastDone = this.lastRun;
    }
    // after the message has been shown
    if (this.waiting) setTimeout(() => this.flush());
  }

  private flush(): void {
    clearTimeout(this.timer);
    if (!this.waiting || !this.transport.isOpen) return;
    const age = performance.now() - this.sent;
    if (!this.answered && age < kPatience) {
      this.timer = window.setTimeout(() => this.flush(), kPatience - age);
      return;
    }
    this.lastRun = this.nextId();
    this.send({ type: "run", id: this.lastRun, ...this.waiting });
    this.runs.set(this.lastRun, this.waiting);
    this.waiting = null;
    this.answered = false;
    this.sent = performance.now();
  }
}
