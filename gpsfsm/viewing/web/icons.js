// Signs of buttons, drawn: not every font has them, and some have them in colours.

import { svg } from "./dom.js";

const ICON_SHAPES = {
  start: "M3 3h2v10H3z M13 3v10L6 8z",
  back: "M11 3v10L4 8z",
  play: "M4 2.5v11l9-5.5z",
  pause: "M4 3h3v10H4z M9 3h3v10H9z",
  on: "M5 3v10l7-5z",
  end: "M3 3v10l7-5z M11 3h2v10h-2z",
  step: "M3 3h2v10H3z M7 3v10l7-5z",
  stop: "M4 4h8v8H4z",
  now: "M8 4a4 4 0 1 1 0 8a4 4 0 1 1 0-8z",
  fail: "M4 3l4 4 4-4 1 1-4 4 4 4-1 1-4-4-4 4-1-1 4-4-4-4z",
};

export function sign(name) {
  const shape = svg("path", { d: ICON_SHAPES[name], fill: "currentColor" });
  return svg("svg", { class: "icon", viewBox: "0 0 16 16", width: 14, height: 14, "aria-hidden": "true" }, shape);
}
