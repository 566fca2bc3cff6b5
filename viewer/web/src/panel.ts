// SPDX-License-Identifier: Apache-2.0
// The panel at the side: parameters, limits, display, snapshots, saving.

import { type Control, makeControl, type Scale } from "./controls";
import { choice, h, lengthInWords } from "./dom";
import type { CloudHead, Hello, Param, Recipe, Result, Texts } from "./protocol";
import { type Box, boxText, parseBox } from "./region";
import { copyRecipe, type Draw, type View } from "./state";

export interface PanelActions {
  changeRecipe(recipe: Recipe, done: boolean): void;
  changeView(): void;
  drawLasso(): void;
  lassoInView(): void;
  save(overwrite: boolean): void;
  copyCommand(): void;
  copyCpp(): void;
  copyLink(): void;
}

const kStageTitles: Record<string, string> = {
  index: "Index", neighbors: "Neighbours", normals: "Normals", fairing: "Fairing", iterations: "Iterations",
};
const kAxes = ["x", "y", "z"];
const kBoxSteps = 200;
const kCoordinateDigits = 10; // of UTM northings in tenths of a millimetre

export class Panel {
  readonly element = h("aside", { class: "panel", "aria-label": "Settings" });
  private controls: [string, Control][] = [];
  private recipe: Recipe = { params: {}, limits: {} };
  private cloud: CloudHead | null = null;
  private used: Texts = {};
  private readonly output = h("input", { class: "text", id: "output", value: "denoised.ply", spellcheck: false, autocomplete: "off" });
  private readonly encoding = h("select", { id: "encoding", class: "grow" });
  private readonly overwrite = h("input", { type: "checkbox", class: "switch", role: "switch", id: "overwrite" });
  private readonly strength = h("input", { type: "range", min: "0", max: "1", step: "0.01", id: "strength" });
  private readonly strengthValue = h("span", { class: "value" });
  private readonly boxSwitch = h("input", { type: "checkbox", class: "switch", role: "switch", id: "box" });
  private readonly hideSwitch = h("input", { type: "checkbox", class: "switch", role: "switch", id: "hide" });
  private readonly axes = h("div", { class: "axes" });
  private readonly sliders: HTMLInputElement[] = [];
  private readonly coordinates: HTMLInputElement[] = []; // the box's faces, as numbers; order of the sliders
  private readonly selections: [string, HTMLInputElement][] = [];
  private readonly lassoNote = h("p", { class: "note" });
  private readonly clearLasso = h("button", { type: "button", class: "plain" }, "Clear lasso");
  private readonly colour = h("select", { id: "colour", class: "grow" });
  private readonly snapshots = h("ul", { class: "snapshots" });
  private readonly folder = h("p", { class: "note" });
  private readonly expert = h("details", { class: "expert" });
  private expertDefaults: [string, string][] = [];
  private readonly ofMeshes: HTMLElement[] = []; // rows of parameters
  private readonly findings = h("p", { class: "note", id: "findings" });
  private readonly extensions: string[];
  private readonly viewSliders: [keyof View, HTMLInputElement][] = [];
  private readonly draw = choice<Draw>("Draw",
    [["smooth", "Smooth"], ["flat", "Flat"], ["wireframe", "Wireframe"], ["points", "Points"]], (draw) => {
      this.view.draw = draw;
      this.actions.changeView();
    });
  private readonly up = choice<"y" | "z">("Up", [["z", "z up"], ["y", "y up"]], (up) => {
    this.view.up = up;
    this.actions.changeView();
  });

  constructor(hello: Hello, private readonly view: View, private readonly actions: PanelActions) {
    this.extensions = hello.formats.extensions;
    this.encoding.append(h("option", { value: "" }, "as in the input"),
      ...hello.formats.encodings.map((name) => h("option", { value: name }, name)));
    this.folder.textContent = hello.save_folder ? `Saves into ${hello.save_folder}` : "Saves among the browser's downloads";
    this.element.append(
      this.section("Parameters", true, ...this.paramGroups(hello)),
      this.section("Which points move", true, ...this.limitFields()),
      this.section("Display", true, ...this.displayFields()),
      this.section("Snapshots", false, ...this.snapshotFields()),
      this.section("Save and share", true, ...this.saveFields(hello)),
    );
    this.overwrite.closest<HTMLElement>(".field")!.hidden = !hello.save_folder;
  }

  get outputName(): string {
    return this.output.value.trim();
  }
  get encodingName(): string {
    return this.encoding.value;
  }

