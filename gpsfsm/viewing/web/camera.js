// The view of a picture: which part of it is seen and how large, and how pointers, the wheel and
// fingers move it. What is pointed at comes from the picture itself.

import { prefersLessMotion } from "./dom.js";
import { isReadableFar } from "./overview.js";
import { viewOf } from "./paint.js";
import { emptyPicture } from "./picture.js";

/** @import { Group, Item } from "./picture.js" */

const FIT_PADDING = 16;
const BUTTONS = { width: 400, height: 40 }; // pixels at the top right of a pane, which pictures keep clear of
const BUTTONS_AIR = 4; // pixels below them
const LARGEST_FIT = 1.15;
export const GOOD_TO_READ = 0.75; // letters are 9 pixels high
const FAIR_TO_READ = 0.7; // a smaller picture is not shown as a whole
const NUDGE_MARGIN = 50; // pixels
const SMALLEST_TARGET = 5; // pixels
const SMALLEST = 0.02;
const LARGEST = 3;
const ANIMATION_MS = 160;
const STILL = 4; // pixels that a pointer may move while it taps
const DOUBLE_TAP_MS = 300;
const WHEEL_STEP = 0.0018; // per pixel
const PINCH_STEP = 0.01; // on a touchpad, which tells of it as a wheel
const WHEEL_LINE = 16; // pixels

// The camera of one pane. `box` is the pane, `touch` the element in it that takes pointers.
// hooks: onChange(), onHover(target), onTap(target, point), onDoubleTap(target)
//   target: an item or an open group of the picture, null for the ground; point: in the picture
export class GraphCamera {
  constructor(box, touch, hooks) {
    this.box = box;
    this.touch = touch;
    this.hooks = hooks;
    this.picture = emptyPicture();
    this.pan = { x: 0, y: 0 };
    this.zoom = 1;
    this.fitted = false; // whether all of the picture is in view, and is to stay so
    this.opened = false; // whether nothing has moved the view since it was opened
    this.onPaper = false; // where no buttons are
    this.held = false; // whether somebody has moved it: then it follows no run
    this.reopen = () => this.openView(); // when the pane gets another size then
    this.animation = 0;
    this.pointers = new Map(); // those that are down, by their numbers
    /** @type {Item | Group | null} */
    this.hovered = null;
    /** @type {{at: number, target: Item | Group | null}} */
    this.lastTap = { at: -Infinity, target: null };
    this.listen();
  }

  // Another picture; the view stays where it is.
  setPicture(picture) {
    this.picture = picture;
    this.hovered = null;
  }

  viewNow() {
    return viewOf(this.pan, this.zoom, this.box.clientWidth, this.box.clientHeight);
  }

  // All of it if that can be read, or if it is large and the names of its blocks can; else its beginning.
  openView() {
    this.fit(false);
    this.opened = true;
    const { zoom, picture, box } = this;
    if (zoom >= FAIR_TO_READ || isReadableFar(picture, zoom) || !box.clientHeight) return;
    this.openAt(Math.max(GOOD_TO_READ, Math.min(0.9, (box.clientWidth - 2 * FIT_PADDING) / picture.width)));
  }

  // Its beginning in this size.
  openAt(zoom) {
    const { items, width, height } = this.picture;
    const first = items.find(({ kind }) => kind === "start") || items[0];
    if (!first) return;
    const { clientWidth, clientHeight } = this.box;
    const top = this.topPadding(zoom);
    const left = (clientWidth - width * zoom) / 2;
    const x = left > 0 ? left : Math.max(2 * left - FIT_PADDING, Math.min(FIT_PADDING, clientWidth / 2 - (first.box.x + first.box.width / 2) * zoom));
    // As in machines.
    const isBelow = first.box.y * zoom > clientHeight / 2;
    const y = isBelow ? Math.max(clientHeight - FIT_PADDING - height * zoom, clientHeight / 2 - first.box.y * zoom) : top;
    this.moveTo({ zoom, pan: { x, y } }, false);
    this.fitted = false;
  }

