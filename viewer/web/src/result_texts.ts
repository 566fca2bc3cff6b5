// SPDX-License-Identifier: Apache-2.0
// The command and the program that make the shown result's file, which their texts name.

import type { Asked } from "./connection";
import type { Recipe, Result } from "./protocol";
import type { Stage } from "./stage";
import { equalRecipes } from "./state";
import type { Takeaway } from "./takeaway";

type Kind = "command" | "cpp";
const kNames: Record<Kind, string> = { command: "The command", cpp: "The program" };

export class ResultTexts {
  private shown: { result: Result; of: Asked } | null = null;
  private asked: Asked | null = null;
  private wanted: Kind | null = null; // once the result that names the newest file is here

  /** `ask` asks for the result that names the newest file, where that is not on its way. */
  constructor(private readonly takeaway: Takeaway, private readonly stage: Stage, private readonly ask: () => void) {}

  setAsked(asked: Asked): void {
    this.asked = asked;
    this.wanted = null;
  }

  /** null: none is shown. */
  setResult(result: Result | null, of: Asked): void {
    this.shown = result && { result, of };
    if (this.wanted && this.namesNewestFile) this.give(this.wanted);
  }

  /** What belongs to a result that is not there yet says something else. One that only names another file comes at once. */
  take(kind: Kind, recipe: Recipe): void {
    if (!this.shown || !equalRecipes(this.shown.of, recipe)) return this.stage.say("The run has not finished yet.", true);
    if (this.namesNewestFile) return this.give(kind);
    this.ask();
    this.wanted = kind;
  }

  private get namesNewestFile(): boolean {
    return this.shown?.of.output === this.asked?.output && this.shown?.of.encoding === this.asked?.encoding;
  }

  private give(kind: Kind): void {
    this.wanted = null;
    void this.takeaway.copy(this.shown!.result[kind], kNames[kind]);
  }
}
