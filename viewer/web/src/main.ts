// SPDX-License-Identifier: Apache-2.0
// The page: joins the connection, the picture, the panel and the keyboard.

import "./style.css";
import { Colouring } from "./colouring";
import { type Asked, Connection, kIsLocal } from "./connection";
import { grouped } from "./dom";
import { Header } from "./header";
import { helpDialog } from "./help";
import { listenToKeys } from "./keys";
import { Legend } from "./legend";
import { Notes } from "./notes";
import { Panel } from "./panel";
import { Pointer } from "./pointer";
import type { CloudHead, Hello, Message, Recipe, Result, TextureHead } from "./protocol";
import { simplified } from "./region";
import { ResultTexts } from "./result_texts";
import { Scene } from "./scene";
import { ShownLimits } from "./shown_limits";
import { Stage } from "./stage";
import { copyRecipe, defaultView, equalRecipes, History, type Mode, readFragment, type View, writeFragment } from "./state";
import { Status } from "./status";
import { Takeaway } from "./takeaway";
import { decodePictures } from "./textures";
import { given } from "./transport";
import { chooseFiles } from "./welcome";

const kUrlDelay = 250;
const kProtocol = 1;
const kToastOfNotes = 20000; // ms
const kSeenMotion = 2; // pixels; a typical move that is less does not show

class Page {
  private readonly view: View = defaultView();
  private readonly stage = new Stage(this.view, (done) => this.viewChanged(done), (files) => void this.upload(files));
  private readonly status = new Status(() => this.connection.cancel());
  private readonly legend = new Legend();
  private readonly notes = new Notes();
  private readonly help = helpDialog();
  private readonly actions = {
    setMode: (mode: Mode) => this.setMode(mode),
    undo: () => this.restore(this.history.undo()),
    redo: () => this.restore(this.history.redo()),
    fit: () => this.scene.fit(),
    screenshot: () => void this.takeaway.screenshot(this.cloud?.name ?? "cloud"),
    help: () => this.help.showModal(),
    hold: (original: boolean) => this.hold(original),
    nudge: (turn: [number, number], move: [number, number], zoom: number) => this.scene.nudge(turn, move, zoom),
    drawLasso: () => void this.drawLasso(),
    measure: () => this.pointer.measure(),
    open: () => chooseFiles((files) => void this.upload(files)),
    togglePanel: () => this.header.togglePanel(),
  };
  private readonly header = new Header(this.actions);
  private readonly scene = new Scene(this.stage.element, this.view);
  private readonly colouring = new Colouring(
    this.scene,
    this.legend,
    (name) => this.connection.send({ type: "colours", id: this.connection.nextId(), name }),
    () => this.connection.send({ type: "texture", id: this.connection.nextId() }),
    () => this.connection.send({ type: "noise", id: this.connection.nextId() }),
    () => this.connection.send({ type: "outliers", id: this.connection.nextId() }),
  );
  private readonly takeaway = new Takeaway(this.scene, this.stage, this.legend);
  private readonly texts = new ResultTexts(this.takeaway, this.stage, () => this.connection.busy || this.ask());
  private readonly limits = new ShownLimits(this.scene);
  private readonly pointer = new Pointer(this.scene, this.stage, this.colouring);
  private readonly connection: Connection;
  private panel: Panel | null = null;
  private hello: Hello | null = null;
  private cloud: CloudHead | null = null;
  private defaults: Recipe = { params: {}, limits: {} };
  private recipe: Recipe = { params: {}, limits: {} };
  private history = new History(this.recipe);
  private result: Result | null = null; // that is shown; null: the original is
  private held = false; // a key shows the original
  private isFirstLook = false; // nobody has said how the next result is shown
  private shownRecipe: Asked | null = null; // that the shown result came from
  private asked: Asked = { ...this.recipe, held: false, output: "", encoding: "" };
  private focus: number[] | undefined;
  private urlTimer = 0;
  private fresh: { kind: string; serverMs: number } | null = null; // displacements that the next frame shows first

