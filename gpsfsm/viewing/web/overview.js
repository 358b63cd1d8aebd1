// What is seen of a picture from far away. Nothing there can be read at its own size, so controls that
// are small on the screen are blocks, with their name and with the worst that is reported inside; larger ones
// are borders with their name. And the overview of a picture that is larger than its pane: a small map
// with the part that is in view, to be dragged or moved by keys.

import { counted, el, oncePerFrame } from "./dom.js";
import { FONT, addBox, graphColors, inView, paintRun, paintStill, viewOf } from "./paint.js";
import { CONTROL_SIGNS } from "./words.js";

const SMALL_CONTROL = { width: 150, height: 110 }; // pixels: a smaller control is one block
const BLOCK_NAME = { size: 11, letter: 6.2, line: 14, least: 3 };
const WORST_FIRST = ["error", "warning", "info"];

// -- blocks -------------------------------------------------------------------------------------

// The outermost controls that are too small to be looked into: {blocks: [group], hiding: group number ->
// block}. Their order is that of the picture.
export function blocksOf(picture, zoom) {
  const hiding = new Map();
  const blocks = [];
  for (const group of picture.groups) {
    const around = hiding.get(group.parent);
    if (around !== undefined) {
      hiding.set(group.group, around);
    } else if (group.box.width * zoom < SMALL_CONTROL.width && group.box.height * zoom < SMALL_CONTROL.height) {
      hiding.set(group.group, blocks.length);
      blocks.push({ ...group, runners: 0, severity: "" });
    }
  }
  const rank = (severity) => (WORST_FIRST.indexOf(severity) + 4) % 4; // none is the last
  const note = (block, severity) => {
    if (severity && (!block.severity || rank(severity) < rank(block.severity))) block.severity = severity;
  };
  for (const group of picture.groups) if (hiding.has(group.group)) note(blocks[hiding.get(group.group)], group.finding);
  for (const item of picture.items) {
    const block = blocks[hiding.get(item.parent) ?? -1];
    if (!block) continue;
    block.runners += item.kind === "runner" ? 1 : item.inside.length;
    note(block, item.finding);
  }
  return { blocks, hiding };
}

// Kept per picture and zoom, since a picture is painted often.
const cuts = new WeakMap();

function cutAt(picture, zoom) {
  const kept = cuts.get(picture);
  if (kept && kept.zoom === zoom) return kept;
  const { blocks, hiding } = blocksOf(picture, zoom);
  const blockOf = (item) => hiding.get(picture.items[item]?.parent) ?? -1;
  const edges = picture.edges.filter(({ source, target }) => {
    const around = blockOf(source);
    return around < 0 || around !== (target < 0 ? around : blockOf(target));
  });
  const items = picture.items.filter((item) => !hiding.has(item.parent));
  const groups = picture.groups.filter((group) => !hiding.has(group.group));
  const cut = { zoom, blocks, picture: { ...picture, edges, items, groups } };
  cuts.set(picture, cut);
  return cut;
}

export function paintFar(context, picture, view, colors) {
  const { blocks, picture: outside } = cutAt(picture, view.zoom);
  paintStill(context, outside, view, colors);
  const seen = blocks.filter((block) => inView(block.box, view));
  context.lineWidth = 1 / view.zoom;
  context.beginPath();
  for (const block of seen) addBox(context, block.box);
  context.fillStyle = colors["--graph-folded"];
  context.fill();
  context.strokeStyle = colors["--graph-line"];
  context.stroke();
  for (const severity of [...WORST_FIRST].reverse()) {
    context.beginPath();
    for (const { severity: worst, box } of seen) {
      const size = Math.min(6 / view.zoom, box.width / 3, box.height / 3);
      if (worst === severity) context.rect(box.x + box.width - size, box.y, size, size);
    }
    context.fillStyle = colors[`--${severity}`];
    context.fill();
  }
  paintNames(context, [...seen, ...outside.groups.filter((group) => inView(group.box, view))], view, colors);
}

// Names have one size on the screen, and stand only where there is room for them.
function paintNames(context, groups, view, colors) {
  const scale = 1 / view.zoom;
  context.save();
  context.font = `${BLOCK_NAME.size * scale}px ${FONT}`;
  context.textAlign = "left";
  context.lineJoin = "round";
  context.lineWidth = 3 * scale;
  context.strokeStyle = colors["--graph-paper"];
  const taken = [];
  for (const group of groups) {
    const { x, y, width, height } = group.box;
    const letters = Math.floor((width * view.zoom - 8) / BLOCK_NAME.letter);
    if (letters < BLOCK_NAME.least || height * view.zoom < BLOCK_NAME.line + 2) continue;
    const lines = [shortLabel(group.label, letters)];
    const inside = counted(group.runners, "runner");
    if (group.runners && height * view.zoom > 2 * BLOCK_NAME.line + 4) lines.push(inside.length <= letters ? inside : `▸ ${group.runners}`);
    const room = { x, y, right: x + width, bottom: y + lines.length * BLOCK_NAME.line * scale };
    const isFree = (one) => room.x >= one.right || one.x >= room.right || room.y >= one.bottom || one.y >= room.bottom;
    if (!taken.every(isFree)) continue;
    taken.push({ ...room, right: Math.min(room.right, x + (8 + BLOCK_NAME.letter * Math.min(letters, group.label.length)) * scale) });
    lines.forEach((line, place) => {
      const text = line.length > letters ? `${line.slice(0, letters - 1)}…` : line;
      const at = [x + 4 * scale, y + (12 + place * BLOCK_NAME.line) * scale];
      context.strokeText(text, ...at);
      context.fillStyle = colors[place ? "--graph-soft" : "--graph-text"];
      context.fillText(text, ...at);
    });
  }
  context.restore();
}

