// Draws a picture (picture.js) on a canvas, and what changes while one works with it: states of a play,
// edges that are taken, what is selected and pointed at, and the signs of findings. Only what is in
// view is drawn, and names only where they can be read.

import { themeColor } from "./dom.js";
import { CONTROL_SIGNS, EVENTS, STATES } from "./words.js";

export const FONT = "ui-sans-serif, system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif";
const LINE = 15;
export const NAMES_FROM = 0.36; // zoom from which names are drawn
const EVENTS_FROM = 0.62;
const CAPTION_INDENT = 23; // behind the sign that folds the group
const CAPTION_AIR = 8;
const CAPTION_LETTER = 6.3;
export const FORMS_FROM = 0.3; // below, all of a large picture is plain boxes and lines (view.far)
export const LARGE_FROM = 300; // items
const STROKES = [...Object.entries(EVENTS).map(([kind, { line }]) => [kind, line]), ["FAILED", "solid"]];
const DASHES = { solid: [], dashed: [6, 3], dotted: [2, 3], broken: [8, 2, 2, 2] };
const HEAD = 7;
const BAND = 9;
const MANY_BARE = 12;

const COLOR_NAMES = [
  "--graph-paper", "--graph-text", "--graph-soft", "--graph-line", "--graph-node", "--graph-even",
  "--graph-odd", "--graph-border", "--graph-good", "--graph-bad", "--graph-folded", "--accent",
  "--accent-soft", "--event-succeeded", "--event-failed", "--event-started", "--event-stopped", "--event-stops",
  "--state-triggered", "--state-running", "--state-succeeded", "--state-failed", "--state-stopped",
  "--state-never", "--state-reached", "--error", "--warning", "--info",
];

// The colours of the theme as they are now.
export function graphColors() {
  return Object.fromEntries(COLOR_NAMES.map((name) => [name, themeColor(name)]));
}

export function inView(box, view) {
  return (
    box.x < view.right && box.x + box.width > view.left && box.y < view.bottom && box.y + box.height > view.top
  );
}

function routeInView(route, view) {
  let [left, top, right, bottom] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x, y] of route) {
    left = Math.min(left, x);
    right = Math.max(right, x);
    top = Math.min(top, y);
    bottom = Math.max(bottom, y);
  }
  return left < view.right && right > view.left && top < view.bottom && bottom > view.top;
}

// The part of the picture that a canvas of `width` x `height` shows.
export function viewOf(pan, zoom, width, height) {
  const [left, top] = [-pan.x / zoom, -pan.y / zoom];
  return { pan, zoom, left, top, right: left + width / zoom, bottom: top + height / zoom };
}

// -- what stands still ---------------------------------------------------------------------------

// Near enough to be read; from far away overview.js paints.
export function paintPicture(context, picture, view, colors) {
  for (const group of picture.groups) {
    if (inView(group.box, view)) paintGroup(context, group, colors);
  }
  paintEdges(context, picture.edges, view, colors, 1.5);
  for (const group of view.zoom < NAMES_FROM ? [] : picture.groups) {
    if (inView(group.box, view)) paintCaption(context, group, colors);
  }
  if (view.zoom >= EVENTS_FROM) paintEventNames(context, picture, view, colors);
  for (const item of picture.items) {
    if (inView(item.box, view)) paintItem(context, item, view, colors, null);
  }
}

export function addBox(context, { x, y, width, height }) {
  context.rect(x, y, width, height);
}