  constructor() {
    document.body.append(this.header.element, this.stage.element, this.status.element, this.help);
    this.stage.element.prepend(this.scene.canvas);
    this.stage.add(this.legend.element, this.notes.element);
    this.scene.onCamera = () => {
      this.focus = undefined;
      this.writeUrl();
      if (this.view.colour === "displacement") this.colouring.apply(this.view.colour);
    };
    this.scene.frames.onShown = () => this.shown();
    this.scene.frames.onStill = (still) => (document.body.dataset.still = String(still));
    listenToKeys(this.scene.canvas, this.actions);
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
        this.scene.setPreview(arrays.places as Uint32Array, arrays.displacements as Float32Array, head.center, head.radius);
        this.fresh = { kind: "preview", serverMs: head.server_ms };
        return;
      case "result":
        if (!this.cloud) return;
        return this.setResult(head, arrays);
      case "settled":
        this.scene.setNormals(arrays.normals);
        return void (document.body.dataset.settled = "true");
      case "colours":
        return this.colouring.setColours(head.name, arrays);
      case "texture":
        return void this.setTexture(head, arrays);
      case "progress":
        return this.status.showProgress(head.stage, head.share);
      case "saved":
        this.status.hideProgress();
        if (arrays.file) this.takeaway.download(new Blob([arrays.file as Uint8Array<ArrayBuffer>]), head.path);
        document.body.dataset.saved = head.path;
        return this.stage.say([`Saved ${head.path}, ${grouped(head.bytes)} bytes`, ...head.notes].join(". Note: "), false,
          head.notes.length ? kToastOfNotes : undefined);
      case "cancelled":
        return this.noResult("Stopped.", false);
      case "taken":
        return this.stage.showHint("Another page has taken over this cloud. Reload to take it back.");
      case "error":
        this.status.hideProgress();
        document.body.dataset.error = head.message;
        if (this.cloud && head.id !== null && head.id === this.connection.lastRun) return this.noResult(head.message, true);
        if (!this.cloud) this.stage.welcome.ask();
        return this.stage.say(head.message, true);
    }
  }

  private greet(hello: Hello): void {
    if (hello.protocol !== kProtocol) return this.stage.say("This page belongs to another version of pointfair. Reload it.", true);
    this.stage.showHint("");
    if (!hello.has_cloud) this.stage.welcome.ask();
    document.body.classList.toggle("empty", !hello.has_cloud);
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
      save: (overwrite) => this.save(overwrite),
      copyCommand: () => this.texts.take("command", this.recipe),
      copyCpp: () => this.texts.take("cpp", this.recipe),
      copyLink: () => void this.takeaway.copy(location.href, "The link"),
    });
    document.body.append(this.panel.element);
    this.status.setDevice(hello.device);
  }

  private setCloud(head: CloudHead, arrays: Message["arrays"]): void {
    const again = this.cloud && this.cloud.name === head.name && this.cloud.points === head.points;
    if (!again) {
      const { recipe, view, hasLook } = readFragment(location.hash, head.name, this.defaults);
      Object.assign(this.view, view);
      this.isFirstLook = !hasLook;
      this.recipe = recipe;
      this.history = new History(recipe);
      this.panel!.forgetSnapshots();
    }
    this.cloud = head;
    this.result = this.shownRecipe = null;
    this.texts.setResult(null, this.asked);
    this.limits.forget();
    this.focus = undefined;
    this.scene.setCloud(head, arrays);
    this.colouring.setCloud(head);
    this.pointer.setCloud(head);
    this.panel!.setCloud(head, this.scene.hasFaces);
    this.panel!.show(this.recipe);
    this.header.setCloud(head);
    document.title = `${head.name} · pointfair`;
    document.body.dataset.cloud = head.name;
    this.stage.welcome.hide();
    this.header.setMode(this.view.mode);
    this.viewChanged(false);
    this.writeUrl();
    this.ask();
  }

  private setResult(head: Result, arrays: Message["arrays"]): void {
    const recipe = this.connection.askedBy(head.id) ?? this.asked;
    this.result = head;
    this.shownRecipe = recipe;
    this.texts.setResult(head, recipe);
    delete document.body.dataset.settled; // until this result has settled
    this.scene.setResult(head, arrays);
    this.panel!.setUsed(head, recipe);
    this.stage.showHint("");
    this.showSide();
    this.status.showResult(head, this.cloud!.points);
    this.colouring.setMoved(head.moved.rms);
    this.fresh = { kind: "result", serverMs: head.server_ms };
    if (this.isFirstLook) this.showDifference(head.moved.rms);
  }

  private async setTexture(head: TextureHead, arrays: Message["arrays"]): Promise<void> {
    const { cloud } = this;
    const { textures, notes } = await decodePictures(head, arrays, this.scene.mostOfSide);
    if (cloud !== this.cloud) return textures.forEach((texture) => texture?.dispose()); // another one has come
    this.scene.setTexture(arrays, textures);
    this.colouring.setTexture();
    document.body.dataset.pictures = String(textures.filter((texture) => texture).length);
    const missing = [...head.notes, ...notes];
    if (missing.length) this.stage.say(`Faces are drawn without what is missing. ${missing.join(". ")}.`, false, kToastOfNotes);
  }

  // The first view shows what the run did: original and result under a wipe, or where that is too little to be seen in the
  // picture, how far each point moved.
  private showDifference(rms: number): void {
    this.isFirstLook = false;
    if (!(rms > 0)) return;
    if (this.scene.pixels(rms) < kSeenMotion) this.view.colour = "displacement";
    else this.view.mode = "wipe";
    this.header.setMode(this.view.mode);
    this.viewChanged(true);
  }

  // A run failed or was stopped. What is shown is still the last result, so the parameters are those that it came from;
  // where there is none, the defaults are tried, and without a result of them only the original is there to see.
  private noResult(why: string, failed: boolean): void {
    this.status.hideProgress();
    this.scene.clearPreview();
    document.body.dataset.busy = "false";
    const ended = /[.!?]$/.test(why) ? why : `${why}.`;
    const known = this.shownRecipe && !equalRecipes(this.shownRecipe, this.asked) ? this.shownRecipe : null;
    const before = known ?? (failed && !equalRecipes(this.asked, this.defaults) ? this.defaults : null);
    if (!before) {
      if (this.shownRecipe) return this.stage.say(ended, failed);
      this.result = null;
      this.status.clear();
      this.showSide();
      return this.stage.showHint(failed ? `There is no result: ${ended}` : "Stopped. There is no result.");
    }
    this.stage.say(`${ended} The parameters are ${known ? "as before" : "the defaults"}.`, failed);
    this.history.revert(before);
    this.recipe = copyRecipe(before);
    this.showRecipe();
    if (!known) this.ask();
  }

  // A frame is on the screen. For tests and for whoever looks: how often there was one, and with new displacements.
  private shown(): void {
    const { dataset } = document.body;
    dataset.frames = String(Number(dataset.frames ?? 0) + 1);
    if (!this.fresh) return;
    dataset.updates = String(Number(dataset.updates ?? 0) + 1);
    dataset.rate = this.status.countUpdate(performance.now()).toFixed(1);
    dataset.last = this.fresh.kind;
    dataset.serverMs = this.fresh.serverMs.toFixed(2);
    dataset.busy = String(this.connection.busy);
    this.fresh = null;
  }

  // What the user does.

  private changeRecipe(recipe: Recipe, done: boolean): void {
    this.recipe = copyRecipe(recipe);
    if (done) this.history.keep(recipe);
    this.showRecipe();
    this.ask(!done);
  }

  private showRecipe(): void {
    this.panel?.show(this.recipe);
    this.header.setHistory(this.history.canUndo, this.history.canRedo);
    if (this.cloud) this.limits.show(this.recipe.limits, this.cloud);
    this.writeUrl();
  }

  private ask(held = false): void {
    if (!this.cloud || !this.panel) return;
    this.focus ??= this.scene.focus();
    this.asked = { ...copyRecipe(this.recipe), focus: this.focus, held, output: this.panel.outputName, encoding: this.panel.encodingName };
    document.body.dataset.busy = "true";
    this.texts.setAsked(this.asked);
    this.connection.run(this.asked);
  }

  private restore(recipe: Recipe | null): void {
    if (!recipe) return;
    this.recipe = recipe;
    this.showRecipe();
    this.ask();
  }

  private save(overwrite: boolean): void {
    this.connection.send({ type: "save", id: this.connection.nextId(), ...this.recipe,
      output: this.panel!.outputName, encoding: this.panel!.encodingName, overwrite });
    this.status.showProgress("saving", 0);
  }

  private async drawLasso(): Promise<void> {
    const outline = await this.stage.drawLasso();
    if (outline) this.setLasso(simplified(outline.map((corner) => this.scene.inPicture(corner, outline[0][0] < 0))));
  }

  private setLasso(polygon: [number, number][]): void {
    if (polygon.length < 3) return;
    const recipe = copyRecipe(this.recipe);
    recipe.limits.lasso = this.limits.lassoOf(polygon);
    this.changeRecipe(recipe, true);
  }

  private async upload(files: File[]): Promise<void> {
    const scan = given(files), { file, aside } = scan;
    if (aside.length) this.stage.say(`One cloud at a time: ${aside.map(({ name }) => name).join(", ")} left aside`);
    if (this.cloud) this.stage.say(`${kIsLocal ? "Reading" : "Sending"} ${file.name}…`);
    else this.stage.welcome.wait(`Reading ${file.name}…`);
    try {
      await this.connection.open(scan);
    } catch (error) {
      if (!this.cloud) this.stage.welcome.ask();
      this.stage.say((error as Error).message, true);
    }
  }

  // What is seen.

  private setMode(mode: Mode): void {
    this.view.mode = mode;
    this.header.setMode(mode);
    this.viewChanged(true);
  }

  private viewChanged(done: boolean): void {
    this.showSide();
    this.panel?.showView();
    if (this.cloud) this.limits.show(this.recipe.limits, this.cloud);
    this.scene.applyView();
    this.colouring.apply(this.view.colour);
    if (!done) return;
    this.isFirstLook = false;
    this.writeUrl();
  }

  private hold(original: boolean): void {
    this.held = original;
    this.showSide();
  }

  // Without a result, what is seen is the original, whatever the view.
  private showSide(): void {
    const original = this.held || !this.result;
    this.scene.hold(original);
    this.stage.showView(original);
    this.header.setResult(this.result !== null);
    this.notes.show(this.result?.notes ?? []);
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
    this.header.setMode(view.mode);
    this.changeRecipe(recipe, true);
    this.viewChanged(false);
  }

  private connectionChanged(state: "open" | "closed" | "taken"): void {
    document.body.dataset.connection = state;
    if (state === "closed") {
      this.cloud = null;
      this.pointer.setCloud(null);
      this.stage.showHint("The connection is lost. Connecting again…");
    }
  }
}

new Page();
