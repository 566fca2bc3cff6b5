// SPDX-License-Identifier: Apache-2.0
// What the keyboard does where no text is typed; help.ts lists it.

import type { Mode } from "./state";

export interface KeyActions {
  undo(): void;
  redo(): void;
  hold(original: boolean): void;
  nudge(turn: [number, number], move: [number, number], zoom: number): void;
  fit(): void;
  drawLasso(): void;
  measure(): void;
  open(): void;
  togglePanel(): void;
  screenshot(): void;
  setMode(mode: Mode): void;
  help(): void;
}

const kTurn = 0.08; // radians a key
const kMove = 0.04; // of the distance
const kZoom = 1.15;
const kArrows: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const isTyping = ({ target }: Event) =>
  target instanceof HTMLElement && target.matches("input:not([type=range]):not([type=checkbox]), select, textarea");

/** `canvas` is what arrow keys turn. */
export function listenToKeys(canvas: HTMLElement, actions: KeyActions): void {
  const keys = keyTable(actions);
  window.addEventListener("keydown", (event) => {
    if (isTyping(event) || document.querySelector("dialog[open]")) return;
    const act = event.ctrlKey || event.metaKey ? undoOrRedo(event, actions) : event.altKey ? null : plainKey(event, canvas, keys, actions);
    if (!act) return;
    event.preventDefault();
    act();
  });
  window.addEventListener("keyup", (event) => {
    if (event.key.toLowerCase() === "b") actions.hold(false);
  });
  window.addEventListener("blur", () => actions.hold(false));
}

function undoOrRedo(event: KeyboardEvent, actions: KeyActions): (() => void) | null {
  const key = event.key.toLowerCase();
  if (event.altKey) return null;
  if (key === "z") return event.shiftKey ? actions.redo : actions.undo;
  return key === "y" ? actions.redo : null;
}

function plainKey(event: KeyboardEvent, canvas: HTMLElement, keys: Record<string, () => void>, actions: KeyActions): (() => void) | null {
  const arrow = kArrows[event.key];
  if (!arrow) return keys[event.key.toLowerCase()] ?? null;
  if (event.target !== canvas && event.target !== document.body) return null;
  if (event.shiftKey) return () => actions.nudge([0, 0], [-kMove * arrow[0], kMove * arrow[1]], 1);
  return () => actions.nudge([kTurn * arrow[0], kTurn * arrow[1]], [0, 0], 1);
}

function keyTable(actions: KeyActions): Record<string, () => void> {
  const zoom = (factor: number) => () => actions.nudge([0, 0], [0, 0], factor);
  return {
    "+": zoom(1 / kZoom), "=": zoom(1 / kZoom), "-": zoom(kZoom),
    b: () => actions.hold(true), f: actions.fit, l: actions.drawLasso, m: actions.measure, o: actions.open, p: actions.togglePanel,
    s: actions.screenshot, "?": actions.help,
    "1": () => actions.setMode("after"), "2": () => actions.setMode("wipe"), "3": () => actions.setMode("side"),
    "4": () => actions.setMode("before"),
  };
}