// From far away: few calls, whatever the number of nodes.
export function paintStill(context, picture, view, colors) {
  context.lineWidth = 0.7 / view.zoom;
  const groups = picture.groups.filter((group) => inView(group.box, view));
  for (const odd of [0, 1]) {
    context.beginPath();
    for (const group of groups) if (group.depth % 2 === odd) addBox(context, group.box);
    context.fillStyle = colors[odd ? "--graph-odd" : "--graph-even"];
    context.fill();
    context.strokeStyle = colors["--graph-border"];
    context.stroke();
  }
  paintEdges(context, picture.edges, view, colors, 1.5);
  const byFill = new Map();
  for (const item of picture.items) {
    if (!inView(item.box, view)) continue;
    const key = `${itemFill(item, colors)} ${itemStroke(item, colors)}`;
    if (!byFill.has(key)) byFill.set(key, []);
    byFill.get(key).push(item);
  }
  for (const items of byFill.values()) {
    context.beginPath();
    for (const item of items) addBox(context, item.box);
    context.fillStyle = itemFill(items[0], colors);
    context.fill();
    context.strokeStyle = itemStroke(items[0], colors);
    context.stroke();
  }
  paintFindingsFar(context, picture, view, colors);
}

function paintFindingsFar(context, picture, view, colors) {
  const size = Math.min(40, 4 / view.zoom);
  for (const severity of ["info", "warning", "error"]) {
    context.beginPath();
    for (const { finding, box } of picture.items) {
      if (finding !== severity || !inView(box, view)) continue;
      context.rect(box.x + box.width - size / 2, box.y - size / 2, size, size);
    }
    context.fillStyle = colors[`--${severity}`];
    context.fill();
  }
}

export function paintGroup(context, group, colors) {
  const { x, y, width, height } = group.box;
  context.beginPath();
  context.roundRect(x, y, width, height, 8);
  context.fillStyle = colors[group.depth % 2 ? "--graph-odd" : "--graph-even"];
  context.fill();
  context.lineWidth = 1;
  context.setLineDash(group.part ? [3, 3] : []);
  context.strokeStyle = colors["--graph-border"];
  context.stroke();
  context.setLineDash([]);
}

// A caption and its left end: behind the line on which its group is entered where that would cross it, and
// shorter if there is little room. A recovery is entered from its side.
export function captionOf({ box: { x, width }, label, spine = -1 }) {
  const from = x + CAPTION_INDENT;
  const wide = (text) => text.length * CAPTION_LETTER;
  if (label.startsWith("recovery") || spine <= from - CAPTION_AIR || spine >= from + wide(label)) return [label, from];
  const named = label.replace(/ \(line \d+\)$/, "");
  const short = [label, named, signedLabel(named)].find((text) => spine + CAPTION_AIR + wide(text) < x + width);
  return short ? [short, spine + CAPTION_AIR] : [label, from];
}

// "∥∗ “look” (line 5)"
export function signedLabel(label) {
  const [word] = label.split(" ", 1);
  return CONTROL_SIGNS[word] ? CONTROL_SIGNS[word] + label.slice(word.length) : label;
}

// Above the lines, which may cross it: a halo keeps it readable.
export function paintCaption(context, group, colors) {
  const { x, y } = group.box;
  const [label, left] = captionOf(group);
  context.font = `11px ${FONT}`;
  context.textAlign = "left";
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeStyle = colors[group.depth % 2 ? "--graph-odd" : "--graph-even"];
  context.strokeText(label, left, y + 17);
  context.fillStyle = colors["--graph-soft"];
  context.fillText("⊟", x + 9, y + 17);
  context.fillText(label, left, y + 17);
}

export function itemPath(context, item, grow) {
  const { x, y, width, height } = item.box;
  context.beginPath();
  if (item.kind === "join") {
    context.arc(x + width / 2, y + height / 2, width / 2 + grow, 0, 2 * Math.PI);
    return;
  }
  const radius = item.kind === "runner" || item.kind === "folded" ? 6 : height / 2;
  context.roundRect(x - grow, y - grow, width + 2 * grow, height + 2 * grow, radius + grow);
}

function itemFill(item, colors) {
  if (item.kind === "complete") return colors["--graph-good"];
  if (item.kind === "give_up") return colors["--graph-bad"];
  if (item.kind === "folded") return colors["--graph-folded"];
  return item.kind === "start" ? colors["--graph-even"] : colors["--graph-node"];
}

