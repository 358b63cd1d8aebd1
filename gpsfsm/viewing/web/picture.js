// What is drawn of an automaton: items (nodes and folded groups), open groups and edges with their
// routes, all where Python has put them. Nothing here knows a canvas; paint.js draws it.

import { counted } from "./dom.js";
import { boxOf, clippedRoute, closeGaps, foldedGroups } from "./folding.js";
import { EVENTS, joinWord } from "./words.js";

const JOIN_LETTER = 4.8;

/**
 * @typedef {{x: number, y: number, width: number, height: number}} Box
 * @typedef {{kind: string, node: number, group: number, element: number, box: Box, lines: string[],
 *   inside: number[], parent: number, fails: boolean, need?: number, inputs?: number, finding?: string,
 *   unreachable?: boolean}} Item
 * @typedef {{group: number, element: number, label: string, box: Box, depth: number, part: boolean,
 *   finding?: string}} Group
 * @typedef {[number, number]} Corner
 * @typedef {{source: number, target: number, event: string, kind: string, line: string, route: Corner[],
 *   full: Corner[], merged: boolean, edges: number[], open: boolean, loop: boolean, number: number,
 *   curved: boolean}} Edge   between items by number, -1 for an open end; `full`: before it was merged
 * @typedef {{items: Item[], groups: Group[], edges: Edge[], itemOf: number[], edgeOf: number[],
 *   width: number, height: number}} Picture   itemOf: node -> item; edgeOf: edge -> drawn edge
 */

/** @returns {Picture} */
export const emptyPicture = (width = 1, height = 1) => ({
  items: [], groups: [], edges: [], itemOf: [], edgeOf: [], width, height,
});

// makePicture(automaton, collapsed, layout) -> Picture
// The layered layout has no groups, so that nothing is folded in it.
export function makePicture(automaton, collapsed, layout) {
  const layered = layout === "layered" ? automaton.layered : undefined;
  const [width, height] = (layered || automaton).size;
  const picture = emptyPicture(width, height);
  const folded = foldedGroups(automaton, layered ? new Set() : collapsed);
  const failing = new Set(automaton.failing);
  const spines = addItems(picture, automaton, folded, layered, failing);
  addEdges(picture, automaton, layered, failing);
  closeGaps(picture, spines);
  for (const edge of picture.edges) edge.full = edge.route; // from here on they are merged
  if (layered || automaton.flat) mergeEqualEnds(picture.edges);
  else mergeRoutes(picture.edges);
  for (const edge of picture.edges) if (!edge.route.length) edge.full = straightLine(picture.items, edge);
  return picture;
}

// Adds nodes and groups; -> the x on which each folded item is entered
function addItems(picture, automaton, folded, layered, failing) {
  const spines = new Map();
  const itemOfGroup = new Map();
  automaton.groups.forEach((group, number) => {
    if (folded[number] < 0 && !layered) {
      picture.groups.push({ ...group, group: number, box: boxOf(group.box), part: group.element < 0 });
    } else if (folded[number] === number) {
      const item = foldedItem(group, number);
      itemOfGroup.set(number, picture.items.length);
      spines.set(item, group.spine);
      picture.items.push(item);
    }
  });
  automaton.nodes.forEach((node, number) => {
    const around = automaton.group_of[number];
    const hiding = node.hidden || around < 0 ? -1 : folded[around];
    if (hiding >= 0) {
      picture.itemOf[number] = itemOfGroup.get(hiding);
      picture.items[picture.itemOf[number]].inside.push(number);
      return;
    }
    picture.itemOf[number] = node.hidden ? -1 : picture.items.length;
    if (node.hidden) return;
    const box = boxOf(node.box);
    if (layered) [box.x, box.y] = layered.corners[number];
    const parent = layered ? -1 : around;
    picture.items.push(Object.assign(nodeItem(node, number, box), { parent, fails: failing.has(number) }));
  });
  for (const item of picture.items) if (item.kind === "folded") sayCount(item, automaton);
  return spines;
}

function foldedItem(group, number) {
  return {
    kind: "folded", node: -1, group: number, element: group.element, box: boxOf(group.box),
    lines: [group.label], inside: [], parent: group.parent, fails: false,
  };
}

function sayCount(item, automaton) {
  const runners = item.inside.filter((node) => automaton.nodes[node].kind === "runner").length;
  item.lines.push(counted(runners, "runner"));
}

function nodeItem(node, number, box) {
  const isJoin = node.kind === "join";
  // Others fit their boxes.
  const room = isJoin ? Math.max(6, Math.floor(box.width / JOIN_LETTER)) : Infinity;
  const lines = isJoin ? joinLines(node) : node.label;
  return {
    kind: node.kind, node: number, need: node.need, inputs: node.inputs, group: -1, element: node.element, box, inside: [],
    lines: lines.map((line) => (line.length > room ? `${line.slice(0, room - 1)}…` : line)),
  };
}

function joinLines(node) {
  return node.label.length ? node.label : [joinWord(node)];
}

