// SPDX-License-Identifier: Apache-2.0
// The page: joins the connection, the picture, the panel and the keyboard.

import "./style.css";
import { binned, localNoise, type MapName, quantileRange, type Spread } from "./colours";
import { Connection } from "./connection";
import { choice, grouped, h, iconButton } from "./dom";
import { helpDialog } from "./help";
import { Legend } from "./legend";
import { Panel } from "./panel";
import type { CloudHead, Head, Hello, Message, Recipe, Result } from "./protocol";
import { fileCamera, insideMask, lassoText, parseBox, parseLasso, simplified } from "./region";
import { Scene } from "./scene";
import { Stage } from "./stage";
import { copyRecipe, defaultView, equalRecipes, History, type Mode, readFragment, type View, writeFragment } from "./state";
import { Status } from "./status";

const kNoiseCell = 6; // spacings
const kUrlDelay = 250;
const kProtocol = 1;

class Page {
  private readonly view: View = defaultView();
  private readonly stage = new Stage(this.view, (done) => this.viewChanged(done), (file) => void this.upload(file));
  private readonly status = new Status(() => this.connection.cancel());
  private readonly legend = new Legend();
  private readonly help = helpDialog();
  private readonly file = h("div", { class: "file" });
  private readonly device = h("div", { class: "file device" });
  private readonly undoButton = iconButton("Undo", "M8 5 4 9l4 4M4 9h7a5 5 0 0 1 0 10H9", () => this.undo(), "Ctrl Z");
  private readonly redoButton = iconButton("Redo", "m12 5 4 4-4 4m4-4H9a5 5 0 0 0 0 10h2", () => this.redo(), "Ctrl Shift Z");
  private readonly modes = choice<Mode>("View", [["after", "Faired"], ["wipe", "Wipe"], ["side", "Side by side"], ["before", "Original"]],
    (mode) => this.setMode(mode));
  private readonly scene: Scene;
  private readonly connection: Connection;
  private panel: Panel | null = null;
  private hello: Hello | null = null;
  private cloud: CloudHead | null = null;
  private defaults: Recipe = { params: {}, limits: {} };
  private recipe: Recipe = { params: {}, limits: {} };
  private history = new History(this.recipe);
  private snapshots: { name: string; recipe: Recipe }[] = [];
  private result: Result | null = null;
  private shownRecipe: Recipe | null = null; // that the shown result came from
  private asked: Recipe = this.recipe;
  private focus: number[] | undefined;
  private urlTimer = 0;
  private maskOf = "";
  private loaded: Record<string, "asked" | "here"> = {};

  constructor() {
    document.body.append(this.header(), this.stage.element, this.status.element, this.help);
    this.scene = new Scene(this.stage.element, this.view);
    this.stage.element.prepend(this.scene.canvas);
    this.stage.add(this.legend.element);
    this.scene.onCamera = () => {
      this.focus = undefined;
      this.writeUrl();
      if (this.view.colour === "displacement") this.colour();
    };
    this.scene.onStill = (still) => (document.body.dataset.still = String(still));
    this.scene.canvas.addEventListener("dblclick", (event) => this.pivot(event));
    this.listenToKeys();
    window.addEventListener("hashchange", () => this.readUrl());
    this.connection = new Connection((message) => this.receive(message), (state) => this.connectionChanged(state));
  }

  // What comes from the server.

  private receive({ head, arrays }: Message): void {
    switch (head.type) {
      case "hello":
        return this.greet(head);
      case "cloud":
        return this.setCloud(head, arrays);
      case "preview":
        if (head.id !== this.connection.lastRun || !this.cloud) return;
        this.scene.setPreview(arrays.places as Uint32Array, arrays.displacements as Float32Array);
        return this.updated("preview", head.server_ms);
      case "result":
        if (!this.cloud) return;
        return this.setResult(head, arrays);
      case "settled":
        this.scene.setNormals(arrays.normals);
        this.panel?.setNoiseLeft(head.noise);
        return void (document.body.dataset.noise = String(head.noise));
      case "colours":
        return this.setColours(head, arrays);
      case "progress":
        return this.status.showProgress(head.stage, head.share);
      case "saved":
        this.status.hideProgress();
        document.body.dataset.saved = head.path;
        return this.stage.say(`Saved ${head.path}, ${grouped(head.bytes)} bytes`);
      case "cancelled":
        this.status.hideProgress();
        return this.stage.say("Stopped.");
      case "taken":
        return this.stage.showHint("Another page shows this cloud now. Reload to take it back.");
      case "error":
        this.status.hideProgress();
        document.body.dataset.error = head.message;
        return this.stage.say(head.message, true);
    }
  }