function itemStroke(item, colors) {
  if (item.kind === "complete") return colors["--event-succeeded"];
  if (item.kind === "give_up") return colors["--event-failed"];
  return colors["--graph-line"];
}

export function paintItem(context, item, view, colors, tint) {
  if (item.kind === "folded") {
    context.save();
    context.translate(3, 3);
    itemPath(context, item, 0);
    context.restore();
    context.fillStyle = colors["--graph-odd"];
    context.strokeStyle = colors["--graph-border"];
    context.lineWidth = 1.25;
    context.fill();
    context.stroke();
  }
  itemPath(context, item, 0);
  context.fillStyle = itemFill(item, colors);
  context.fill();
  if (tint) {
    context.globalAlpha = tint.strength;
    context.fillStyle = tint.color;
    context.fill();
    context.globalAlpha = 1;
  }
  context.lineWidth = tint ? 2.5 : 1.25;
  context.strokeStyle = tint ? tint.color : itemStroke(item, colors);
  if ((tint && tint.dashed) || item.unreachable) context.setLineDash([4, 3]);
  context.stroke();
  context.setLineDash([]);
  if (item.kind === "complete" || item.kind === "give_up") {
    itemPath(context, item, -3);
    context.lineWidth = 1;
    context.stroke();
  }
  if (view.zoom >= NAMES_FROM) paintLines(context, item, colors);
}

function paintLines(context, item, colors) {
  const { x, y, width, height } = item.box;
  const isJoin = item.kind === "join";
  const step = isJoin ? 0.85 * LINE : LINE;
  const first = y + height / 2 - (step * (item.lines.length - 1)) / 2 + 4;
  context.textAlign = "center";
  item.lines.forEach((line, number) => {
    context.font = isJoin ? `10px ${FONT}` : `${number ? "" : "600 "}12px ${FONT}`;
    context.fillStyle = colors[number || item.unreachable ? "--graph-soft" : "--graph-text"];
    // Fonts differ: narrower where it is too wide.
    context.fillText(line, x + width / 2, first + number * step, width - 10);
  });
}

// Color tells what an edge carries, and its line which event that is: what leads on from a join of
// failures is red and unbroken.
export function paintEdges(context, edges, view, colors, width) {
  const seen = edges.filter((edge) => edge.route.length && routeInView(edge.route, view));
  for (const [kind, line] of STROKES) {
    const shown = seen.filter((edge) => edge.kind === kind && edge.line === line);
    if (!shown.length) continue;
    const color = colors[EVENTS[kind].color];
    context.strokeStyle = color;
    context.fillStyle = color;
    context.lineWidth = Math.max(width, 0.6 / view.zoom);
    const far = view.far;
    context.setLineDash(far ? [] : DASHES[line]);
    context.beginPath();
    for (const edge of shown) (far ? traceLine : tracePath)(context, edge.route);
    context.stroke();
    if (far) continue;
    context.setLineDash([]);
    context.beginPath();
    for (const edge of shown) traceEnd(context, edge);
    context.fill();
    paintOpenEnds(context, shown, colors);
  }
}

function traceLine(context, route) {
  context.moveTo(route[0][0], route[0][1]);
  for (let at = 1; at < route.length; at += 1) context.lineTo(route[at][0], route[at][1]);
}

function tracePath(context, route) {
  context.moveTo(route[0][0], route[0][1]);
  for (let at = 1; at < route.length - 1; at += 1) {
    const [x, y] = route[at];
    context.arcTo(x, y, route[at + 1][0], route[at + 1][1], roundingAt(route, at));
  }
  const [x, y] = route[route.length - 1];
  context.lineTo(x, y);
}

function roundingAt(route, at) {
  const span = (one, other) => Math.abs(one[0] - other[0]) + Math.abs(one[1] - other[1]);
  return Math.min(6, span(route[at - 1], route[at]) / 2, span(route[at], route[at + 1]) / 2);
}

