// The picture with some groups folded. Python has placed everything and routed every edge; here
// nothing is laid out again, but gaps are closed, along either axis on its own:
//
// A folded group keeps as much of its side as its box needs. The rest of the side is a gap, unless
// something that is still drawn stands beside it or a line runs there; gaps are cut out, and all that
// lies behind them moves up. So nothing changes its order, boxes stay apart, and lines stay right-angled.
// The box stands in what is left of its group, and the lines that ended at the group's border lead on to it.
//
//   y of a folded group 100 – 700, needs 46;  a node beside it: 300 – 355
//   kept: 286 – 369 (the node with some air), which is enough;  cut out: 100 – 286 and 369 – 700

const CAPTION = 38; // with the air below it
const AIR = 14;
const SIDE_AIR = 10;
const NAMES = 58; // beside a node: the names of its events
const LINE_AIR = 6;
const FOLDED_HEIGHT = 46;
const FOLDED_WIDTH = 120;
const WIDE_LETTER = /[\u1100-\u{10ffff}]/u;

export const boxOf = ([x, y, width, height]) => ({ x, y, width, height });

// foldedGroups(automaton, collapsed) -> per group the outermost folded one around it, -1 for none
export function foldedGroups(automaton, collapsed) {
  const around = [];
  automaton.groups.forEach(({ parent }, group) => {
    const outer = parent >= 0 ? around[parent] : -1;
    around.push(outer >= 0 || !collapsed.has(group) ? outer : group);
  });
  return around;
}

// Closes the gaps of a picture (picture.js) in place; `spines`: the x per folded item on which it is entered.
export function closeGaps(picture, spines) {
  const folded = picture.items.filter((item) => item.kind === "folded");
  if (!folded.length) return;
  /** @returns {{spans: number[][], kept: number[][]}} */
  const gaps = () => ({ spans: [], kept: [] });
  const [across, along] = [gaps(), gaps()];
  keepGroups(picture.groups, across.kept, along.kept);
  for (const item of picture.items) {
    const { x, y, width, height } = item.box;
    const right = x + width;
    if (item.kind !== "folded") {
      across.kept.push([x - SIDE_AIR, right + NAMES]);
      along.kept.push([y - AIR, y + height + AIR]);
      continue;
    }
    const own = Math.min(width, widthOf(item.lines[0]));
    const need = Math.min(width, own + NAMES);
    const from = Math.max(x, Math.min(spines.get(item) - own / 2, right - need));
    across.kept.push([x - SIDE_AIR, x], [from, from + need], [right, right + SIDE_AIR]);
    along.kept.push([y - AIR, y], [y + height, y + height + AIR]);
    across.spans.push([x, right, need]);
    along.spans.push([y, y + height, Math.min(height, FOLDED_HEIGHT)]);
  }
  keepLines(picture.edges, across.kept, along.kept);
  const [toX, toY] = [closing(across), closing(along)];
  for (const { box } of [...picture.items, ...picture.groups]) {
    const [x, y] = [toX(box.x), toY(box.y)];
    Object.assign(box, { width: toX(box.x + box.width) - x, height: toY(box.y + box.height) - y, x, y });
  }
  for (const group of picture.groups) group.spine = toX(group.spine);
  for (const edge of picture.edges) edge.route = straightened(edge.route.map(([x, y]) => [toX(x), toY(y)]));
  Object.assign(picture, { width: toX(picture.width), height: toY(picture.height) });
  shrinkFolded(picture, spines, toX);
}

// Folded boxes at their own size, on their spines and beside the lines that enter or leave there.
function shrinkFolded(picture, spines, toX) {
  const middles = new Map(); // item -> y of the first line at one of its sides
  const see = (item, [end, next]) => {
    if (next && end[1] === next[1] && !middles.has(item)) middles.set(item, end[1]);
  };
  for (const { source, target, route } of picture.edges) {
    see(picture.items[source], route);
    see(picture.items[target], route.slice(-2).reverse());
  }
  for (const [item, spine] of spines) {
    const { box: room } = item;
    const width = Math.min(room.width, widthOf(item.lines[0]));
    const height = Math.min(room.height, FOLDED_HEIGHT);
    const middle = middles.get(item) ?? room.y;
    item.box = {
      x: Math.min(room.x + room.width - width, Math.max(room.x, toX(spine) - width / 2)),
      y: Math.min(room.y + room.height - height, Math.max(room.y, middle - height / 2)),
      width, height,
    };
  }
  for (const edge of picture.edges) {
    const [source, target] = [picture.items[edge.source], picture.items[edge.target]];
    if (spines.has(source)) edge.route = attached(edge.route, source.box);
    if (spines.has(target)) edge.route = attached([...edge.route].reverse(), target.box).reverse();
  }
}