  fit(animate = true) {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    if (!width || !height) return;
    const across = (width - 2 * FIT_PADDING) / this.picture.width;
    const zoomBelow = (top) => Math.min(LARGEST_FIT, across, (height - top - FIT_PADDING) / this.picture.height);
    const top = this.topPadding(zoomBelow(FIT_PADDING));
    const zoom = zoomBelow(top);
    const room = height - top - FIT_PADDING;
    const pan = { x: (width - this.picture.width * zoom) / 2, y: top + (room - this.picture.height * zoom) / 2 };
    this.moveTo({ zoom, pan }, animate);
    this.fitted = true;
    this.opened = this.held = false;
  }

  // Below the buttons where a picture of this size reaches under them.
  topPadding(zoom) {
    const isUnder = (this.box.clientWidth + this.picture.width * zoom) / 2 > this.box.clientWidth - BUTTONS.width;
    return isUnder && !this.onPaper ? BUTTONS.height + BUTTONS_AIR : FIT_PADDING;
  }

  moveTo(view, animate) {
    cancelAnimationFrame(this.animation);
    if (animate && !prefersLessMotion()) this.animateTo(view);
    else this.setView(view);
  }

  setView({ zoom, pan }) {
    this.zoom = Math.min(LARGEST, Math.max(SMALLEST, zoom));
    this.pan = pan;
    this.hooks.onChange();
  }

  animateTo(view) {
    const from = { zoom: this.zoom, pan: this.pan };
    const since = performance.now();
    const between = (one, other, share) => one + (other - one) * share;
    const tick = (now) => {
      const share = Math.min(1, Math.max(0, (now - since) / ANIMATION_MS));
      this.setView({
        zoom: between(from.zoom, view.zoom, share),
        pan: { x: between(from.pan.x, view.pan.x, share), y: between(from.pan.y, view.pan.y, share) },
      });
      if (share < 1) this.animation = requestAnimationFrame(tick);
    };
    this.animation = requestAnimationFrame(tick);
  }

  // Into the middle, large enough to be read.
  showBox(box, least = 0.9) {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    const fitting = Math.min((width - 80) / box.width, (height - 80) / box.height);
    const zoom = Math.min(Math.max(this.zoom, least), Math.max(0.05, fitting), 1.3);
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    this.release();
    this.moveTo({ zoom, pan: { x: width / 2 - x * zoom, y: height / 2 - y * zoom } }, true);
  }

  // As little movement as is needed to see the box; none if it is in view.
  nudgeTo(box) {
    const view = this.viewNow();
    const margin = NUDGE_MARGIN / view.zoom;
    const shift = (low, high, from, to) => {
      if (low >= from && high <= to) return 0;
      return low < from ? from + margin - low : to - margin - high;
    };
    const across = shift(box.x, box.x + box.width, view.left, view.right);
    // Above are buttons, below is the legend.
    const edge = BUTTONS.height / view.zoom;
    const along = shift(box.y, box.y + box.height, view.top + edge, view.bottom - edge);
    if (!across && !along) return;
    this.release();
    const pan = { x: view.pan.x + across * view.zoom, y: view.pan.y + along * view.zoom };
    this.moveTo({ zoom: view.zoom, pan }, true);
  }

  // Around a point of the pane, by default its middle.
  zoomBy(factor, at = { x: this.box.clientWidth / 2, y: this.box.clientHeight / 2 }) {
    const zoom = Math.min(LARGEST, Math.max(SMALLEST, this.zoom * factor));
    const scale = zoom / this.zoom;
    const pan = { x: at.x - (at.x - this.pan.x) * scale, y: at.y - (at.y - this.pan.y) * scale };
    this.hold();
    this.moveTo({ zoom, pan }, false);
  }

  moveBy(x, y) {
    this.hold();
    this.moveTo({ zoom: this.zoom, pan: { x: this.pan.x + x, y: this.pan.y + y } }, false);
  }

  // Keeps what stood at one place of the picture where it is seen, though it is elsewhere now.
  keep(before, after) {
    this.moveBy((before.x - after.x) * this.zoom, (before.y - after.y) * this.zoom);
  }