  private greet(hello: Hello): void {
    if (hello.protocol !== kProtocol) return this.stage.say("This page is of another version: reload it.", true);
    this.stage.showHint("");
    if (this.panel && JSON.stringify(hello) === JSON.stringify(this.hello)) return;
    this.hello = hello;
    this.defaults = {
      params: Object.fromEntries(hello.params.map((param) => [param.name, param.default])),
      limits: Object.fromEntries(hello.limits.map((name) => [name, ""])),
    };
    this.panel?.element.remove();
    this.panel = new Panel(hello, this.view, {
      changeRecipe: (recipe, done) => this.changeRecipe(recipe, done),
      changeView: () => this.viewChanged(true),
      drawLasso: () => void this.drawLasso(),
      lassoInView: () => this.setLasso([[-1, -1], [1, -1], [1, 1], [-1, 1]]),
      keepSnapshot: (name) => this.keepSnapshot(name),
      restoreSnapshot: (index) => this.changeRecipe(copyRecipe(this.snapshots[index].recipe), true),
      dropSnapshot: (index) => {
        this.snapshots.splice(index, 1);
        this.showSnapshots();
      },
      save: (overwrite) => this.save(overwrite),
      copyCommand: () => void this.copy(this.result?.command, "The command"),
      copyCpp: () => void this.copy(this.result?.cpp, "The program"),
      copyLink: () => void this.copy(location.href, "The link"),
    });
    document.body.append(this.panel.element);
    if (hello.device) {
      this.device.textContent = `${hello.device.kind} · ${hello.device.name}`;
      this.device.title = hello.device.reason;
    }
  }

  private setCloud(head: CloudHead, arrays: Message["arrays"]): void {
    const again = this.cloud && this.cloud.name === head.name && this.cloud.points === head.points;
    if (!again) {
      const { recipe, view } = readFragment(location.hash, head.name, this.defaults);
      Object.assign(this.view, view);
      this.recipe = recipe;
      this.history = new History(recipe);
      this.snapshots = [];
      this.showSnapshots();
    }
    this.cloud = head;
    this.result = null;
    this.loaded = {};
    this.maskOf = "";
    this.focus = undefined;
    this.scene.setStep(head.step);
    this.scene.setCloud(head, arrays);
    this.panel!.setCloud(head);
    this.panel!.show(this.recipe);
    this.file.replaceChildren(h("b", { title: head.path }, head.name),
      h("span", { class: "count" }, ` · ${grouped(head.points)} points${head.shown < head.points ? `, ${grouped(head.shown)} shown` : ""}`));
    document.title = `${head.name} · pointfair`;
    document.body.dataset.cloud = head.name;
    this.stage.ready();
    this.modes.set(this.view.mode);
    this.viewChanged(false);
    this.ask();
  }

  private setResult(head: Result, arrays: Message["arrays"]): void {
    this.result = head;
    this.shownRecipe = this.asked;
    this.scene.setResult(head, arrays);
    this.panel!.setUsed(head);
    this.status.showResult(head, this.cloud!.points);
    this.colour();
    this.updated("result", head.server_ms);
  }

  // For tests and for whoever looks: how often the picture changed.
  private updated(kind: string, serverMs: number): void {
    const { dataset } = document.body;
    dataset.updates = String(Number(dataset.updates ?? 0) + 1);
    dataset.rate = this.status.countUpdate(performance.now()).toFixed(1);
    dataset.last = kind;
    dataset.serverMs = serverMs.toFixed(2);
    dataset.busy = String(this.connection.busy);
  }

  // What the user does.

  private changeRecipe(recipe: Recipe, done: boolean): void {
    this.recipe = copyRecipe(recipe);
    if (done) this.history.keep(recipe);
    this.showRecipe();
    this.ask();
  }

