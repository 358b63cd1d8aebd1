// A bar between two panes that can be dragged, or moved with the arrow keys.

import { el } from "./dom.js";

const LEAST = 160;
const KEY_STEP = 24;

// mountSplitter(panes, property, direction): it sets a custom property of `panes`, the width of the
// pane before (direction 1) or after (-1) the bar.
export function mountSplitter(panes, property, direction) {
  const bar = el("div", {
    class: "splitter", role: "separator", tabindex: "0", "aria-orientation": "vertical",
    "aria-label": direction > 0 ? "Width of the left pane" : "Width of the right pane",
  });
  const pane = () => (direction > 0 ? bar.previousElementSibling : bar.nextElementSibling);
  const resize = (width) => {
    const most = panes.clientWidth - 2 * LEAST - 20;
    panes.style.setProperty(property, `${Math.round(Math.max(LEAST, Math.min(most, width)))}px`);
  };
  bar.addEventListener("pointerdown", (event) => {
    const begun = { x: event.clientX, width: pane().clientWidth };
    bar.setPointerCapture(event.pointerId);
    const move = (moved) => resize(begun.width + direction * (moved.clientX - begun.x));
    bar.addEventListener("pointermove", move);
    bar.addEventListener("lostpointercapture", () => bar.removeEventListener("pointermove", move), { once: true });
    event.preventDefault();
  });
  bar.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -KEY_STEP, ArrowRight: KEY_STEP }[event.key];
    if (!step) return;
    event.preventDefault();
    resize(pane().clientWidth + direction * step);
  });
  bar.addEventListener("dblclick", () => panes.style.removeProperty(property));
  return bar;
}
