// SPDX-License-Identifier: Apache-2.0
// What the program has to say of the result: why it may not be what it seems.

import { h } from "./dom";

const kNarrow = "(max-width: 760px)"; // as in style.css; there the sentences would hide the picture

export class Notes {
  private readonly title = h("summary", {});
  private readonly list = h("ul", {});
  private readonly folded = h("details", { open: !matchMedia(kNarrow).matches }, this.title, this.list);
  readonly element = h("div", { class: "notes", role: "status", hidden: true }, this.folded);

  /** Of the result that is shown; none: nothing is. What the user folded stays folded. */
  show(notes: string[]): void {
    this.element.hidden = notes.length === 0;
    const items = [...this.list.children].map((item) => item.textContent);
    if (JSON.stringify(items) === JSON.stringify(notes)) return; // a screen reader says each change
    this.title.replaceChildren(notes.length === 1 ? "1 note on this result" : `${notes.length} notes on this result`);
    this.list.replaceChildren(...notes.map((note) => h("li", {}, note)));
  }
}