  // It shows a part of the picture that was chosen.
  release() {
    this.fitted = this.opened = false;
  }

  // Somebody moves it by hand.
  hold() {
    this.release();
    this.held = true;
  }

  // Shows what happens in a run that goes on, unless somebody looks elsewhere.
  follow(box) {
    if (!this.held && !this.fitted) this.nudgeTo(box);
  }

  resized() {
    if (this.opened) this.reopen();
    else if (this.fitted) this.fit(false);
    else this.hooks.onChange();
  }

  destroy() {
    cancelAnimationFrame(this.animation);
  }

  // -- pointers

  listen() {
    const { touch } = this;
    touch.addEventListener("pointerdown", (event) => this.pointerDown(event));
    touch.addEventListener("pointermove", (event) => this.pointerMove(event));
    touch.addEventListener("pointerup", (event) => this.pointerUp(event));
    touch.addEventListener("pointercancel", (event) => this.pointers.delete(event.pointerId));
    touch.addEventListener("pointerleave", () => this.hover(null));
    touch.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  // Where an event is in the pane.
  placeOf(event) {
    const { left, top } = this.touch.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  }

  pointerDown(event) {
    if (event.pointerType === "mouse" && event.button !== 0) return;
    this.touch.setPointerCapture(event.pointerId);
    const at = this.placeOf(event);
    for (const pointer of this.pointers.values()) pointer.isTap = false;
    this.pointers.set(event.pointerId, { from: at, at, isTap: !this.pointers.size });
  }

  pointerMove(event) {
    const pointer = this.pointers.get(event.pointerId);
    const at = this.placeOf(event);
    if (!pointer) {
      this.hover(this.targetAt(this.inPicture(at)));
      return;
    }
    if (pointer.isTap && Math.hypot(at.x - pointer.from.x, at.y - pointer.from.y) <= STILL) return;
    pointer.isTap = false;
    const before = pointer.at;
    pointer.at = at;
    const other = [...this.pointers.values()].find((one) => one !== pointer);
    if (other) this.pinch(before, at, other.at);
    else this.moveBy(at.x - before.x, at.y - before.y);
  }

  // One finger has moved, the other one stands still.
  pinch(before, now, other) {
    const span = (one) => Math.max(1, Math.hypot(one.x - other.x, one.y - other.y));
    this.moveBy((now.x - before.x) / 2, (now.y - before.y) / 2);
    this.zoomBy(span(now) / span(before), { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 });
  }

  pointerUp(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!pointer || !pointer.isTap) return;
    const point = this.inPicture(pointer.at);
    const target = this.targetAt(point);
    const isSecond = event.timeStamp - this.lastTap.at < DOUBLE_TAP_MS && target === this.lastTap.target;
    this.lastTap = { at: isSecond ? -Infinity : event.timeStamp, target };
    this.hooks.onTap(target, point);
    if (isSecond && target) this.hooks.onDoubleTap(target);
  }

  wheel(event) {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode ? WHEEL_LINE : 1);
    const step = event.ctrlKey ? PINCH_STEP : WHEEL_STEP;
    this.zoomBy(Math.exp(-Math.max(-300, Math.min(300, pixels)) * step), this.placeOf(event));
  }

  hover(target) {
    if (target === this.hovered) return;
    this.hovered = target;
    this.touch.classList.toggle("on-target", Boolean(target));
    this.hooks.onHover(target);
  }

  inPicture({ x, y }) {
    return { x: (x - this.pan.x) / this.zoom, y: (y - this.pan.y) / this.zoom };
  }

  // What is drawn on top at a point: an item, or the innermost open group; what is too small to be
  // met is no target.
  targetAt(point) {
    const least = SMALLEST_TARGET / this.zoom;
    const isMet = ({ box }) =>
      box.height >= least && point.x >= box.x && point.x <= box.x + box.width &&
      point.y >= box.y && point.y <= box.y + box.height;
    const item = this.picture.items.find(isMet);
    if (item) return item;
    const [inner = null] = this.picture.groups.filter(isMet).sort((one, other) => other.depth - one.depth);
    return inner;
  }
}