  setCloud(cloud: CloudHead, drawsFaces: boolean): void {
    this.draw.element.hidden = !drawsFaces;
    this.cloud = cloud;
    this.used = {};
    for (const row of this.ofMeshes) row.hidden = cloud.faces === 0;
    this.output.value = this.defaultOutput(cloud.name);
    const computed: [string, string][] = [["plain", "plain"], ["displacement", "displacement"], ["rms", "rms displacement nearby"],
      ["height", "height"], ["normal", "normal"], ["noise", "noise"], ["outliers", "outliers of this run"]];
    const own = cloud.colours.map(({ name, kind }): [string, string] => [kind === "scalar" ? `attribute:${name}` : kind, name]);
    this.colour.replaceChildren(...[...computed, ...own].map(([value, text]) => h("option", { value }, text)));
    const known = [...this.colour.options].some((option) => option.value === this.view.colour);
    const first = own.find(([value]) => value === "texture" || value === "rgb");
    if (!known) this.view.colour = first ? first[0] : "plain";
    this.showFindings();
    this.showView();
  }

  // NAME_denoised, in the format of the input where that is written.
  private defaultOutput(name: string): string {
    const dot = name.lastIndexOf(".");
    const [stem, extension] = dot > 0 ? [name.slice(0, dot), name.slice(dot + 1)] : [name, ""];
    return `${stem}_denoised.${this.extensions.includes(extension.toLowerCase()) ? extension : "ply"}`;
  }

  /** `asked`: the recipe that the result came from; what is not automatic there says nothing of `auto`. */
  setUsed(result: Result, asked: Recipe): void {
    this.used = Object.fromEntries(Object.entries(result.used).filter(([name]) => asked.params[name] === "auto"));
    this.showFindings(result.moved);
    this.show(this.recipe);
  }

  // What was estimated of the cloud as it came, and how far the last run moved its points.
  private showFindings(moved?: Result["moved"]): void {
    const { spacing, noise, metres_per_unit } = this.cloud!;
    const told = (length: number) => lengthInWords(length, metres_per_unit);
    const motion = moved ? `; points moved ${told(moved.mean)} on average, ${told(moved.max)} at most` : "";
    this.findings.textContent = `Estimated spacing ${told(spacing)}, noise ${told(noise)}${motion}`;
  }

  /** Shows a recipe without asking for anything. */
  show(recipe: Recipe): void {
    this.recipe = copyRecipe(recipe);
    const scale: Scale = { spacing: this.cloud?.spacing ?? 1, diagonal: this.cloud?.diagonal ?? 1,
      metres: this.cloud?.metres_per_unit ?? null };
    for (const [name, control] of this.controls) control.show(recipe.params[name] ?? "", this.used[name], scale);
    if (this.expertDefaults.some(([name, value]) => (recipe.params[name] ?? value) !== value)) this.expert.open = true;
    const strength = recipe.limits.strength || "1";
    if (Number(strength) !== this.strength.valueAsNumber) this.strength.value = strength;
    this.strengthValue.textContent = `${Math.round(100 * Number(strength))} %`;
    this.showBox(parseBox(recipe.limits.box ?? ""));
    for (const [name, input] of this.selections) input.value = recipe.limits[name] ?? "";
    this.lassoNote.textContent = recipe.limits.lasso ? "Only points inside the lasso move." : "";
    this.lassoNote.hidden = this.clearLasso.hidden = !recipe.limits.lasso;
  }

  showView(): void {
    for (const [key, slider] of this.viewSliders) slider.value = String(this.view[key]);
    this.colour.value = this.view.colour;
    this.hideSwitch.checked = this.view.hide;
    this.draw.set(this.view.draw);
    if (this.view.up !== "auto") this.up.set(this.view.up);
  }

  /** Those of another cloud. */
  forgetSnapshots(): void {
    this.snapshots.replaceChildren();
  }

  private keepSnapshot(given: string): void {
    const name = given || `Snapshot ${this.snapshots.children.length + 1}`;
    const kept = copyRecipe(this.recipe);
    const row = h("li", {},
      h("button", { type: "button", class: "plain", onclick: () => this.actions.changeRecipe(copyRecipe(kept), true) }, name),
      h("button", { type: "button", class: "plain", "aria-label": `Delete ${name}`, onclick: () => row.remove() }, "×"));
    this.snapshots.append(row);
  }

  private section(title: string, open: boolean, ...parts: Node[]): HTMLElement {
    return h("details", { open }, h("summary", {}, title), h("div", { class: "body" }, ...parts));
  }

  private field(label: string, id: string, ...parts: Node[]): HTMLElement {
    return h("div", { class: "field" }, h("label", { htmlFor: id }, label), ...parts);
  }

  private change(edit: (recipe: Recipe) => void, done: boolean): void {
    const recipe = copyRecipe(this.recipe);
    edit(recipe);
    this.show(recipe);
    this.actions.changeRecipe(recipe, done);
  }

