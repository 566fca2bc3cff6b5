// SPDX-License-Identifier: Apache-2.0
// When frames are drawn, and how much of the cloud each: while something moves, as much as a frame may take; once it rests,
// all of it, in portions.

import { Detail } from "./detail";

const kRestDelay = 350; // ms

/** What draws. */
export interface Painter {
  /** Points there are. */
  readonly count: number;
  /** Whether it can draw some of them after others; else all at once. */
  readonly drawsPortions: boolean;
  /** Told before each frame. */
  advance(now: number): void;
  /** Empties the image; the screen keeps what it shows. */
  clear(): void;
  /** Draws `count` points into the image, from one on; with the `last` the image goes to the screen. `of`: points of the whole image. */
  paint(from: number, count: number, of: number, fineness: number, last: boolean): void;
  /** Milliseconds that what was painted took, once it is there. */
  finished(): Promise<number>;
}

export class Frames {
  private readonly detail = new Detail();
  private frame = 0;
  private wanted = false; // a frame is
  private unfinished = false; // the last one is not there yet
  private restTimer = 0;
  private restDelay = kRestDelay;
  private changing = false; // something moves
  private drawn: number | null = null; // points in the image that is being completed; null: nothing is
  /** Told when a frame is on the screen. */
  onShown: () => void = () => {};
  /** Told whether the picture is whole, at its finest, and nothing is about to change it. */
  onStill: (still: boolean) => void = () => {};

  /** `onRest` is told when what moved rests. */
  constructor(private readonly painter: Painter, private readonly onRest: () => void) {}

  /** Draws the whole cloud anew, unless something moves. */
  render(): void {
    this.drawn = null;
    this.schedule();
  }

  /** Something moves: a part of the cloud is enough until it rests. */
  touch(): void {
    this.changing = true;
    clearTimeout(this.restTimer);
    this.restTimer = window.setTimeout(() => this.rest(), this.restDelay);
    this.render();
  }

  /** Draws the whole cloud at once. */
  drawWhole(): void {
    this.drawNow(this.painter.count, 1);
  }

  /** Draws as much as a frame may take. */
  drawQuickly(): void {
    this.drawNow(this.detail.moving(this.painter.count), this.detail.fineness);
  }

  private rest(): void {
    this.changing = false;
    this.restDelay = kRestDelay;
    this.render();
    this.onRest();
  }

  // A frame begins when the one before is there: frames in a queue would show what is past.
  private schedule(): void {
    this.wanted = true;
    if (!this.frame && !this.unfinished) this.frame = requestAnimationFrame((now) => void this.next(now));
    this.tellStill();
  }

  private tellStill(): void {
    this.onStill(!this.wanted && !this.unfinished && !this.changing);
  }

  private async next(now: number): Promise<void> {
    this.frame = 0;
    this.wanted = false;
    this.unfinished = true;
    this.painter.advance(now);
    if (this.changing) await this.drawMoving();
    else await this.drawPortion();
    this.unfinished = false;
    if (this.wanted) this.schedule();
    this.tellStill();
  }

  private async drawMoving(): Promise<void> {
    const { count } = this.painter;
    const drawn = this.detail.moving(count);
    this.drawNow(drawn, this.detail.fineness);
    const time = await this.painter.finished();
    if (count) this.detail.learnMoving(drawn, count, time);
    this.restDelay = Math.max(kRestDelay, 2 * time);
    this.onShown();
  }

  // The screen keeps what it shows until the image is complete.
  private async drawPortion(): Promise<void> {
    const { count, drawsPortions } = this.painter;
    if (this.drawn === null) this.painter.clear();
    const from = this.drawn ?? 0;
    const portion = drawsPortions ? this.detail.completing(count - from) : count - from;
    const complete = from + portion >= count;
    this.drawn = from + portion;
    this.painter.paint(from, portion, count, 1, complete);
    if (!complete) this.schedule();
    const time = await this.painter.finished();
    if (drawsPortions) this.detail.learnCompleting(portion, time);
    if (complete) this.onShown();
  }

  private drawNow(count: number, fineness: number): void {
    this.drawn = null; // of what is in the image
    this.painter.clear();
    this.painter.paint(0, count, count, fineness, true);
  }
}