  private showRecipe(): void {
    this.panel?.show(this.recipe);
    this.undoButton.disabled = !this.history.canUndo;
    this.redoButton.disabled = !this.history.canRedo;
    this.showLimits();
    this.writeUrl();
  }

  private ask(): void {
    if (!this.cloud || !this.panel) return;
    this.focus ??= this.scene.focus();
    this.asked = copyRecipe(this.recipe);
    document.body.dataset.busy = "true";
    this.connection.run({ ...this.asked, focus: this.focus, output: this.panel.outputName, encoding: this.panel.encodingName });
  }

  private undo(): void {
    this.step(this.history.undo());
  }
  private redo(): void {
    this.step(this.history.redo());
  }
  private step(recipe: Recipe | null): void {
    if (!recipe) return;
    this.recipe = recipe;
    this.showRecipe();
    this.ask();
  }

  private keepSnapshot(name: string): void {
    this.snapshots.push({ name: name || `Snapshot ${this.snapshots.length + 1}`, recipe: copyRecipe(this.recipe) });
    this.showSnapshots();
  }
  private showSnapshots(): void {
    this.panel?.showSnapshots(this.snapshots.map(({ name }) => name));
  }

  private save(overwrite: boolean): void {
    this.connection.send({ type: "save", id: this.connection.nextId(), ...this.recipe,
      output: this.panel!.outputName, encoding: this.panel!.encodingName, overwrite });
    this.status.showProgress("saving", 0);
  }

  private async copy(text: string | undefined, what: string): Promise<void> {
    if (!text || (what !== "The link" && !(this.shownRecipe && equalRecipes(this.shownRecipe, this.recipe))))
      return this.stage.say("The run is not finished yet.", true);
    try {
      await navigator.clipboard.writeText(text);
      this.stage.say(`${what} is on the clipboard.`);
    } catch {
      this.showText(what, text); // a page that is not on loopback has no clipboard
    }
  }

  private showText(title: string, text: string): void {
    const area = h("textarea", { class: "text", readOnly: true, value: text, rows: 12 });
    const dialog = h("dialog", { onclose: () => dialog.remove() }, h("h2", {}, title), area);
    document.body.append(dialog);
    dialog.showModal();
    area.select();
  }

  private async drawLasso(): Promise<void> {
    const outline = await this.stage.drawLasso();
    if (outline) this.setLasso(simplified(outline));
  }

  private setLasso(polygon: [number, number][]): void {
    if (polygon.length < 3) return;
    const { elements, origin } = this.scene.fileMatrix;
    const recipe = copyRecipe(this.recipe);
    recipe.limits.lasso = lassoText({ camera: fileCamera(elements, origin), polygon });
    this.changeRecipe(recipe, true);
  }

  private async upload(file: File): Promise<void> {
    const query = new URLSearchParams({ name: file.name });
    const token = new URLSearchParams(location.search).get("token");
    if (token) query.set("token", token);
    this.stage.say(`Sending ${file.name}…`);
    try {
      const response = await fetch(`/upload?${query}`, { method: "POST", body: file });
      if (!response.ok) this.stage.say(await response.text(), true);
    } catch {
      this.stage.say(`${file.name} could not be sent.`, true);
    }
  }

