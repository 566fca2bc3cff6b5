// SPDX-License-Identifier: Apache-2.0
// One control for each row of the parameter table: what it is called, how it ranges and what it may say all come from the
// row. Values are texts as the flags take them.

import { h, short } from "./dom";
import type { Param } from "./protocol";
import { wordsFor } from "./words";

export interface Scale {
  spacing: number;
  diagonal: number;
  metres: number | null; // per unit of the file; null: it does not say
}

type Unit = "mm" | "s" | "%" | "r" | "";
const kUnits: [Unit, string][] = [["mm", "mm"], ["s", "spacings"], ["%", "% of size"], ["r", "radii"], ["", "file units"]];
const kMetric: Record<string, number> = { mm: 0.001, cm: 0.01, m: 1, ft: 0.3048 }; // metres
const kSteps = 1000;
const kLengthRange = [0.05, 50]; // of a slider, in spacings

/** A length's digits and its unit, as the flags take them. */
function parsed(text: string): [string, string] {
  const [, digits, unit] = /^\s*(.*?)(mm|cm|m|ft|s|%|r)?\s*$/.exec(text)!;
  return [digits, unit ?? ""];
}
const unitOf = (text: string): Unit => {
  const [, unit] = parsed(text);
  return unit in kMetric ? "mm" : (unit as Unit);
};
const perUnit = (unit: string, scale: Scale) =>
  unit in kMetric ? kMetric[unit] / (scale.metres ?? NaN)
  : unit === "s" ? scale.spacing || 1
  : unit === "%" ? scale.diagonal / 100 || 1
  : unit === "r" ? 2.26 * scale.spacing || 1 // of 16 points without noise; each point has its own
  : 1;

/** A length's text in file units; NaN for none. */
export function lengthOf(text: string, scale: Scale): number {
  const [digits, unit] = parsed(text);
  return digits.trim() === "" ? NaN : Number(digits) * perUnit(unit, scale);
}

export const lengthText = (length: number, unit: Unit, scale: Scale) => short(length / perUnit(unit, scale)) + unit;

export interface Control {
  element: HTMLElement;
  /** Shows a value, and what `auto` came to. */
  show(text: string, used: string | undefined, scale: Scale): void;
}

/** `change` gets the text; `done` is true when the hand lets go. */
export function makeControl(param: Param, change: (text: string, done: boolean) => void): Control {
  if (param.kind === "switch") return switchControl(param, change);
  if (param.kind === "word") return wordControl(param, change);
  return numberControl(param, change);
}

function row(param: Param, ...parts: (Node | null)[]): HTMLElement {
  const id = `param-${param.name}`;
  const help = h("span", { class: "help", id: `${id}-help` }, param.help);
  return h("div", { class: "param", "data-param": param.name, title: `${param.flag}: ${param.help}` },
    h("label", { class: "words", htmlFor: id }, wordsFor(param.name)), ...parts, help);
}

function switchControl(param: Param, change: (text: string, done: boolean) => void): Control {
  const [on, off] = param.values;
  const box = h("input", {
    type: "checkbox", id: `param-${param.name}`, class: "switch", role: "switch",
    "aria-describedby": `param-${param.name}-help`, onchange: () => change(box.checked ? on : off, true),
  });
  return { element: row(param, box), show: (text) => void (box.checked = text === on) };
}

function wordControl(param: Param, change: (text: string, done: boolean) => void): Control {
  const words = param.automatic ? ["auto", ...param.values] : param.values;
  const select = h("select", {
    id: `param-${param.name}`, "aria-describedby": `param-${param.name}-help`, onchange: () => change(select.value, true),
  }, ...words.map((word) => h("option", { value: word }, word)));
  const show = (text: string, used: string | undefined) => {
    select.value = text;
    const auto = select.options[0];
    if (param.automatic) auto.textContent = used && used !== "auto" ? `auto (${used})` : "auto";
  };
  return { element: row(param, select), show };
}

/** A number's texts, its values and the places of its slider. */
class NumberTexts {
  scale: Scale = { spacing: 1, diagonal: 1, metres: null };
  unit: Unit = "s";
  readonly isLength: boolean;

  constructor(private readonly param: Param) {
    this.isLength = param.kind === "length";
  }
  range(): [number, number] {
    if (!this.isLength) return [this.param.min, this.param.max];
    return [kLengthRange[0] * (this.scale.spacing || 1), kLengthRange[1] * (this.scale.spacing || 1)];
  }
  toPlace(value: number): number {
    const [low, high] = this.range();
    const share = low > 0 ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
    return Math.round(kSteps * Math.min(1, Math.max(0, share)));
  }
  fromPlace(place: number): number {
    const [low, high] = this.range();
    const share = place / kSteps;
    return low > 0 ? low * (high / low) ** share : low + share * (high - low);
  }
  textOf(value: number): string {
    if (this.isLength) return lengthText(value, this.unit, this.scale);
    return String(this.param.kind === "int" ? Math.round(value) : Number(value.toPrecision(3)));
  }
  valueOf = (text: string) => (this.isLength ? lengthOf(text, this.scale) : Number(text));
  spoken = (text: string) => (this.isLength ? `${parsed(text)[0]} ${unitName(unitOf(text))}` : text);
}

