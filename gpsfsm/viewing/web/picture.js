// What is drawn of an automaton: items (nodes and folded groups), open groups and edges with their
// ways. Nothing here knows a canvas; paint.js draws it.

import { counted } from "./dom.js";
import { arrangeCells, cellBox } from "./layout.js";
import { layeredPicture } from "./layered.js";
import { danglingWay, drawnCell, edgeRouter, loopWay } from "./routes.js";
import { EVENTS, joinWord } from "./words.js";

const LETTER_WIDTH = 6.1;
const JOIN_LETTER = 4.8;

// makePicture(automaton, collapsed, layout) ->
//   {items, groups, edges, itemOf, edgeOf, width, height}
//   item: {kind, node, group, element, box, lines, inside, never}
//   group: {group, element, label, box, depth, part}
//   edge: {source, target, event, kind, way, merged, edges, open}: items by number, way: corners
//   itemOf: node -> number of the item that shows it; edgeOf: edge -> number of the drawn edge
export function makePicture(automaton, collapsed, layout) {
  const arranged = arrangeCells(automaton, collapsed);
  const picture = { items: [], groups: [], edges: [], itemOf: [], edgeOf: [] };
  const itemAt = addItems(picture, automaton, arranged);
  addEdges(picture, automaton, arranged, itemAt);
  const whole = cellBox(arranged.cells[0]);
  Object.assign(picture, { width: whole.width, height: whole.height });
  if (layout === "layered") layeredPicture(picture);
  else mergeWays(picture.edges);
  return picture;
}

function addItems(picture, automaton, { cells, groups, visible, failing }) {
  const itemAt = new Map(); // cell -> item
  for (const number of visible) {
    const cell = cells[number];
    if (cell.node < 0 && !cell.folded) {
      if (cell.group >= 0) picture.groups.push(openGroup(cell, groups));
      continue;
    }
    itemAt.set(number, picture.items.length);
    const item = cell.folded ? foldedItem(cell, groups) : nodeItem(cell, automaton);
    picture.items.push(Object.assign(item, { fails: failing.has(cell.node) }));
  }
  cells.forEach((cell, number) => {
    if (cell.node < 0) return;
    const shown = drawnCell(cells, number);
    const item = itemAt.get(shown) ?? -1;
    picture.itemOf[cell.node] = item;
    if (item >= 0 && cells[shown].folded) picture.items[item].inside.push(cell.node);
  });
  for (const item of picture.items) if (item.kind === "folded") sayCount(item, automaton);
  return itemAt;
}

function openGroup(cell, groups) {
  const group = groups[cell.group];
  return {
    group: cell.group, element: group.element, label: group.label,
    box: cellBox(cell), depth: group.depth, part: Boolean(group.part), parent: group.parent,
  };
}

function foldedItem(cell, groups) {
  const group = groups[cell.group];
  return {
    kind: "folded", node: -1, group: cell.group, element: group.element, box: cellBox(cell),
    lines: [group.label], inside: [], parent: group.parent,
  };
}

function sayCount(item, automaton) {
  const runners = item.inside.filter((node) => automaton.nodes[node].kind === "runner").length;
  item.lines.push(counted(runners, "runner"));
}

function nodeItem(cell, automaton) {
  const node = automaton.nodes[cell.node];
  const box = cellBox(cell);
  const isJoin = node.kind === "join";
  const room = Math.max(6, Math.floor((box.width - (isJoin ? 0 : 12)) / (isJoin ? JOIN_LETTER : LETTER_WIDTH)));
  const lines = isJoin ? joinLines(node) : node.label;
  return {
    kind: node.kind, node: cell.node, need: node.need, group: -1, element: node.element, box, inside: [],
    lines: lines.map((line) => (line.length > room ? `${line.slice(0, room - 1)}…` : line)),
    parent: -1,
  };
}

function joinLines(node) {
  return node.label.length ? node.label : [joinWord(node)];
}