  private async screenshot(): Promise<void> {
    const url = URL.createObjectURL(await this.scene.screenshot());
    const name = (this.cloud?.name ?? "cloud").replace(/\.[^.]*$/, "");
    h("a", { href: url, download: `${name}.png` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  }

  private pivot(event: MouseEvent): void {
    const box = this.scene.canvas.getBoundingClientRect();
    const at = this.scene.pick(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    if (at) this.scene.pivot(at);
  }

  // What is seen.

  private setMode(mode: Mode): void {
    this.view.mode = mode;
    this.modes.set(mode);
    this.viewChanged(true);
  }

  private viewChanged(done: boolean): void {
    this.stage.showView(false);
    this.panel?.showView();
    this.showLimits();
    this.scene.applyView();
    this.colour();
    if (done) this.writeUrl();
  }

  private hold(original: boolean): void {
    this.scene.hold(original);
    this.stage.showView(original);
  }

  private showLimits(): void {
    const [box, lasso] = [parseBox(this.recipe.limits.box ?? ""), parseLasso(this.recipe.limits.lasso ?? "")];
    this.scene.setBox(box);
    const key = `${this.recipe.limits.box}|${this.recipe.limits.lasso}`;
    if (!this.cloud || key === this.maskOf) return;
    this.maskOf = key;
    this.scene.setInside(box || lasso ? insideMask(this.scene.allPositions, this.cloud.origin, box, lasso) : null);
  }

  private colour(): void {
    const { view, scene, cloud } = this;
    if (!cloud) return;
    const name = view.colour;
    if (name === "displacement") {
      const most = 2.5 * (this.result?.moved.rms || cloud.spacing || 1);
      const spread = binned((place) => scene.signedDisplacement(place), scene.count, [-most, most]);
      return this.map("displacement", "diverging", spread, "displacement, toward you +");
    }
    if (name === "height") {
      const spread = this.spread((place) => scene.height(place));
      return this.map("height", "sequential", spread, "height");
    }
    if (name === "noise") {
      const squared = (place: number) => scene.displacement(place).reduce((sum, d) => sum + d * d, 0);
      const noise = localNoise(scene.allPositions, squared, kNoiseCell * (cloud.spacing || 1));
      scene.setScalar(noise);
      this.loaded = { rgb: this.loaded.rgb };
      return this.map("scalar", "sequential", this.spread((place) => noise[place]), "estimated noise");
    }
    this.legend.hide();
    if (name === "rgb" || name.startsWith("attribute:")) {
      if (this.loaded[name] === "here") return this.showLoaded(name);
      if (this.loaded[name] === "asked") return;
      this.loaded[name] = "asked";
      return this.connection.send({ type: "colours", id: this.connection.nextId(), name: name === "rgb" ? "rgb" : name.slice(10) });
    }
    scene.setColourMode(name === "normal" ? "normal" : "plain", [0, 1], "sequential");
  }

  private scalar: Float32Array = new Float32Array();

  private setColours(head: Extract<Head, { type: "colours" }>, arrays: Message["arrays"]): void {
    const name = head.name === "rgb" && arrays.rgb ? "rgb" : `attribute:${head.name}`;
    if (arrays.rgb) this.scene.setColours(arrays.rgb as Uint8Array);
    else {
      for (const other of Object.keys(this.loaded)) if (other !== "rgb") delete this.loaded[other];
      this.scalar = arrays.scalar as Float32Array;
      this.scene.setScalar(this.scalar);
    }
    this.loaded[name] = "here";
    if (this.view.colour === name) this.showLoaded(name);
  }

  private showLoaded(name: string): void {
    if (name === "rgb") return this.scene.setColourMode("rgb", [0, 1], "sequential");
    this.map("scalar", "sequential", this.spread((place) => this.scalar[place]), name.slice(10));
  }

  private spread(value: (place: number) => number): Spread {
    return binned(value, this.scene.count, quantileRange(value, this.scene.count));
  }

  private map(mode: "displacement" | "height" | "scalar", map: MapName, spread: Spread, title: string): void {
    this.scene.setColourMode(mode, spread.range, map);
    this.legend.show(title, map, spread);
  }

  // The URL.

  private writeUrl(): void {
    clearTimeout(this.urlTimer);
    this.urlTimer = window.setTimeout(() => {
      if (!this.cloud) return;
      const fragment = writeFragment(this.cloud.name, this.recipe, this.defaults, this.view);
      history.replaceState(null, "", location.pathname + location.search + fragment);
    }, kUrlDelay);
  }

  private readUrl(): void {
    if (!this.cloud) return;
    const { recipe, view } = readFragment(location.hash, this.cloud.name, this.defaults);
    Object.assign(this.view, view);
    this.modes.set(view.mode);
    this.changeRecipe(recipe, true);
    this.viewChanged(false);
  }

  private connectionChanged(state: "open" | "closed" | "taken"): void {
    document.body.dataset.connection = state;
    if (state === "closed") {
      this.cloud = null;
      this.stage.showHint("The connection is gone. Trying again…");
    }
  }

  // The frame of the page.

  private header(): HTMLElement {
    this.undoButton.disabled = this.redoButton.disabled = true;
    const panelButton = iconButton("Settings", "M3 5h14M3 10h14M3 15h14M7 3v4M13 8v4M6 13v4", () => {
      const closed = document.body.classList.toggle("closed");
      panelButton.setAttribute("aria-pressed", String(!closed));
    }, "P");
    panelButton.setAttribute("aria-pressed", "true");
    panelButton.id = "toggle-panel";
    return h("header", {},
      h("div", { class: "brand" }, h("img", { src: "./icon.svg", alt: "" }), h("span", {}, "pointfair")),
      this.file, h("div", { class: "spacer" }), this.modes.element, h("div", { class: "spacer" }), this.device,
      h("div", { class: "tools", role: "toolbar", "aria-label": "Tools" },
        this.undoButton, this.redoButton,
        iconButton("Fit", "M3 7V3h4M13 3h4v4M17 13v4h-4M7 17H3v-4M7 7h6v6H7z", () => this.scene.fit(), "F"),
        iconButton("Screenshot", "M3 6h3l1.5-2h5L14 6h3v10H3zM10 8a3 3 0 1 0 0 6 3 3 0 0 0 0-6z", () => void this.screenshot(), "S"),
        iconButton("Keyboard", "M2.5 5.5h15v9h-15zM5 8.5h.01M8 8.5h.01M11 8.5h.01M14 8.5h.01M6 11.5h8", () => this.help.showModal(), "?"),
        panelButton));
  }

  private listenToKeys(): void {
    const typing = (event: KeyboardEvent) =>
      event.target instanceof HTMLElement && event.target.matches("input:not([type=range]):not([type=checkbox]), select, textarea");
    window.addEventListener("keydown", (event) => {
      if ((event.ctrlKey || event.metaKey) && !event.altKey && event.key.toLowerCase() === "z" && !typing(event)) {
        event.preventDefault();
        return event.shiftKey ? this.redo() : this.undo();
      }
      if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "y" && !typing(event)) {
        event.preventDefault();
        return this.redo();
      }
      if (event.ctrlKey || event.metaKey || event.altKey || typing(event) || document.querySelector("dialog[open]")) return;
      const act = this.keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      const onCanvas = event.target === this.scene.canvas || event.target === document.body;
      if (act && (onCanvas || event.key.length === 1)) {
        event.preventDefault();
        act(event.shiftKey);
      }
    });
    window.addEventListener("keyup", (event) => {
      if (event.key.toLowerCase() === "b") this.hold(false);
    });
    window.addEventListener("blur", () => this.hold(false));
  }

  private readonly keys: Record<string, (shift: boolean) => void> = {
    ArrowLeft: (shift) => (shift ? this.scene.nudge([0, 0], [0.04, 0], 1) : this.scene.nudge([-0.08, 0], [0, 0], 1)),
    ArrowRight: (shift) => (shift ? this.scene.nudge([0, 0], [-0.04, 0], 1) : this.scene.nudge([0.08, 0], [0, 0], 1)),
    ArrowUp: (shift) => (shift ? this.scene.nudge([0, 0], [0, -0.04], 1) : this.scene.nudge([0, -0.08], [0, 0], 1)),
    ArrowDown: (shift) => (shift ? this.scene.nudge([0, 0], [0, 0.04], 1) : this.scene.nudge([0, 0.08], [0, 0], 1)),
    "+": () => this.scene.nudge([0, 0], [0, 0], 1 / 1.15),
    "=": () => this.scene.nudge([0, 0], [0, 0], 1 / 1.15),
    "-": () => this.scene.nudge([0, 0], [0, 0], 1.15),
    b: () => this.hold(true),
    f: () => this.scene.fit(),
    l: () => void this.drawLasso(),
    p: () => document.getElementById("toggle-panel")!.click(),
    s: () => void this.screenshot(),
    "1": () => this.setMode("after"),
    "2": () => this.setMode("wipe"),
    "3": () => this.setMode("side"),
    "4": () => this.setMode("before"),
    "?": () => this.help.showModal(),
  };
}

new Page();