function makeSlider(
  param: Param, texts: NumberTexts, shown: () => string, change: (text: string, done: boolean) => void,
) {
  const slider = h("input", {
    type: "range", min: "0", max: String(kSteps), step: "1", "aria-label": wordsFor(param.name),
    "aria-describedby": `param-${param.name}-help`,
    oninput: () => change(texts.textOf(texts.fromPlace(slider.valueAsNumber)), false),
    onchange: () => change(texts.textOf(texts.fromPlace(slider.valueAsNumber)), true),
    // a whole number moves by one, whatever the slider's own steps are
    onkeydown: (event: KeyboardEvent) => {
      const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (!step || param.kind !== "int") return;
      event.preventDefault();
      const now = Math.round(texts.fromPlace(slider.valueAsNumber));
      const from = shown() === "auto" ? now : Number(shown());
      change(String(Math.min(param.max, Math.max(param.min, from + step))), true);
    },
  });
  return slider;
}

function numberControl(param: Param, change: (text: string, done: boolean) => void): Control {
  const texts = new NumberTexts(param);
  const { isLength } = texts;
  let shown = "", usedText = "";
  let typing = false; // what stands in the entry was not asked for yet

  const id = `param-${param.name}`;
  const slider = makeSlider(param, texts, () => shown, change);
  const entry = h("input", {
    type: "text", id, class: "entry", spellcheck: false, autocomplete: "off", inputMode: isLength ? "text" : "numeric",
    "aria-describedby": `${id}-help`,
    oninput: () => void (typing = true),
    onblur: () => {
      typing = false;
      refresh();
    },
    onchange: () => {
      typing = false;
      const text = entry.value.trim();
      change(text || (param.automatic ? "auto" : shown), true);
    },
  });
  const units = h("select", {
    class: "unit", "aria-label": `unit of ${wordsFor(param.name)}`,
    onchange: () => {
      texts.unit = units.value as Unit;
      const value = lengthOf(shown === "auto" ? usedText : shown, texts.scale);
      if (shown === "auto" || !Number.isFinite(value)) refresh();
      else change(lengthText(value, texts.unit, texts.scale), true);
    },
  }, ...kUnits.filter(([value]) => value !== "r" || param.in_radii).map(([value, name]) => h("option", { value }, name)));
  const auto = h("button", {
    type: "button", class: "auto", "aria-pressed": "false", title: "choose the value from the data",
    "aria-label": `${wordsFor(param.name)} auto`,
    onclick: () => {
      if (shown !== "auto") return change("auto", true);
      const value = texts.valueOf(usedText);
      const [low, high] = texts.range();
      change(texts.textOf(Number.isFinite(value) && value > 0 ? value : Math.sqrt(low * high)), true);
    },
  }, "auto");

  const element = row(param, h("div", { class: "number" }, entry, isLength ? units : null, param.automatic ? auto : null), slider);
  const refresh = () => {
    const isAuto = shown === "auto";
    element.classList.toggle("is-auto", isAuto);
    auto.setAttribute("aria-pressed", String(isAuto));
    const value = texts.valueOf(isAuto ? usedText : shown);
    const known = Number.isFinite(value);
    if (!typing)
      entry.value = !isAuto ? shown : known ? (isLength ? lengthText(value, texts.unit, texts.scale) : short(value)) : "–";
    if (document.activeElement !== slider || isAuto || Math.abs(texts.fromPlace(slider.valueAsNumber) / value - 1) > 0.02)
      if (known) slider.value = String(texts.toPlace(value));
    slider.setAttribute("aria-valuetext", isAuto ? `auto, ${known ? texts.spoken(entry.value) : "unused"}` : texts.spoken(shown));
    if (isLength) units.value = texts.unit;
  };
  const show = (text: string, used: string | undefined, scale: Scale) => {
    if (scale.metres !== texts.scale.metres) texts.unit = scale.metres ? "mm" : "s";
    units.options[0].hidden = units.options[0].disabled = !scale.metres;
    texts.scale = scale;
    shown = text;
    usedText = used ?? usedText;
    const itsUnit = unitOf(text);
    const isOffered = itsUnit !== "r" || param.in_radii;
    if (isLength && isOffered && lengthOf(text, scale) > 0) texts.unit = itsUnit; // what is refused leaves the unit as it is
    refresh();
  };
  return { element, show };
}

const unitName = (unit: Unit) => kUnits.find(([value]) => value === unit)![1];
