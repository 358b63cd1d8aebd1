// The ways of the edges, as in Python's picture/routing.py: right-angled, and along the lines that
// the layout keeps free. A success leaves a node at the bottom, everything else at its right.

import { FLOW } from "./cells.js";
import { cellBox } from "./layout.js";

const BUS = 12;
const GOOD_BUS = 24;
const FREE_LINE = 10;
const CROSSING = 34;
const NARROW = 7;
const INNER = 5;
const OUTER = 11;
const BELOW = 19;
const RETURN = 28;
const STUB = 20;
const OPEN_STUB = 41.6;
const PORTS = { STARTED: 0.22, FAILED: 0.5, STOPPED: 0.78 };

// Where a line leaves at the right; a join is round.
function rightPort(cell, share) {
  const box = cellBox(cell);
  const y = box.y + box.height * share;
  if (!cell.isJoin || cell.folded) return [box.x + box.width, y];
  return [box.x + (box.width / 2) * (1 + Math.sqrt(1 - (1 - 2 * share) ** 2)), y];
}

const middleY = (box) => box.y + box.height / 2;
const isDown = (flow) => flow === FLOW.DOWN || flow === FLOW.PLAN;
const isRow = (flow) => flow === FLOW.GUARD || flow === FLOW.ACROSS;
const hasPart = (cell) => cell.node >= 0 || cell.folded;

// danglingWay(cell, event) -> the short line of an event that leads nowhere.
export function danglingWay(cell, event) {
  const box = cellBox(cell);
  if (event === "SUCCEEDED") {
    const bottom = box.y + box.height;
    return [[cell.x, bottom], [cell.x, bottom + STUB]];
  }
  const [x, y] = rightPort(cell, PORTS[event] ?? 0.5);
  return [[x, y], [x + OPEN_STUB, y]];
}

// loopWay(cell) -> the line of a join that is wired to itself.
export function loopWay(cell) {
  const box = cellBox(cell);
  const [right, y] = [box.x + box.width, middleY(box)];
  return [[right, y + 6], [right + 16, y + 6], [right + 16, y - 6], [right + 2, y - 6]];
}