  private paramGroups(hello: Hello): Node[] {
    const presets = h("select", { id: "preset", onchange: () => {
      const preset = hello.presets.find(({ name }) => name === presets.value);
      presets.value = "";
      if (preset) this.change((recipe) => (recipe.params = { ...preset.params }), true);
    } }, h("option", { value: "" }, "choose…"), ...hello.presets.map(({ name }) => h("option", { value: name }, name)));
    const expert = hello.params.filter((param) => param.expert);
    const stages = [...new Set(expert.map((param) => param.stage))];
    this.expert.append(h("summary", {}, "Expert"), ...stages.map((stage) =>
      h("div", { class: "group", role: "group", "aria-label": kStageTitles[stage] ?? stage },
        h("h3", {}, kStageTitles[stage] ?? stage), ...this.paramControls(expert.filter((param) => param.stage === stage)))));
    this.expertDefaults = expert.map(({ name, default: value }) => [name, value]);
    return [this.findings, this.field("Preset", "preset", presets),
      h("div", { class: "group", role: "group", "aria-label": "Parameters" }, ...this.paramControls(hello.params.filter((param) => !param.expert))),
      this.expert];
  }

  private paramControls(params: Param[]): HTMLElement[] {
    return params.map((param) => {
      const control = makeControl(param, (text, done) => this.change((recipe) => (recipe.params[param.name] = text), done));
      this.controls.push([param.name, control]);
      if (param.needs_faces) this.ofMeshes.push(control.element);
      return control.element;
    });
  }

  private limitFields(): Node[] {
    const strength = (done: boolean) => () =>
      this.change((recipe) => (recipe.limits.strength = this.strength.value === "1" ? "" : this.strength.value), done);
    this.strength.addEventListener("input", strength(false));
    this.strength.addEventListener("change", strength(true));
    this.boxSwitch.addEventListener("change", () => this.change((recipe) => {
      recipe.limits.box = this.boxSwitch.checked ? boxText(this.wholeBox()) : "";
    }, true));
    this.hideSwitch.addEventListener("change", () => {
      this.view.hide = this.hideSwitch.checked;
      this.actions.changeView();
    });
    this.axes.append(h("span"), h("span", { class: "note" }, "from"), h("span", { class: "note" }, "to"));
    kAxes.forEach((axis, i) => {
      this.axes.append(h("span", { class: "flag" }, axis));
      for (const end of [0, 1]) {
        const slider = h("input", { type: "range", min: "0", max: String(kBoxSteps), "aria-label": `box ${axis} ${end ? "to" : "from"}` });
        this.sliders[2 * i + end] = slider;
        slider.addEventListener("input", () => this.moveBox(i, end, false));
        slider.addEventListener("change", () => this.moveBox(i, end, true));
        const number = h("input", { class: "text", inputMode: "decimal", spellcheck: false, autocomplete: "off",
          "aria-label": `coordinate of the box, ${axis} ${end ? "to" : "from"}` });
        this.coordinates[2 * i + end] = number;
        number.addEventListener("input", () => (number.dataset.typed = "yes")); // which no answer may replace
        number.addEventListener("blur", () => delete number.dataset.typed);
        number.addEventListener("change", () => this.typeBox(i, end));
        this.axes.append(h("div", {}, slider, number));
      }
    });
    this.clearLasso.addEventListener("click", () => this.change((recipe) => (recipe.limits.lasso = ""), true));
    return [
      this.field("Strength", "strength", this.strengthValue, this.strength),
      this.field("Clip box", "box", this.boxSwitch),
      this.axes,
      this.field("Hide points outside the box", "hide", this.hideSwitch),
      h("div", { class: "buttons" },
        h("button", { type: "button", class: "plain", onclick: () => this.actions.drawLasso() }, "Draw lasso"),
        h("button", { type: "button", class: "plain", onclick: () => this.actions.lassoInView() }, "Only points in view"),
        this.clearLasso),
      this.lassoNote,
      this.selectionField("where", "Only where", "Only points move whose attribute has one of these integers"),
      this.selectionField("ignore", "Ignore", "Points whose attribute has one of these integers do not move and are nobody's neighbours"),
    ];
  }

  private selectionField(name: string, label: string, title: string): HTMLElement {
    const input = h("input", { class: "text", id: name, title, placeholder: "classification=2,6", spellcheck: false, autocomplete: "off" });
    input.addEventListener("change", () => this.change((recipe) => (recipe.limits[name] = input.value.trim()), true));
    this.selections.push([name, input]);
    return this.field(label, name, input);
  }

  private bounds(axis: number): [number, number] {
    const { min, max, origin } = this.cloud!;
    const margin = 1e-6 * (Math.abs(origin[axis]) + max[axis] - min[axis]); // the faces hold the outermost points
    return [min[axis] + origin[axis] - margin, max[axis] + origin[axis] + margin];
  }