function traceEnd(context, edge) {
  const [x, y] = edge.route[edge.route.length - 1];
  if (edge.open) return;
  if (edge.merged) {
    context.moveTo(x + 2.2, y);
    context.arc(x, y, 2.2, 0, 2 * Math.PI);
    return;
  }
  const before = edge.route[edge.route.length - 2];
  const angle = Math.atan2(y - before[1], x - before[0]);
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  const at = (along, across) => [x + along * cos - across * sin, y + along * sin + across * cos];
  if (edge.kind === "STOPS") {
    for (const corner of [[0, -HEAD], [0, HEAD], [-3, HEAD], [-3, -HEAD]]) {
      context[corner[0] || corner[1] > 0 ? "lineTo" : "moveTo"](...at(...corner));
    }
    context.closePath();
    return;
  }
  context.moveTo(x, y);
  context.lineTo(...at(-HEAD, 0.5 * HEAD));
  context.lineTo(...at(-HEAD, -0.5 * HEAD));
  context.closePath();
}

function paintOpenEnds(context, edges, colors) {
  const open = edges.filter((edge) => edge.open);
  if (!open.length) return;
  context.lineWidth = 1.5;
  context.fillStyle = colors["--graph-paper"];
  for (const edge of open) {
    const [x, y] = edge.route[edge.route.length - 1];
    context.beginPath();
    context.arc(x, y, 4.5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
}

// The name of an event stands where its edge leaves the node.
function paintEventNames(context, picture, view, colors) {
  context.font = `10px ${FONT}`;
  context.lineJoin = "round";
  context.lineWidth = 3;
  context.strokeStyle = colors["--graph-paper"];
  context.textAlign = "left";
  const named = new Set();
  for (const edge of picture.edges) {
    if (edge.named) {
      paintNamed(context, edge, named, view, colors);
      continue;
    }
    const source = picture.items[edge.source];
    const event = source.kind === "folded" ? edge.kind : edge.event;
    const key = `${edge.source} ${event}`;
    if (named.has(key) || edge.route.length < 2 || edge.curved || !hasNames(source)) continue;
    named.add(key);
    const [x, y] = edge.route[0];
    if (x < view.left - 80 || x > view.right || y < view.top - 20 || y > view.bottom + 20) continue;
    const goesDown = edge.route[1][0] === x;
    context.fillStyle = colors[EVENTS[edge.kind].color];
    const place = goesDown ? [x + 5, y + 12] : [x + 4, y - 3];
    context.strokeText(EVENTS[event].word, ...place);
    context.fillText(EVENTS[event].word, ...place);
  }
}

// In a machine a name has a place of its own, which all edges of the event pass.
function paintNamed(context, edge, named, view, colors) {
  const [x, y] = edge.named;
  const key = `${x} ${y}`;
  if (named.has(key) || x < view.left - 80 || x > view.right + 80 || y < view.top - 20 || y > view.bottom + 20) return;
  named.add(key);
  const words = edge.kind === "STOPS" ? `${EVENTS[edge.event].word} ${EVENTS.STOPS.word}` : EVENTS[edge.event].word;
  context.textAlign = "center";
  context.fillStyle = colors[EVENTS[edge.kind].color];
  context.strokeText(words, x, y + 3);
  context.fillText(words, x, y + 3);
  context.textAlign = "left";
}

function hasNames(item) {
  return item.kind === "runner" || item.kind === "folded";
}

// -- what changes --------------------------------------------------------------------------------

// {states: Map(item -> {state, count}), taken: Set(edge), isShown}; items and edges of the picture by
// number. Items that are not in `states` have not been reached.
export function paintRun(context, picture, view, colors, { states, taken, isShown }) {
  const edges = [...taken].map((number) => picture.edges[number]).filter((edge) => edge?.route.length);
  if (edges.length) paintBold(context, edges, view, colors, 3.5);
  if (!isShown) return;
  if (view.far) {
    paintStatesFar(context, picture, view, colors, states);
    return;
  }
  for (const [number, status] of states) {
    const item = picture.items[number];
    if (item && inView(item.box, view)) paintState(context, item, view, colors, status);
  }
}

function paintBold(context, edges, view, colors, width) {
  const whole = edges.map((edge) => ({ ...edge, route: edge.full || edge.route, merged: false }));
  paintEdges(context, whole, view, colors, width);
}

// Edges of what is selected or pointed at lie in a band; only those that are taken are bold. Those that
// are drawn for it alone need none, and are faint where they are many.
export function paintNear(context, all, view, colors) {
  const edges = all.filter((edge) => edge.route.length);
  const bare = all.filter((edge) => !edge.route.length);
  context.globalAlpha = bare.length > MANY_BARE ? 0.35 : 1;
  paintBold(context, bare, view, colors, 1.5);
  context.strokeStyle = colors["--accent"];
  context.lineWidth = Math.max(BAND, 4 / view.zoom);
  context.globalAlpha = 0.3;
  context.beginPath();
  for (const { full, route } of edges) {
    const whole = full || route;
    if (routeInView(whole, view)) (view.far ? traceLine : tracePath)(context, whole);
  }
  context.stroke();
  context.globalAlpha = 1;
  paintBold(context, edges, view, colors, 1.5);
}

// {selected, hoveredItems, near: Set(edge), element, hovered, findings, groupFindings}
export function paintPointers(context, picture, view, colors, marks) {
  const near = [...marks.near].map((number) => picture.edges[number]).filter(Boolean);
  if (near.length) paintNear(context, near, view, colors);
  for (const group of picture.groups) {
    const isSelected = group.element >= 0 && group.element === marks.element;
    const isHovered = group.element >= 0 && group.element === marks.hovered;
    if (isSelected) paintBrackets(context, group.box, view, colors);
    if (isSelected || isHovered) ringBox(context, group.box, view, colors);
  }
  for (const number of marks.hoveredItems) {
    const item = picture.items[number];
    if (item) paintRing(context, item, view, colors);
  }
  for (const number of marks.selected) {
    const item = picture.items[number];
    if (item) paintSelected(context, item, view, colors);
    if (item && !view.far) paintMark(context, item, colors, marks.states?.get(number));
  }
  if (view.far) return; // there they stand still: paintFindingsFar
  for (const [number, severity] of marks.findings) {
    const item = picture.items[number];
    if (item && inView(item.box, view)) paintFinding(context, item, view, colors, severity);
  }
  for (const group of picture.groups) {
    const severity = marks.groupFindings.get(group.element);
    if (severity && inView(group.box, view)) paintFinding(context, group, view, colors, severity);
  }
}

function paintStatesFar(context, picture, view, colors, states) {
  const byState = new Map();
  for (const [number, { state }] of states) {
    const item = picture.items[number];
    if (!item || !STATES[state] || !STATES[state].color || !inView(item.box, view)) continue;
    if (!byState.has(state)) byState.set(state, []);
    byState.get(state).push(item);
  }
  for (const [state, items] of byState) {
    context.beginPath();
    for (const item of items) addBox(context, item.box);
    context.globalAlpha = state === "never" ? 0.15 : 1;
    context.fillStyle = colors[STATES[state].color];
    context.fill();
  }
  context.globalAlpha = 1;
}

export function paintState(context, item, view, colors, status) {
  const name = status ? status.state : "idle";
  const state = STATES[name];
  if (!state || !state.color) return;
  const strength = name === "never" ? 0.1 : 0.28;
  const color = colors[stateColor(item, name)];
  const tint = { color, strength, dashed: name === "never" || name === "stopped" };
  paintItem(context, item, view, colors, tint);
  paintMark(context, item, colors, status);
}

// The sign of its state; brackets around what is selected do not hide it.
function paintMark(context, item, colors, status) {
  const state = STATES[status?.state];
  if (!state?.color || status.state === "never") return;
  stateMark(context, item, { ...colors, "--mark": colors[stateColor(item, status.state)] }, state, status);
}

// A failure that was collected or has ended the plan is no success.
function stateColor(item, name) {
  if (name === "fired" && item.fails) return "--state-failed";
  if (name === "reached") return item.kind === "give_up" ? "--state-failed" : "--state-succeeded";
  return STATES[name].color;
}

function stateMark(context, item, colors, state, status) {
  const isWaiting = status.state === "waiting";
  const sign = isWaiting ? `${status.count}/${item.need}` : state.sign;
  if (!sign) return;
  const half = isWaiting ? 8 + 2.5 * sign.length : 9;
  const isWide = item.kind === "runner" || item.kind === "folded";
  // beyond a corner, where no name begins, no arrow ends and no ring covers it; or beside what is small
  const x = item.box.x - half + 3;
  const y = isWide ? item.box.y - 5 : item.box.y + item.box.height / 2;
  context.beginPath();
  context.roundRect(x - half, y - 9, 2 * half, 18, 9);
  context.fillStyle = colors["--mark"];
  context.fill();
  context.fillStyle = colors["--graph-paper"];
  context.font = `700 11px ${FONT}`;
  context.textAlign = "center";
  context.fillText(sign, x, y + 4);
}

export function paintRing(context, item, view, colors) {
  itemPath(context, item, 3.5);
  strokeRing(context, view, colors);
}

// A ring and four brackets around it: no state of a run has such a form.
export function paintSelected(context, item, view, colors) {
  paintRing(context, item, view, colors);
  paintBrackets(context, item.box, view, colors);
}

function ringBox(context, box, view, colors) {
  context.beginPath();
  context.roundRect(box.x, box.y, box.width, box.height, 8);
  strokeRing(context, view, colors);
}

function strokeRing(context, view, colors) {
  context.lineWidth = Math.max(2, 1.5 / view.zoom);
  context.strokeStyle = colors["--accent"];
  context.globalAlpha = 0.55;
  context.stroke();
  context.globalAlpha = 1;
}

function paintBrackets(context, { x, y, width, height }, view, colors) {
  const away = Math.max(8, 4 / view.zoom);
  const [left, top, right, bottom] = [x - away, y - away, x + width + away, y + height + away];
  const long = Math.min(Math.max(10, 6 / view.zoom), (right - left) / 3, (bottom - top) / 3);
  context.beginPath();
  for (const [cornerX, inX] of [[left, left + long], [right, right - long]]) {
    for (const [cornerY, inY] of [[top, top + long], [bottom, bottom - long]]) {
      context.moveTo(inX, cornerY);
      context.lineTo(cornerX, cornerY);
      context.lineTo(cornerX, inY);
    }
  }
  context.lineJoin = "miter";
  const wide = Math.max(2.5, 2 / view.zoom);
  for (const color of ["--graph-paper", "--graph-text"]) {
    context.lineWidth = color === "--graph-paper" ? 2 * wide : wide;
    context.strokeStyle = colors[color];
    context.stroke();
  }
}

export function paintFinding(context, item, view, colors, severity) {
  const { x, y, width } = item.box;
  const radius = Math.max(7.5, Math.min(22, 2.5 / view.zoom));
  context.beginPath();
  context.arc(x + width - 2, y + 1, radius, 0, 2 * Math.PI);
  context.fillStyle = colors[`--${severity}`];
  context.fill();
  if (view.zoom < NAMES_FROM) return;
  context.fillStyle = colors["--graph-paper"];
  context.font = `700 10px ${FONT}`;
  context.textAlign = "center";
  context.fillText(severity[0].toUpperCase(), x + width - 2, y + 4.5);
}
