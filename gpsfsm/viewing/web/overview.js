// What is seen of a picture from far away. Nothing there can be read at its own size, so controls that
// are small on the screen are blocks, with their name and with the worst that is reported inside; larger ones
// are borders with their name. And the overview of a picture that is larger than its pane: a small map
// with the part that is in view, to be dragged or moved by keys.

import { counted, debounce, el, oncePerFrame } from "./dom.js";
import { FONT, FORMS_FROM, LARGE_FROM, addBox, graphColors, inView, paintRun, paintStill, signedLabel, viewOf } from "./paint.js";

const SMALL_CONTROL = { width: 150, height: 110 }; // pixels: a smaller control is one block
const BLOCK_NAME = { size: 11, letter: 6.2, line: 14, least: 3 };
const RUN = { width: 58, height: 48 }; // pixels that some blocks together should have
const WORST_FIRST = ["error", "warning", "info"];

// -- blocks -------------------------------------------------------------------------------------

// The outermost controls that are too small to be looked into: {blocks: [group], hiding: group number ->
// block}. Their order is that of the picture.
function blocksOf(picture, zoom) {
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

// Whether it is painted as blocks at this zoom.
export const isFar = (picture, zoom) => zoom < FORMS_FROM && picture.items.length >= LARGE_FROM;

// Whether all of it can be read then: its blocks have room for their names.
export const isReadableFar = (picture, zoom) => {
  const { blocks } = isFar(picture, zoom) ? blocksOf(picture, zoom) : { blocks: [] };
  return blocks.length > 0 && areNamed(blocks, zoom);
};

const lettersIn = ({ width }, zoom) => Math.floor((width * zoom - 8) / BLOCK_NAME.letter);
const hasName = ({ box, label }, zoom) => box.height * zoom >= BLOCK_NAME.line + 2 && nameOf(label).length <= lettersIn(box, zoom);
const areNamed = (blocks, zoom) => blocks.filter((block) => hasName(block, zoom)).length > 0.8 * blocks.length;

// Blocks that are too small for their names are joined with those before and behind them: what stands
// in one column, or several columns, or a part of one, is one block, which has the first name and the last.
// "inside": item number -> block, for what stands between them.
function inRuns(picture, zoom, { blocks, hiding }) {
  const runs = [];
  const runOf = new Map(); // block -> run
  const begin = (first) => runs.push({ ...blocks[first], last: blocks[first], runners: 0, severity: "" });
  const take = (number) => {
    const run = runs[runs.length - 1];
    const block = blocks[number];
    runOf.set(number, runs.length - 1);
    run.box = around(run.box, block.box);
    run.runners += block.runners;
    if (block.severity && (!run.severity || WORST_FIRST.indexOf(block.severity) < WORST_FIRST.indexOf(run.severity))) run.severity = block.severity;
    if (!isNamed(block) && isNamed(run)) return;
    if (isNamed(block) && !isNamed(run)) run.label = block.label;
    run.last = block;
  };
  for (const columns of columnsOf(picture, blocks, hiding)) {
    let isOpen = false; // whether the run goes on in the next column
    for (const column of columns) {
      const wide = column.map((number) => blocks[number].box).reduce(around);
      const isWide = wide.width * zoom >= RUN.width;
      const joins = isOpen && !isWide && wide.x >= runs[runs.length - 1].box.x;
      column.forEach((number, place) => {
        if (place ? isFull(runs[runs.length - 1].box, blocks[number].box, isWide && zoom) : !joins) begin(number);
        take(number);
      });
      isOpen = runs[runs.length - 1].box.width * zoom < RUN.width;
    }
  }
  const inside = new Map();
  picture.items.forEach(({ box, parent, kind }, item) => {
    if (hiding.has(parent)) return;
    const run = runs.findIndex((one) => one.parent === parent && isInside(box, one.box));
    if (run < 0) return;
    inside.set(item, run);
    if (kind === "runner") runs[run].runners += 1;
  });
  return { blocks: runs, hiding: new Map([...hiding].map(([group, block]) => [group, runOf.get(block)])), inside };
}

// Whether what comes next stands beside or below a run that is large enough.
const isFull = (run, next, zoom) =>
  zoom && (next.x + next.width <= run.x || (run.width * zoom >= RUN.width && next.x >= run.x + run.width) ||
  (run.height * zoom >= RUN.height && next.y >= run.y + run.height));
const isNamed = ({ label }) => label.includes("“");
const isInside = (one, other) =>
  one.x >= other.x && one.y >= other.y && one.x + one.width <= other.x + other.width && one.y + one.height <= other.y + other.height;

function around(one, other) {
  const [x, y] = [Math.min(one.x, other.x), Math.min(one.y, other.y)];
  const [right, bottom] = [Math.max(one.x + one.width, other.x + other.width), Math.max(one.y + one.height, other.y + other.height)];
  return { x, y, width: right - x, height: bottom - y };
}

// Blocks beside each other, as lists of columns; a list goes on until something larger stands between.
function columnsOf(picture, blocks, hiding) {
  const lists = new Map();
  const ended = new Set();
  for (const { group, parent } of picture.groups) {
    const number = hiding.get(group);
    if (number === undefined) {
      ended.add(parent);
    } else if (blocks[number].group === group) {
      const { box } = blocks[number];
      if (!lists.has(parent)) lists.set(parent, [[]]);
      const columns = lists.get(parent);
      if (ended.delete(parent)) columns.push([]);
      const list = columns[columns.length - 1];
      const column = list[list.length - 1];
      const before = column && blocks[column[column.length - 1]].box;
      if (before && box.y > before.y - before.height && box.x < before.x + before.width + 2 * box.width) column.push(number);
      else list.push([number]);
    }
  }
  return [...lists.values()].flat();
}

// Kept per picture and zoom, since a picture is painted often.
const cuts = new WeakMap();

export function cutAt(picture, zoom) {
  const kept = cuts.get(picture);
  if (kept && kept.zoom === zoom) return kept;
  const uncut = blocksOf(picture, zoom);
  const { blocks, hiding, inside } = areNamed(uncut.blocks, zoom) ? { ...uncut, inside: new Map() } : inRuns(picture, zoom, uncut);
  const blockOf = (item) => inside.get(item) ?? hiding.get(picture.items[item]?.parent) ?? -1;
  const edges = picture.edges.filter(({ source, target }) => {
    const around = blockOf(source);
    return around < 0 || around !== (target < 0 ? around : blockOf(target));
  });
  const items = picture.items.filter((_, item) => blockOf(item) < 0);
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
  const { zoom } = view;
  const scale = 1 / zoom;
  context.save();
  context.font = `${BLOCK_NAME.size * scale}px ${FONT}`;
  context.textAlign = "left";
  context.lineJoin = "round";
  context.lineWidth = 3 * scale;
  context.strokeStyle = colors["--graph-paper"];
  const taken = [];
  const counts = groups.filter(({ runners }) => runners);
  const isLong = counts.every(({ box, runners }) => counted(runners, "runner").length <= lettersIn(box, zoom));
  for (const group of groups) {
    const { x, y, width, height } = group.box;
    const letters = lettersIn(group.box, zoom);
    if (letters < BLOCK_NAME.least || height * zoom < BLOCK_NAME.line + 2) continue;
    const lines = group.last ? namesOf(group) : [shortLabel(group.label, letters)];
    if (group.runners) lines.push(isLong ? counted(group.runners, "runner") : `▸ ${group.runners}`);
    lines.length = Math.min(lines.length, Math.max(1, Math.floor((height * zoom - 4) / BLOCK_NAME.line)));
    const room = { x, y, right: x + width, bottom: y + lines.length * BLOCK_NAME.line * scale };
    const isFree = (one) => room.x >= one.right || one.x >= room.right || room.y >= one.bottom || one.y >= room.bottom;
    if (!taken.every(isFree)) continue;
    const longest = Math.max(...lines.map(({ length }) => length));
    taken.push({ ...room, right: Math.min(room.right, x + (8 + BLOCK_NAME.letter * Math.min(letters, longest)) * scale) });
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

// "room 12", "to 15"
function namesOf({ label, last }) {
  const [from, to] = [nameOf(label), nameOf(last.label)];
  if (from === to) return [from];
  let same = 0;
  while (from[same] === to[same]) same += 1;
  return [from, `to ${to.slice(from.slice(0, same).replace(/\d+$/, "").length)}`];
}

// The name, or else the line, of a control.
function nameOf(label) {
  const [, name = label] = /“(.+)”/.exec(label) || /\((line [\d:]+)\)$/.exec(label) || [];
  return name;
}

// "∥∗ “look” (line 5)", or only "look", or "line 5", where there is no room for more.
function shortLabel(label, letters) {
  return [label, signedLabel(label)].find((text) => text.length <= letters) ?? nameOf(label);
}

// -- the overview -------------------------------------------------------------------------------

const MINIMAP = { width: 180, height: 150, air: 4, away: 10, legend: 46, clear: 14 };
const SETTLES_MS = 100;
const HIDES = 1e4; // rather than cover so much
const WEIGHTS = { running: HIDES, triggered: HIDES, waiting: HIDES, failed: HIDES, stuck: HIDES, succeeded: 9, fired: 9, stopped: 9, reached: 9 };
const MAP_KEYS = { ArrowLeft: [-0.5, 0], ArrowRight: [0.5, 0], ArrowUp: [0, -0.5], ArrowDown: [0, 0.5] };

// mountMinimap(pane) -> {element, show(picture), setRun(states), move, settle, recolor}; pane: {camera, box, selectedBox()}
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
    if (!pane.camera.held) settle(); // else it would jump while one looks around
  };

  // What it covers at the right, or at the left above the legend: nodes, those of a run, what is selected.
  function covered(atLeft) {
    const { clientWidth, clientHeight } = pane.box;
    const { pan, zoom } = pane.camera;
    const [width, height] = [canvas.offsetWidth, canvas.offsetHeight];
    const [x, y] = [atLeft ? MINIMAP.away : clientWidth - MINIMAP.away - width, clientHeight - height - (atLeft ? MINIMAP.legend : MINIMAP.away)];
    const room = { left: (x - pan.x) / zoom, top: (y - pan.y) / zoom, right: (x + width - pan.x) / zoom, bottom: (y + height - pan.y) / zoom };
    // What is selected has brackets around it.
    const away = MINIMAP.clear / zoom;
    const wide = { left: room.left - away, top: room.top - away, right: room.right + away, bottom: room.bottom + away };
    const selected = pane.selectedBox();
    const weigh = (item) => WEIGHTS[shared.states.get(item)?.state] ?? 1;
    return shared.picture.items.reduce(
      (sum, { box }, item) => sum + (inView(box, room) ? weigh(item) : 0), selected && inView(selected, wide) ? HIDES : 0,
    );
  }

  // It stands where it covers less, and hides where it would cover what happens or what is selected.
  const settle = debounce(() => {
    if (element.hidden || shared.dragging || document.activeElement === element) return;
    const isLeft = element.classList.contains("at-left");
    const [here, there] = [covered(isLeft), covered(!isLeft)];
    if (there < here) element.classList.toggle("at-left");
    element.classList.toggle("covers", Math.min(here, there) >= HIDES);
  }, SETTLES_MS);

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
      settle();
    },
    move,
    settle,
    recolor: draw,
  };
}
