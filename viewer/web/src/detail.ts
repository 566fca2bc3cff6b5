// SPDX-License-Identifier: Apache-2.0
// How much of a cloud a frame draws, learned from how long frames take. While something moves, a slow machine draws a
// coarser picture and then fewer points; once it rests, the whole cloud follows in portions, one a frame, so that a new
// movement is never waited for longer than a frame.

const kFrame = 66; // ms that a frame may take while something moves
const kCoarsest = 0.5; // of the picture's pixels in each direction
const kLeastDrawn = 60000;
const kFirstPortion = 300000; // before anything is known

export class Detail {
  fineness = 1; // of the picture, pixels drawn a pixel of the screen in each direction
  private budget = kFirstPortion; // points a frame while something moves
  private portion = kFirstPortion; // points a frame while the cloud is completed

  /** Points to draw of `count` while something moves. */
  moving(count: number): number {
    return Math.min(count, Math.round(this.budget));
  }

  /** Further points to draw of a picture that is being completed. */
  completing(left: number): number {
    return Math.min(left, Math.round(this.portion));
  }

  /** A frame with `drawn` of `count` points took `time` ms while something moved. */
  learnMoving(drawn: number, count: number, time: number): void {
    if (time > kFrame) {
      const factor = Math.max(0.5, kFrame / time);
      if (this.fineness > kCoarsest) this.fineness = Math.max(kCoarsest, this.fineness * factor);
      else this.budget = Math.max(kLeastDrawn, Math.min(this.budget, drawn) * factor);
    } else if (time < kFrame / 2) {
      if (drawn < count) this.budget *= 1.25;
      else this.fineness = Math.min(1, this.fineness * 1.1);
    }
  }

  /** The same for a portion of a picture that is being completed. */
  learnCompleting(drawn: number, time: number): void {
    if (time > kFrame) this.portion = Math.max(kLeastDrawn, Math.min(this.portion, drawn) * Math.max(0.5, kFrame / time));
    else if (time < kFrame / 2 && drawn >= this.portion) this.portion *= 2;
  }
}
