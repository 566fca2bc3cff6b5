// SPDX-License-Identifier: Apache-2.0
// Elements in one call each.

type Child = Node | string | null;
type Properties = Record<string, unknown>;

/** An element: `on...` are listeners, `class`, `aria-...` and the like attributes, the rest properties. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Properties = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value as EventListener);
    else if (name in element && !name.includes("-")) (element as unknown as Properties)[name] = value;
    else if (value !== undefined && value !== false) element.setAttribute(name, String(value));
  }
  element.append(...children.filter((child): child is Node | string => child !== null));
  return element;
}

/** An icon of 20 units, drawn in lines. */
export function icon(path: string): SVGSVGElement {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 20 20");
  svg.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
  line.setAttribute("d", path);
  svg.append(line);
  return svg;
}

export function iconButton(label: string, path: string, act: () => void, key = ""): HTMLButtonElement {
  const title = key ? `${label} (${key})` : label;
  return h("button", { class: "icon", type: "button", title, "aria-label": label, onclick: act }, icon(path));
}

/** One of several, as a row of buttons with arrow keys. */
export function choice<T extends string>(
  label: string,
  options: [T, string][],
  pick: (value: T) => void,
): { element: HTMLElement; set(value: T): void } {
  const buttons = options.map(([value, text]) =>
    h("button", { type: "button", role: "radio", onclick: () => choose(value) }, text),
  );
  const element = h("div", { class: "choice", role: "radiogroup", "aria-label": label }, ...buttons);
  const set = (value: T) =>
    options.forEach(([other], i) => {
      buttons[i].setAttribute("aria-checked", String(other === value));
      buttons[i].tabIndex = other === value ? 0 : -1;
    });
  const choose = (value: T) => {
    set(value);
    pick(value);
  };
  element.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const now = buttons.findIndex((button) => button.tabIndex === 0);
    const next = (now + step + options.length) % options.length;
    choose(options[next][0]);
    buttons[next].focus();
  });
  set(options[0][0]);
  return { element, set };
}

/** A number for people: at most `digits` significant ones. */
export function short(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 1).replace("e+", "e");
  return String(Number(value.toPrecision(size >= 1000 ? Math.max(digits, Math.ceil(Math.log10(size))) : digits)));
}

/** A length for people: in millimetres or metres where the file says how long its unit is, else in its unit. */
export function lengthInWords(value: number, metresPerUnit: number | null): string {
  if (metresPerUnit === null) return `${short(value)} units`;
  const metres = value * metresPerUnit;
  return Math.abs(metres) < 1 ? `${short(1000 * metres)} mm` : `${short(metres)} m`;
}

export const grouped = (value: number) => value.toLocaleString("en-US").replaceAll(",", "\u202f");