// edgeRouter({cells, failing}) -> route(start, end, event): corners from border to border, where
// start and end are numbers of drawn cells (nodes or folded groups).
export function edgeRouter({ cells, failing }) {
  const isJoin = (cell) => cell.isJoin && !cell.folded;
  const boxOf = (cell) => cellBox(cell);
  const filled = cells.map((cell) => cell.node >= 0); // whether there is a node in it
  for (let at = cells.length - 1; at > 0; at -= 1) filled[cells[at].parent] ||= filled[at];

  function route(start, end, event) {
    const { around, leaving, entering } = meet(start, end);
    if (leaving === entering || leaving === around || entering === around) return [];
    const sharing = cells[around];
    const leavesDown = leavesAtBottom(cells[start], event, leaving, entering);
    let points = wayOut(start, leaving, event, leavesDown);
    const last = points[points.length - 1];
    if (cells[entering].isJoin) {
      points = points.concat(toJoin(sharing, leaving, entering, last, leavesDown));
    } else if (followsRight(sharing, leaving, entering) && !leavesDown) {
      points = points.concat(toTheRight(leaving, entering, end, last, event));
    } else {
      points = points.concat(toBelow(sharing, leaving, entering, end, last, leavesDown));
    }
    return straightened(points);
  }

  function meet(start, end) {
    let [leaving, entering, one, other] = [start, end, start, end];
    while (one !== other) {
      if (cells[one].depth >= cells[other].depth) [leaving, one] = [one, cells[one].parent];
      else [entering, other] = [other, cells[other].parent];
    }
    return { around: one, leaving, entering };
  }

  function leavesAtBottom(source, event, leaving, entering) {
    if (event !== "SUCCEEDED") return false;
    if (!failing.has(source.node)) return true;
    return cells[leaving].isJoin && cells[entering].isJoin;
  }

  // -- from the source to the border of the cell that is left

  function wayOut(start, leaving, event, leavesDown) {
    let cell = cells[start];
    const box = boxOf(cell);
    const side = rightPort(cell, PORTS[event] ?? 0.5);
    let points = [leavesDown ? [cell.x, box.y + box.height] : side];
    for (let at = start; at !== leaving; ) {
      const around = cells[cell.parent];
      points = points.concat(past(around, cell, points[points.length - 1], leavesDown));
      at = cell.parent;
      cell = around;
    }
    return points;
  }

  function past(around, cell, point, leavesDown) {
    if (cell.isJoin) return [];
    const isLast = cell.place === around.children.length - 1;
    if (leavesDown) return isLast ? [] : aside(around, cell, point);
    const blocked = isDown(around.flow)
      ? cell.track < around.tracks.length - 1
      : !isLast && !endsRow(around, cell);
    if (!blocked) return [];
    const x = channel(around, cell);
    let y = around.y + around.height - NARROW;
    if (isRow(around.flow)) y = around.y + around.tracks[cell.track][1] + NARROW;
    else if (around.joins.length) y = cells[around.joins[0]].y - CROSSING;
    return [[x, point[1]], [x, y]];
  }

  function endsRow(around, cell) {
    const following = cells[around.children[cell.place + 1]];
    return around.flow === FLOW.ACROSS && following.track !== cell.track;
  }

  function aside(around, cell, point) {
    let y = cell.y + cell.height + NARROW;
    let x;
    if (around.flow === FLOW.ACROSS && cell.track < around.tracks.length - 1) {
      y = around.y + around.tracks[cell.track][1] + BELOW;
      x = around.x - around.left + NARROW;
    } else if (around.flow === FLOW.BESIDE && isWrapped(around)) {
      x = around.x + around.tracks[cell.track][0] - OUTER;
    } else if (isDown(around.flow)) {
      x = around.x - around.left + NARROW;
    } else {
      return [];
    }
    return [[point[0], y], [x, y]];
  }

  function isWrapped(cell) {
    return cell.tracks.length < cell.children.length;
  }

  function channel(around, cell) {
    const inTracks = isDown(around.flow) || (around.flow === FLOW.BESIDE && isWrapped(around));
    if (!isJoin(cell) && inTracks) return around.x + around.tracks[cell.track][1] + FREE_LINE;
    return cell.x + cell.right + NARROW;
  }

  // -- to the target

  function toJoin(around, leaving, entering, point, leavesDown) {
    const [join, cell] = [cells[entering], cells[leaving]];
    const box = boxOf(join);
    let points = [];
    if (!leavesDown) points = [[channel(around, cell), point[1]]];
    else if (!cell.isJoin) points = asideIn(around, cell, point);
    const x = points.length ? points[points.length - 1][0] : point[0];
    if (isRow(around.flow) && x > join.x + join.left) {
      return [...points, [x, middleY(box)], [box.x + box.width, middleY(box)]];
    }
    const bus = box.y - (leavesDown && !failing.has(join.node) ? GOOD_BUS : BUS);
    return [...points, [x, bus], [join.x, bus], [join.x, box.y]];
  }

  // To where the way down to a join is free.
  function asideIn(around, cell, point) {
    if (isDown(around.flow)) {
      const following = around.children.slice(cell.place + 1);
      if (!following.some((each) => filled[each])) return [];
      const y = cell.y + cell.height + NARROW;
      return [[point[0], y], [channel(around, cell), y]];
    }
    const folded = isWrapped(around) && around.flow === FLOW.BESIDE;
    const rows = around.flow === FLOW.ACROSS && around.tracks.length > 1;
    return folded || rows ? aside(around, cell, point) : [];
  }

  function followsRight(around, leaving, entering) {
    const [one, next] = [cells[leaving], cells[entering]];
    if (one.isJoin) return around.flow === FLOW.GUARD && next.place > 0; // it stands below them all
    const near =
      around.flow === FLOW.BESIDE ? !isWrapped(around) : isRow(around.flow) && one.track === next.track;
    return near && next.place === one.place + 1;
  }

  function toTheRight(leaving, entering, end, point, event) {
    const [cell, next] = [cells[leaving], cells[entering]];
    const x = cell.isJoin ? next.x - next.left - INNER : cell.x + cell.right + NARROW;
    const fan = outerFan(entering, end);
    if (fan >= 0) {
      const way = approach(fan, end);
      const around = cells[fan];
      const y = around.flow === FLOW.BESIDE ? cells[around.children[0]].y - BUS : way[0][1];
      return [[x, point[1]], [x, y], [way[0][0], y], ...way];
    }
    const box = boxOf(cells[end]);
    const y = box.y + box.height * (PORTS[event] ?? 0.5);
    return [[x, point[1]], [x, y], [box.x, y]];
  }

  // The outermost cell on the way to a node that others are in the way of from the left.
  function outerFan(entering, end) {
    let found = -1;
    for (let at = end; at !== entering; at = cells[at].parent) {
      const { parent, isJoin: join, place } = cells[at];
      const around = cells[parent];
      if (join) continue;
      const isBehind = isRow(around.flow) && around.children.slice(0, place).some((each) => filled[each]);
      if (around.flow === FLOW.BESIDE || isBehind) found = parent;
    }
    return found;
  }

  function toBelow(around, leaving, entering, end, point, leavesDown) {
    const [cell, into] = [cells[leaving], cells[entering]];
    // In a row: above all that stand in it.
    const top = isRow(around.flow) ? around.y + around.tracks[into.track][0] : into.y;
    const bus = top - BUS;
    let points = [];
    let x = point[0];
    if (!leavesDown) {
      x = besideCell(around, leaving, entering);
      points = [[x, point[1]]];
    } else if (isDown(around.flow) && cell.track !== into.track) {
      x = channel(around, cell) + RETURN - FREE_LINE;
      const below = cell.y + cell.height + BUS;
      points = [[point[0], below], [x, below]];
    } else if (somethingBetween(around, leaving, entering) || bus < point[1]) {
      x = around.x + around.tracks[cell.track][0] - NARROW;
      const below = cell.y + cell.height + NARROW;
      points = [[point[0], below], [x, below]];
    }
    return [...points, [x, bus], [into.x, bus], ...approach(entering, end)];
  }

  // Whether there are nodes in the way: those of a recovery that guards nothing.
  function somethingBetween(around, leaving, entering) {
    const between = around.children.slice(cells[leaving].place + 1, cells[entering].place);
    return !cells[leaving].isJoin && between.some((each) => filled[each]);
  }

  // Where the way down is free: right beside the cell, if the very next one is entered.
  function besideCell(around, leaving, entering) {
    const [cell, next] = [cells[leaving], cells[entering]];
    const near = isDown(around.flow) && !cell.isJoin && next.place === cell.place + 1;
    if (near && cell.track === next.track) {
      return cell.x + cell.right - (hasPart(cell) ? NARROW : -NARROW);
    }
    return channel(around, cell);
  }

  function approach(entering, end) {
    let cell = cells[end];
    const points = [[cell.x, boxOf(cell).y]];
    for (let index = end; index !== entering; ) {
      const around = cells[cell.parent];
      points.push(...into(around, cell));
      index = cell.parent;
      cell = around;
    }
    return points.reverse();
  }

  function into(around, cell) {
    const isInRow = isRow(around.flow) && !cell.isJoin;
    const bus = (isInRow ? around.y + around.tracks[cell.track][0] : cell.y) - BUS;
    const top = around.children.length ? cells[around.children[0]].y - BUS : bus;
    if (around.flow === FLOW.BESIDE && isWrapped(around)) {
      const x = around.x + around.tracks[cell.track][0] - INNER;
      return [[cell.x, bus], [x, bus], [x, top], [around.x, top]];
    }
    const above = cell.isJoin ? around.children : around.children.slice(0, cell.place);
    const stacked = cell.isJoin || isDown(around.flow);
    if (stacked && above.some((each) => filled[each])) {
      const left = around.x - around.left;
      const x = around.flow === FLOW.GUARD ? left - NARROW : left + NARROW;
      return [[cell.x, bus], [x, bus], [x, top], [around.x, top]];
    }
    return cell.x !== around.x ? [[cell.x, bus], [around.x, bus]] : [];
  }

  return route;
}

// The cell that stands for a node: itself, or the folded group that hides it; -1 if none is drawn.
export function drawnCell(cells, number) {
  let at = number;
  while (at >= 0 && cells[at].hidden) at = cells[at].parent;
  return at >= 0 && hasPart(cells[at]) ? at : -1;
}

function straightened(points) {
  const found = [];
  for (const [x, y] of points) {
    const point = [Math.round(10 * x) / 10, Math.round(10 * y) / 10];
    const last = found[found.length - 1];
    const before = found[found.length - 2];
    if (last && last[0] === point[0] && last[1] === point[1]) continue;
    const onLine = (axis) => before[axis] === last[axis] && last[axis] === point[axis];
    if (before && (onLine(0) || onLine(1))) found[found.length - 1] = point;
    else found.push(point);
  }
  return found;
}
