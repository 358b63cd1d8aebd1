// The three canvases of a picture: what stands still, the states of a run, and what is selected or
// pointed at. Each is drawn only when it has changed, and states of which a step changes few only in
// part, so that runs of large plans can be stepped as fast as the screen is drawn.

import { debounce, el, oncePerFrame } from "./dom.js";
import { isFar, paintFar } from "./overview.js";
import { LARGE_FROM, graphColors, paintPicture, paintPointers, paintRun } from "./paint.js";

const REST_MS = 70;
const REDRAW_EACH_MS = 250;
const BEST_RATIO = 2;
const PAPER_ZOOM = 0.7; // names are printed however small they are: paper is looked at from near

function newCanvas() {
  return el("canvas", { class: "graph-canvas", "aria-hidden": "true" });
}

// new GraphScreen(box, pointers): `pointers()` tells what is selected and pointed at, see graph.js.
export class GraphScreen {
  constructor(box, pointers) {
    this.box = box;
    this.pointers = pointers;
    this.layers = { still: newCanvas(), run: newCanvas(), top: newCanvas() };
    this.dirty = { still: true, run: true, top: true };
    this.picture = null;
    this.camera = null;
    this.colors = null;
    this.drawnView = null; // the view for which the canvases were drawn
    this.drawnAt = 0;
    this.destroyed = false;
    this.onPaper = false;
    this.forgetRun();
    this.draw = oncePerFrame(() => this.paint());
    this.rest = debounce(() => this.redraw(), REST_MS);
  }

  get elements() {
    return Object.values(this.layers);
  }

  setPicture(picture) {
    this.picture = picture;
    this.redraw();
  }

  // states: Map(item -> {state, count}) or null if no run is shown; taken: Set(drawn edge)
  setRun(states, taken) {
    this.states = states;
    this.taken = taken;
    this.dirty.run = true;
    this.dirty.top = true; // the signs of what is selected
    this.draw();
  }

  forgetRun() {
    this.states = null;
    this.taken = new Set();
    this.painted = null; // what of the run is on its canvas
  }

  pointersChanged() {
    this.dirty.top = true;
    this.draw();
  }

  redraw() {
    this.dirty = { still: true, run: true, top: true };
    this.painted = null;
    this.draw();
  }

  recolor() {
    this.colors = null;
    this.redraw();
  }

  viewChanged() {
    // Large ones are moved while the view moves, and drawn when it rests.
    const isLarge = this.picture && this.picture.items.length >= LARGE_FROM;
    if (!isLarge || !this.drawnView || performance.now() - this.drawnAt > REDRAW_EACH_MS) {
      this.redraw();
      return;
    }
    this.isMoved = true;
    this.draw();
    this.rest();
  }

  paint() {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    if (!width || !height || !this.camera || this.destroyed) return;
    if (!this.colors) this.colors = graphColors();
    if (this.onPaper) {
      this.paintPaper(width, height);
      return;
    }
    const view = this.camera.viewNow();
    view.far = isFar(this.picture, view.zoom);
    if (this.isMoved && !this.dirty.still) {
      this.moveCanvases(view);
      return;
    }
    const isMoved = !this.drawnView || this.drawnView.zoom !== view.zoom ||
      this.drawnView.pan.x !== view.pan.x || this.drawnView.pan.y !== view.pan.y;
    if (isMoved || this.isMoved) this.dirty = { still: true, run: true, top: true };
    if (this.dirty.still) this.paintStill(view, width, height);
    if (this.dirty.run) this.paintRunLayer(view, width, height);
    if (this.dirty.top) {
      const context = this.prepared(this.layers.top, width, height, view);
      paintPointers(context, this.picture, view, this.colors, { ...this.pointers(), states: this.states });
    }
    this.dirty = { still: false, run: false, top: false };
  }

  // On paper all is drawn on the first canvas: to clear one wipes out what lies below it there.
  paintPaper(width, height) {
    const now = this.camera.viewNow();
    const context = this.prepared(this.layers.still, width, height, now);
    this.layers.still.style.transform = "";
    const view = { ...now, far: isFar(this.picture, now.zoom) };
    if (view.far) {
      paintFar(context, this.picture, view, this.colors || graphColors());
      return;
    }
    const nothing = { selected: new Set(), hoveredItems: new Set(), near: new Set(), element: -1, hovered: -1 };
    this.paintAll(context, now, nothing);
  }

  // All of it with one pen, with names; of what is pointed at and selected, some may be left out.
  paintAll(context, now, without) {
    if (!this.colors) this.colors = graphColors();
    const view = { ...now, zoom: Math.max(now.zoom, PAPER_ZOOM) };
    paintPicture(context, this.picture, view, this.colors);
    paintRun(context, this.picture, view, this.colors, {
      states: this.states || new Map(), taken: this.taken, isShown: this.states !== null,
    });
    paintPointers(context, this.picture, view, this.colors, { ...this.pointers(), states: this.states, ...without });
  }

  paintStill(view, width, height) {
    this.isMoved = false;
    for (const canvas of this.elements) canvas.style.transform = "";
    const paint = view.far ? paintFar : paintPicture;
    paint(this.prepared(this.layers.still, width, height, view), this.picture, view, this.colors);
    this.drawnView = { ...view, pan: { ...view.pan } };
    this.drawnAt = performance.now();
    this.painted = null;
  }

  paintRunLayer(view, width, height) {
    const { states, taken } = this;
    const step = view.far && this.painted && states ? this.stepFrom(this.painted) : null;
    if (step) {
      const context = this.layers.run.getContext("2d");
      paintRun(context, this.picture, view, this.colors, step);
    } else {
      const context = this.prepared(this.layers.run, width, height, view);
      paintRun(context, this.picture, view, this.colors, { states: states || new Map(), taken, isShown: states !== null });
    }
    this.painted = states ? { states: new Map(states), taken: new Set(taken) } : null;
  }

  // What has come since, or null if something went, which has to be wiped out.
  stepFrom({ states, taken }) {
    for (const edge of taken) if (!this.taken.has(edge)) return null;
    for (const item of states.keys()) if (!this.states.has(item)) return null;
    const changed = [...this.states].filter(([item, { state }]) => states.get(item)?.state !== state);
    return {
      states: new Map(changed),
      taken: new Set([...this.taken].filter((edge) => !taken.has(edge))),
      isShown: true,
    };
  }

  // What is drawn already, where it belongs in the view of now.
  moveCanvases(view) {
    const scale = view.zoom / this.drawnView.zoom;
    const x = view.pan.x - this.drawnView.pan.x * scale;
    const y = view.pan.y - this.drawnView.pan.y * scale;
    for (const canvas of this.elements) {
      canvas.style.transformOrigin = "0 0";
      canvas.style.transform = `translate(${x}px, ${y}px) scale(${scale})`;
    }
  }

  prepared(canvas, width, height, view) {
    const ratio = Math.min(BEST_RATIO, devicePixelRatio || 1);
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    const scale = ratio * view.zoom;
    context.setTransform(scale, 0, 0, scale, ratio * view.pan.x, ratio * view.pan.y);
    return context;
  }
}