function addEdges(picture, automaton, layered, failing) {
  const drawn = new Map();
  const foldedBox = (item) => (picture.items[item]?.kind === "folded" ? picture.items[item].box : null);
  automaton.edges.forEach((edge, number) => {
    const flat = layered ? layered.routes[number] : edge.route;
    const isOpen = edge.target < 0;
    const isLoop = edge.source === edge.target;
    const source = picture.itemOf[edge.source];
    const target = isOpen ? -1 : picture.itemOf[edge.target];
    const from = foldedBox(source);
    const isBare = edge.stops && source !== target && source >= 0 && target >= 0; // it is drawn where it is selected
    if ((!flat.length && !isBare) || ((source === target || isOpen) && from)) return;
    const carried = failing.has(edge.source) && edge.event === "SUCCEEDED" ? "FAILED" : edge.event;
    const kind = edge.stops ? "STOPS" : carried;
    const key = `${source} ${target} ${edge.event} ${kind}`;
    if (drawn.has(key)) {
      drawn.get(key).edges.push(number);
      picture.edgeOf[number] = drawn.get(key).number;
      return;
    }
    const made = {
      source, target, event: edge.event, kind, line: EVENTS[edge.stops ? kind : edge.event].line,
      route: flat.length ? clippedRoute(cornersOf(flat), from, foldedBox(target)) : [],
      merged: false, edges: [number], open: isOpen, loop: isLoop, number: picture.edges.length,
      curved: Boolean(layered), named: edge.named,
    };
    drawn.set(key, made);
    picture.edgeOf[number] = made.number;
    picture.edges.push(made);
  });
}

// Between the borders of two items, of an edge that Python has not laid out.
/** @returns {Corner[]} */
function straightLine(items, { source, target }) {
  const [from, to] = [items[source].box, items[target].box];
  const [across, along] = [to.x + to.width / 2 - from.x - from.width / 2, to.y + to.height / 2 - from.y - from.height / 2];
  /** @type {(box: Box, sign: number) => Corner} */
  const border = ({ x, y, width, height }, sign) => {
    const share = sign * Math.min(width / 2 / Math.abs(across), height / 2 / Math.abs(along), 0.5);
    return [x + width / 2 + share * across, y + height / 2 + share * along];
  };
  return [border(from, 1), border(to, -1)];
}

function cornersOf(flat) {
  const points = [];
  for (let at = 0; at < flat.length; at += 2) points.push([flat[at], flat[at + 1]]);
  return points;
}

// -- edges that end in one line: each is drawn up to where it meets one that is there already, since
// broken lines on top of each other would fill each other's gaps

function mergeRoutes(edges) {
  const drawn = new Map(); // line to a corner -> how far from the corner it is drawn
  for (const edge of edges) {
    if (edge.open || edge.loop || edge.route.length < 2) continue;
    const cut = cutRoute(edge.route, drawn, `${edge.target} ${edge.kind}`);
    if (cut) Object.assign(edge, { route: cut, merged: true });
  }
  forkRoutes(edges);
}

// The same at the other end: edges of one event that begin in one line.
function forkRoutes(edges) {
  const drawn = new Map(); // line from a corner -> how far it is drawn
  for (const edge of edges) {
    if (edge.open || edge.loop || edge.route.length < 2) continue;
    edge.route = cutStart(edge.route, drawn, `${edge.source} ${edge.event}`);
  }
}

function cutStart(route, drawn, key) {
  for (let at = 0; at < route.length - 1; at += 1) {
    const [from, to] = [route[at], route[at + 1]];
    const axis = from[0] === to[0] ? 1 : 0;
    const sign = Math.sign(to[axis] - from[axis]);
    const length = Math.abs(to[axis] - from[axis]);
    const line = `${key} ${from[0]} ${from[1]} ${axis} ${sign}`;
    const reach = drawn.get(line) ?? 0;
    if (reach < length) {
      drawn.set(line, length);
      const begin = [...from];
      begin[axis] += sign * reach;
      return [begin, ...route.slice(at + 1)];
    }
    if (reach > length) return at + 2 < route.length ? route.slice(at + 1) : route;
  }
  return route;
}

// The route up to where it meets a line to the same corner, or null if it meets none. What is drawn
// of it is remembered.
function cutRoute(route, drawn, key) {
  for (let at = 0; at < route.length - 1; at += 1) {
    const [from, to] = [route[at], route[at + 1]];
    const axis = from[0] === to[0] ? 1 : 0;
    const length = from[axis] - to[axis];
    const line = `${key} ${to[0]} ${to[1]} ${axis} ${Math.sign(length)}`;
    const reach = drawn.get(line);
    if (reach === undefined) {
      drawn.set(line, Math.abs(length));
      continue;
    }
    if (Math.abs(length) <= reach) return at > 0 ? route.slice(0, at + 1) : null;
    drawn.set(line, Math.abs(length));
    const meeting = [...to];
    meeting[axis] += Math.sign(length) * reach;
    return [...route.slice(0, at + 1), meeting];
  }
  return null;
}

// The same for lines of any slope, which end in the same corners.
function mergeEqualEnds(edges) {
  const drawn = new Set();
  for (const edge of edges) {
    const keys = edge.route.map(([x, y]) => `${edge.target} ${edge.kind} ${x} ${y}`);
    const meeting = edge.open ? -1 : keys.findIndex((key, place) => place > 0 && drawn.has(key));
    keys.forEach((key) => drawn.add(key));
    if (meeting > 0 && meeting < keys.length - 1) {
      Object.assign(edge, { route: edge.route.slice(0, meeting + 1), merged: true });
    }
  }
}