function addEdges(picture, automaton, arranged, itemAt) {
  const { cells, failing } = arranged;
  const route = edgeRouter(arranged);
  const cellOf = [];
  cells.forEach((cell, number) => {
    if (cell.node >= 0) cellOf[cell.node] = drawnCell(cells, number);
  });
  const drawn = new Map();
  automaton.edges.forEach((edge, number) => {
    const start = cellOf[edge.source] ?? -1;
    const end = edge.target >= 0 ? (cellOf[edge.target] ?? -1) : -1;
    if (start < 0 || (edge.target >= 0 && end < 0)) return;
    const isLoop = edge.source === edge.target;
    if ((start === end || edge.target < 0) && cells[start].folded) return;
    const kind = failing.has(edge.source) && edge.event === "SUCCEEDED" ? "FAILED" : edge.event;
    const key = `${start} ${end} ${edge.event} ${kind}`;
    if (drawn.has(key)) {
      drawn.get(key).edges.push(number);
      picture.edgeOf[number] = drawn.get(key).number;
      return;
    }
    let way;
    if (edge.target < 0) way = danglingWay(cells[start], edge.event);
    else if (isLoop) way = loopWay(cells[start]);
    else way = route(start, end, cells[start].folded ? kind : edge.event);
    const made = {
      source: itemAt.get(start), target: edge.target < 0 ? -1 : itemAt.get(end), event: edge.event,
      kind, line: EVENTS[edge.event].line, way, merged: false, edges: [number],
      open: edge.target < 0, loop: isLoop,
      number: picture.edges.length,
    };
    drawn.set(key, made);
    picture.edgeOf[number] = made.number;
    picture.edges.push(made);
  });
}

// -- edges that end in one line: each is drawn up to where it meets one that is there already, since
// broken lines on top of each other would fill each other's gaps

function mergeWays(edges) {
  const drawn = new Map(); // line to a corner -> how far from the corner it is drawn
  for (const edge of edges) {
    edge.full = edge.way;
    if (edge.open || edge.loop || edge.way.length < 2) continue;
    const cut = cutWay(edge.way, drawn, `${edge.target} ${edge.kind}`);
    if (cut) Object.assign(edge, { way: cut, merged: true });
  }
  forkWays(edges);
}

// The same at the other end: edges of one event that begin in one line.
function forkWays(edges) {
  const drawn = new Map(); // line from a corner -> how far it is drawn
  for (const edge of edges) {
    if (edge.open || edge.loop || edge.way.length < 2) continue;
    edge.way = cutStart(edge.way, drawn, `${edge.source} ${edge.event}`);
  }
}

function cutStart(way, drawn, key) {
  for (let at = 0; at < way.length - 1; at += 1) {
    const [from, to] = [way[at], way[at + 1]];
    const axis = from[0] === to[0] ? 1 : 0;
    const sign = Math.sign(to[axis] - from[axis]);
    const length = Math.abs(to[axis] - from[axis]);
    const line = `${key} ${from[0]} ${from[1]} ${axis} ${sign}`;
    const known = drawn.get(line) ?? 0;
    if (known < length) {
      drawn.set(line, length);
      const begin = [...from];
      begin[axis] += sign * known;
      return [begin, ...way.slice(at + 1)];
    }
    if (known > length) return at + 2 < way.length ? way.slice(at + 1) : way;
  }
  return way;
}

// The way up to where it meets a line to the same corner, or null if it meets none. What is drawn
// of it is remembered.
function cutWay(way, drawn, key) {
  for (let at = 0; at < way.length - 1; at += 1) {
    const [from, to] = [way[at], way[at + 1]];
    const axis = from[0] === to[0] ? 1 : 0;
    const length = from[axis] - to[axis];
    const line = `${key} ${to[0]} ${to[1]} ${axis} ${Math.sign(length)}`;
    const known = drawn.get(line);
    if (known === undefined) {
      drawn.set(line, Math.abs(length));
      continue;
    }
    if (Math.abs(length) <= known) return at > 0 ? way.slice(0, at + 1) : null;
    drawn.set(line, Math.abs(length));
    const meeting = [...to];
    meeting[axis] += Math.sign(length) * known;
    return [...way.slice(0, at + 1), meeting];
  }
  return null;
}
