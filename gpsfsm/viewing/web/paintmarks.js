// Draws what changes while one works with a picture: states of a play, edges that are taken, what is
// selected and pointed at, and the signs of findings.

import {
  FONT,
  NAMES_FROM,
  addBox,
  inView,
  itemPath,
  paintEdges,
  paintItem,
} from "./paint.js";
import { STATES } from "./words.js";

// {states: Map(item -> {state, count}), taken: Set(edge), isShown}; items and edges of the picture by
// number. Items that are not in `states` have not been reached.
export function paintRun(context, picture, view, colors, { states, taken, isShown }) {
  const edges = [...taken].map((number) => picture.edges[number]).filter(Boolean);
  if (edges.length) paintBold(context, edges, view, colors, 3.5);
  if (!isShown) return;
  if (view.far) {
    paintStatesFar(context, picture, view, colors, states);
    return;
  }
  for (const [number, found] of states) {
    const item = picture.items[number];
    if (item && inView(item.box, view)) paintState(context, item, view, colors, found);
  }
}

function paintBold(context, edges, view, colors, width) {
  const whole = edges.map((edge) => ({ ...edge, way: edge.full || edge.way, merged: false }));
  paintEdges(context, whole, view, colors, width);
}

// {selected, hoveredItems, near: Set(edge), element, hovered, findings, groupFindings}
export function paintPointers(context, picture, view, colors, marks) {
  const near = [...marks.near].map((number) => picture.edges[number]).filter(Boolean);
  if (near.length) paintBold(context, near, view, colors, 2.75);
  for (const group of picture.groups) {
    const isSelected = group.element >= 0 && group.element === marks.element;
    const isHovered = group.element >= 0 && group.element === marks.hovered;
    if (isSelected || isHovered) ringBox(context, group.box, view, colors, isSelected);
  }
  for (const number of marks.hoveredItems) {
    const item = picture.items[number];
    if (item) ring(context, item, view, colors, false);
  }
  for (const number of marks.selected) {
    const item = picture.items[number];
    if (item) ring(context, item, view, colors, true);
  }
  if (view.far) return; // there they stand still: paintFindingsFar
  for (const [number, severity] of marks.findings) {
    const item = picture.items[number];
    if (item && inView(item.box, view)) findingMark(context, item, view, colors, severity);
  }
  for (const group of picture.groups) {
    const severity = marks.groupFindings.get(group.element);
    if (severity && inView(group.box, view)) findingMark(context, group, view, colors, severity);
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


function paintState(context, item, view, colors, found) {
  const name = found ? found.state : "idle";
  const state = STATES[name];
  if (!state || !state.color) return;
  const strength = name === "never" ? 0.1 : 0.28;
  const color = colors[stateColor(item, name)];
  const tint = { color, strength, dashed: name === "never" || name === "stopped" };
  paintItem(context, item, view, colors, tint);
  if (name !== "never" && found) stateMark(context, item, { ...colors, "--mark": color }, state, found);
}

// A failure that was collected or has ended the plan is no success.
function stateColor(item, name) {
  if (name === "fired" && item.fails) return "--state-failed";
  if (name === "reached") return item.kind === "give_up" ? "--state-failed" : "--state-succeeded";
  return STATES[name].color;
}

function stateMark(context, item, colors, state, found) {
  const isWaiting = found.state === "waiting";
  const sign = isWaiting ? `${found.count}/${item.need}` : state.sign;
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

function ring(context, item, view, colors, strong) {
  itemPath(context, item, 3.5);
  strokeRing(context, view, colors, strong);
}

function ringBox(context, box, view, colors, strong) {
  context.beginPath();
  context.roundRect(box.x, box.y, box.width, box.height, 8);
  strokeRing(context, view, colors, strong);
}

function strokeRing(context, view, colors, strong) {
  context.lineWidth = Math.max(strong ? 3 : 2, (strong ? 2 : 1.5) / view.zoom);
  context.strokeStyle = colors["--accent"];
  context.globalAlpha = strong ? 1 : 0.55;
  context.stroke();
  context.globalAlpha = 1;
}

function findingMark(context, item, view, colors, severity) {
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