// "∥∗ “look” (line 5)", or only "look", or "line 5", where there is no room for more.
function shortLabel(label, letters) {
  const [word] = label.split(" ", 1);
  const signed = CONTROL_SIGNS[word] ? CONTROL_SIGNS[word] + label.slice(word.length) : label;
  const [, name = signed] = /“(.+)”/.exec(label) || /\((line \d+)\)$/.exec(label) || [];
  return [label, signed].find((text) => text.length <= letters) ?? name;
}

// -- the overview -------------------------------------------------------------------------------

const MINIMAP = { width: 180, height: 150, air: 4 };
const MAP_KEYS = { ArrowLeft: [-0.5, 0], ArrowRight: [0.5, 0], ArrowUp: [0, -0.5], ArrowDown: [0, 0.5] };

// mountMinimap(pane) -> {element, show(picture), setRun(states, taken), move, recolor}; pane: {camera, box}
export function mountMinimap(pane) {
  const canvas = el("canvas", { class: "minimap-canvas", "aria-hidden": "true" });
  const frame = el("div", { class: "minimap-frame" });
  const element = el(
    "div",
    {
      class: "minimap", tabindex: "0", role: "group", hidden: true,
      "aria-label": "Overview: drag to move the view, or use the arrow keys",
    },
    canvas, frame,
  );
  /** @type {{picture: any, states: Map<number, any>, zoom: number, dragging: boolean, room: number[]}} */
  const shared = { picture: null, states: new Map(), zoom: 1, dragging: false, room: [] };

  const draw = oncePerFrame(() => {
    const { picture } = shared;
    if (!picture || element.hidden) return;
    shared.room = roomNow();
    const [most, high] = shared.room;
    shared.zoom = Math.min((most - 2 * MINIMAP.air) / picture.width, (high - 2 * MINIMAP.air) / picture.height);
    const [width, height] = [picture.width * shared.zoom + 2 * MINIMAP.air, picture.height * shared.zoom + 2 * MINIMAP.air];
    const ratio = Math.min(2, devicePixelRatio || 1);
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
    const context = canvas.getContext("2d");
    const scale = shared.zoom * ratio;
    context.setTransform(scale, 0, 0, scale, MINIMAP.air * ratio, MINIMAP.air * ratio);
    const view = { ...viewOf({ x: MINIMAP.air, y: MINIMAP.air }, shared.zoom, width, height), far: true };
    const colors = graphColors();
    paintStill(context, picture, view, colors);
    paintRun(context, picture, view, colors, { states: shared.states, taken: new Set(), isShown: shared.states.size > 0 });
    place();
  });

  // A small pane has a small map, which hides less of it.
  const roomNow = () => {
    const { clientWidth, clientHeight } = pane.box;
    return [Math.min(MINIMAP.width, Math.round(clientWidth / 4)), Math.min(MINIMAP.height, Math.round(clientHeight / 4))];
  };

  // Where the view is, in the map.
  function place() {
    const { left, top, right, bottom } = pane.camera.viewNow();
    const { picture, zoom } = shared;
    const within = (value, most) => MINIMAP.air + Math.max(0, Math.min(value, most)) * zoom;
    const [x, y] = [within(left, picture.width), within(top, picture.height)];
    frame.style.left = `${x}px`;
    frame.style.top = `${y}px`;
    frame.style.width = `${Math.max(4, within(right, picture.width) - x)}px`;
    frame.style.height = `${Math.max(4, within(bottom, picture.height) - y)}px`;
  }

  // It is there as long as some of the picture is out of view.
  const move = () => {
    const { picture } = shared;
    if (!picture) return;
    const { left, top, right, bottom } = pane.camera.viewNow();
    const isWhole = left <= 0 && top <= 0 && right >= picture.width && bottom >= picture.height;
    const isHidden = isWhole || !picture.items.length || pane.box.clientWidth < 2.4 * MINIMAP.width || pane.box.clientHeight < 2 * MINIMAP.height;
    const appears = element.hidden && !isHidden;
    if (element.hidden !== isHidden && document.activeElement !== element) element.hidden = isHidden;
    if (appears || String(roomNow()) !== String(shared.room)) draw();
    else if (!element.hidden) place();
  };

  function goTo(event) {
    const { left, top } = canvas.getBoundingClientRect();
    const [x, y] = [(event.clientX - left - MINIMAP.air) / shared.zoom, (event.clientY - top - MINIMAP.air) / shared.zoom];
    centre(x, y);
  }

  function centre(x, y) {
    const { camera, box } = pane;
    camera.hold();
    camera.moveTo({ zoom: camera.zoom, pan: { x: box.clientWidth / 2 - x * camera.zoom, y: box.clientHeight / 2 - y * camera.zoom } }, false);
  }

  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    shared.dragging = true;
    element.setPointerCapture(event.pointerId);
    goTo(event);
    event.stopPropagation();
  });
  element.addEventListener("pointermove", (event) => shared.dragging && goTo(event));
  for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, () => (shared.dragging = false));
  element.addEventListener("blur", move);
  element.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const { left, top, right, bottom } = pane.camera.viewNow();
    const by = MAP_KEYS[event.key];
    const end = { Home: 0, End: 1 }[event.key];
    if (by) centre((left + right) / 2 + by[0] * (right - left), (top + bottom) / 2 + by[1] * (bottom - top));
    else if (end !== undefined) centre(end * shared.picture.width, end * shared.picture.height);
    else return;
    event.preventDefault();
    event.stopPropagation();
  });

  return {
    element,
    show(picture) {
      shared.picture = picture;
      move();
      draw();
    },
    setRun(states) {
      shared.states = states || new Map();
      draw();
    },
    move,
    recolor: draw,
  };
}