// A line that begins at the border of a folded group, from the box in it.
function attached(route, { x, y, width, height }) {
  const [end, next] = route;
  if (!next) return route;
  const isUpright = end[0] === next[0];
  const [along, across] = isUpright ? [1, 0] : [0, 1];
  const [low, size] = isUpright ? [x, width] : [y, height];
  const isMet = end[across] >= low + 2 && end[across] <= low + size - 2;
  const start = [x + width / 2, y + height / 2];
  if (isMet) start[across] = end[across];
  const far = isUpright ? [y, y + height] : [x, x + width];
  start[along] = next[along] > end[along] ? far[1] : far[0];
  const corner = [...start];
  corner[along] = end[along];
  return straightened([start, corner, ...route]);
}

function widthOf(label) {
  let width = 2 * AIR;
  for (const letter of label) width += WIDE_LETTER.test(letter) ? 12.5 : 7;
  return Math.max(FOLDED_WIDTH, width);
}

function keepGroups(groups, across, along) {
  for (const { box: { x, y, width, height } } of groups) {
    across.push([x - LINE_AIR, x + AIR], [x + width - AIR, x + width + SIDE_AIR]);
    along.push([y - AIR, y + CAPTION], [y + height - AIR, y + height + AIR]);
  }
}

function keepLines(edges, across, along) {
  for (const { route } of edges) {
    for (let at = 1; at < route.length; at += 1) {
      const [[x0, y0], [x1, y1]] = [route[at - 1], route[at]];
      if (x0 === x1) across.push([x0 - LINE_AIR, x0 + LINE_AIR]);
      if (y0 === y1) along.push([y0 - LINE_AIR, y0 + LINE_AIR]);
    }
  }
}

// closing({spans, kept}) -> where a coordinate comes to be. Spans are [from, to, need].
function closing({ spans, kept }) {
  const occupied = merged(kept);
  // Those that end first choose first, from their end: so later ones may use what these have kept.
  for (const [from, to, need] of [...spans].sort((one, other) => one[1] - other[1])) {
    keepEnough(occupied, from, to, need);
  }
  const gaps = []; // [from, to, what is cut out up to its end]
  let cut = 0;
  let at = 0;
  for (const [from, to] of merged(spans)) {
    while (at < occupied.length && occupied[at][1] <= from) at += 1;
    let free = from;
    for (let next = at; free < to; next += 1) {
      const end = Math.min(to, occupied[next]?.[0] ?? to);
      if (end > free) gaps.push([free, end, (cut += end - free)]);
      free = Math.max(free, occupied[next]?.[1] ?? to);
    }
  }
  return (value) => {
    const number = before(gaps, value);
    if (number < 0) return value;
    const [from, to, through] = gaps[number];
    return value - through + Math.max(0, to - Math.max(value, from));
  };
}

// The number of the last one that begins before a value, -1 if there is none.
function before(intervals, value) {
  let [low, high] = [0, intervals.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (intervals[middle][0] < value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function keepEnough(occupied, from, to, need) {
  let at = before(occupied, to);
  let missing = need;
  let last = at;
  for (; last >= 0 && occupied[last][1] > from; last -= 1) {
    missing -= Math.min(to, occupied[last][1]) - Math.max(from, occupied[last][0]);
  }
  for (let end = to; missing > 0; at -= 1) {
    const start = Math.max(from, at > last ? occupied[at][1] : from);
    if (end > start) {
      const taken = Math.min(missing, end - start);
      occupied.splice(at + 1, 0, [end - taken, end]);
      missing -= taken;
    }
    if (at <= last) return;
    end = Math.min(end, occupied[at][0]);
  }
}

function merged(intervals) {
  const joined = [];
  for (const [from, to] of [...intervals].sort((one, other) => one[0] - other[0])) {
    const last = joined[joined.length - 1];
    if (last && from <= last[1]) last[1] = Math.max(last[1], to);
    else joined.push([from, to]);
  }
  return joined;
}

// clippedRoute(route, from, to) -> the part of a line between two folded boxes (or null: it ends at a node)
export function clippedRoute(route, from, to) {
  const clipped = from ? leaving(route, from) : route;
  return to ? leaving(clipped.slice().reverse(), to).reverse() : clipped;
}

// A line from where it last leaves a box.
function leaving(route, { x, y, width, height }) {
  const clamp = (value, low, size) => Math.min(low + size, Math.max(low, value));
  let last = route.length - 1;
  const isInside = ([px, py]) => px >= x && px <= x + width && py >= y && py <= y + height;
  while (last > 0 && !isInside(route[last])) last -= 1;
  const next = route[last + 1];
  if (!next) return route.slice(last);
  return [[clamp(next[0], x, width), clamp(next[1], y, height)], ...route.slice(last + 1)];
}

function straightened(points) {
  const corners = [];
  for (const point of points) {
    const [before, last] = [corners[corners.length - 2], corners[corners.length - 1]];
    if (last && last[0] === point[0] && last[1] === point[1]) continue;
    const onLine = (axis) => before[axis] === last[axis] && last[axis] === point[axis];
    if (before && (onLine(0) || onLine(1))) corners[corners.length - 1] = point;
    else corners.push(point);
  }
  return corners;
}
