// SPDX-License-Identifier: Apache-2.0
// What the keys and the pointer do.

import { h } from "./dom";

const kHelp: [string, string][] = [
  ["drag", "turn"], ["right drag, Shift drag", "move"], ["wheel, pinch", "zoom to the pointer"],
  ["double click", "turn about that point"], ["← → ↑ ↓", "turn, if the picture has the focus"], ["Shift ← → ↑ ↓", "move"],
  ["+ −", "zoom"], ["F", "fit"], ["B, held", "show the original"], ["1 2 3 4", "denoised, wipe, side by side, original"],
  ["Ctrl Z, Ctrl Shift Z", "undo, redo"], ["L", "draw a lasso"], ["M", "measure a distance"], ["S", "screenshot"], ["O", "open a file"], ["P", "settings"], ["?", "this list"],
];

export function helpDialog(): HTMLDialogElement {
  const rows = kHelp.flatMap(([keys, what]) => [h("dt", {}, h("kbd", {}, keys)), h("dd", {}, what)]);
  const dialog = h("dialog", { "aria-labelledby": "help-title" }, h("h2", { id: "help-title" }, "Keys and pointer"), h("dl", {}, ...rows),
    h("button", { type: "button", class: "plain primary", onclick: () => dialog.close() }, "Close"));
  return dialog;
}