  private wholeBox(): Box {
    const ends = kAxes.map((_, axis) => this.bounds(axis));
    return { min: ends.map(([low]) => low), max: ends.map(([, high]) => high) };
  }

  private moveBox(axis: number, end: number, done: boolean): void {
    const box = parseBox(this.recipe.limits.box) ?? this.wholeBox();
    const [low, high] = this.bounds(axis);
    const place = this.sliders[2 * axis + end].valueAsNumber / kBoxSteps;
    const value = Number((low + place * (high - low)).toPrecision(9));
    this.setFace(box, axis, end, place === 0 ? low : place === 1 ? high : value, done);
  }

  private typeBox(axis: number, end: number): void {
    const box = parseBox(this.recipe.limits.box) ?? this.wholeBox();
    const field = this.coordinates[2 * axis + end];
    const text = field.value.trim();
    delete field.dataset.typed;
    const value = Number(text);
    if (text === "" || !Number.isFinite(value)) return this.showBox(box);
    this.setFace(box, axis, end, value, true);
  }

  // Moves the opposite face along where this one would pass it.
  private setFace(box: Box, axis: number, end: number, value: number, done: boolean): void {
    (end ? box.max : box.min)[axis] = value;
    if (end) box.min[axis] = Math.min(box.min[axis], box.max[axis]);
    else box.max[axis] = Math.max(box.min[axis], box.max[axis]);
    this.change((recipe) => (recipe.limits.box = boxText(box)), done);
  }

  private showBox(box: Box | null): void {
    this.boxSwitch.checked = box !== null;
    this.axes.hidden = this.hideSwitch.parentElement!.hidden = box === null;
    if (!box || !this.cloud) return;
    kAxes.forEach((_, axis) => {
      const [low, high] = this.bounds(axis);
      [box.min[axis], box.max[axis]].forEach((value, end) => {
        this.sliders[2 * axis + end].value = String(Math.round((kBoxSteps * (value - low)) / (high - low || 1)));
        const field = this.coordinates[2 * axis + end];
        if (!field.dataset.typed) field.value = String(Number(value.toPrecision(kCoordinateDigits)));
      });
    });
  }

  private displayFields(): Node[] {
    this.colour.addEventListener("change", () => {
      this.view.colour = this.colour.value;
      this.actions.changeView();
    });
    const slider = (label: string, key: "size" | "edl" | "shade" | "exaggerate", min: number, max: number, step: number) => {
      const input = h("input", { type: "range", id: `view-${key}`, min: String(min), max: String(max), step: String(step),
        oninput: () => {
          this.view[key] = input.valueAsNumber;
          this.actions.changeView();
        } });
      this.viewSliders.push([key, input]);
      return this.field(label, `view-${key}`, input);
    };
    return [
      this.draw.element,
      this.field("Colour by", "colour", this.colour),
      slider("Point size", "size", 0.4, 5, 0.1),
      slider("Eye-dome lighting", "edl", 0, 1, 0.02),
      slider("Shading by normals", "shade", 0, 1, 0.02),
      slider("Displacement × 1 to 10", "exaggerate", 1, 10, 0.5),
      h("div", { class: "field" }, h("span", {}, "Axis"), this.up.element),
    ];
  }

  private snapshotFields(): Node[] {
    const name = h("input", { class: "text", placeholder: "name", "aria-label": "Name of the snapshot" });
    const keep = () => {
      this.keepSnapshot(name.value.trim());
      name.value = "";
    };
    name.addEventListener("keydown", (event) => {
      if (event.key === "Enter") keep();
    });
    return [h("div", { class: "line" }, name, h("button", { type: "button", class: "plain", onclick: keep }, "Keep")), this.snapshots];
  }

  private saveFields(hello: Hello): Node[] {
    const extensions = hello.formats.extensions.map((e) => `.${e}`).join(" ");
    const asked = () => this.actions.changeRecipe(this.recipe, false); // the command names the file
    this.output.addEventListener("change", asked);
    this.encoding.addEventListener("change", asked);
    this.output.title = `The extension decides the format: ${extensions}`;
    return [
      this.field("File", "output", this.output),
      this.field("Encoding", "encoding", this.encoding),
      this.field("Replace a file of that name", "overwrite", this.overwrite),
      h("div", { class: "buttons" },
        h("button", { type: "button", class: "plain primary", id: "save", onclick: () => this.actions.save(this.overwrite.checked) }, "Save")),
      this.folder,
      h("div", { class: "buttons" },
        h("button", { type: "button", class: "plain", id: "copy-command", onclick: () => this.actions.copyCommand() }, "Copy as command"),
        h("button", { type: "button", class: "plain", id: "copy-cpp", onclick: () => this.actions.copyCpp() }, "Copy as C++"),
        h("button", { type: "button", class: "plain", onclick: () => this.actions.copyLink() }, "Copy link")),
    ];
  }
}
