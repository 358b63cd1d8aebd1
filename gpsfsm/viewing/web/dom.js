// Small helpers to build the page, and the signs of its buttons. Text of plans only ever goes through textContent.

const SVG_NAMESPACE = "http://www.w3.org/2000/svg";

function isText(value) {
  return typeof value === "string" || typeof value === "number";
}

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on") && typeof value === "function") {
      node.addEventListener(name.slice(2), value);
    } else if (name === "dataset") {
      Object.assign(node.dataset, value);
    } else if (name === "class") {
      node.setAttribute("class", Array.isArray(value) ? value.filter(Boolean).join(" ") : value);
    } else {
      node.setAttribute(name, value === true ? "" : String(value));
    }
  }
  append(node, children);
  return node;
}

function append(node, children) {
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    if (Array.isArray(child)) append(node, child);
    else node.append(isText(child) ? document.createTextNode(String(child)) : child);
  }
}

// el("button", {class: "x", onclick: fn, "aria-label": "…"}, "text", otherElement, …)
// Attributes that are null, undefined or false are left out; true is an empty attribute.
export function el(tag, attributes, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

// The same for SVG elements: svg("path", {d: "…"}).
export function svg(tag, attributes, ...children) {
  return fill(document.createElementNS(SVG_NAMESPACE, tag), attributes, children);
}

// Takes everything out of a node and puts the children in.
export function replaceContent(node, ...children) {
  node.textContent = "";
  append(node, children);
  return node;
}

// Tells of failures that nobody has caught. That a size is observed a frame later is none, though
// browsers report it as one.
export function onFailure(tell) {
  addEventListener("error", (event) => {
    if (event.error || !event.message.startsWith("ResizeObserver loop")) tell(event.message);
  });
  addEventListener("unhandledrejection", (event) => tell(String(event.reason)));
}

// Calls `draw` at most once per frame, however often the result is called.
export function oncePerFrame(draw) {
  let isWaiting = false;
  return () => {
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => {
      isWaiting = false;
      draw();
    });
  };
}

// Calls `work` when nothing was asked for during `wait` milliseconds.
export function debounce(work, wait) {
  let timer = 0;
  return (...values) => {
    clearTimeout(timer);
    timer = setTimeout(() => work(...values), wait);
  };
}

// Cuts a text to `length` characters; the last one is then an ellipsis.
export function clipText(text, length) {
  const points = Array.from(text.slice(0, 2 * length + 2));
  return points.length <= length ? text : points.slice(0, length - 1).join("") + "…";
}

// A path of which, where there is no room, the beginning is left out: its end says which file it is.
export function pathWords(path) {
  return el("bdi", { dir: "ltr" }, visibleText(path));
}

// The same as text, for what cannot hold elements.
export function clipPath(path, length) {
  const points = Array.from(path.slice(-2 * length - 2));
  return points.length <= length ? path : "…" + points.slice(1 - length).join("");
}

// "1 runner", "2 runners"
export function counted(number, word, plural) {
  return `${grouped(number)} ${number === 1 ? word : plural || word + "s"}`;
}

// "12,345"; what browsers have for this takes long when it is first called.
export function grouped(number) {
  return String(number).replace(/\B(?=(\d{3})+$)/g, ",");
}

// Whether the user asked the system for less motion.
export function prefersLessMotion() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

// The value of a custom property of the theme, for canvases.
export function themeColor(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

const INVISIBLE = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]/gu;

// A text whose control characters and signs of direction can be seen, so that they cannot hide
// or turn around what stands beside them.
export function visibleText(text) {
  return text.replace(INVISIBLE, (sign) => {
    const code = sign.codePointAt(0).toString(16).toUpperCase().padStart(4, "0");
    return `‹U+${code}›`;
  });
}

// -- signs of buttons, drawn: not every font has them, and some have them in colours ------------

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
