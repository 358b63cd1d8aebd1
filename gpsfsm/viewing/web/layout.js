// Where everything stands when some groups are folded. The same arrangement as Python's
// picture/arranging.py: success leads down and failure to the right; rows that would get too long
// are folded like the columns of a newspaper. A folded group is a box like a node.

import { FLOW, cellTree } from "./cells.js";

const PADDING = 14;
const CAPTION = 24;
const MARGIN = 20;
const ROW_GAP = 40;
const UNIT_GAP = 16;
const ALTERNATIVE_GAP = 12;
const COLUMN_GAP = 48;
const JOIN_GAP = 52;
const GUARD_GAP = 40;
const LEVEL_GAP = 28;
const FAN = 16;
const FAILURE = 54;
const NOTHING = 92; // on engines: what the event leads to
const CHANNEL = 10;
const LONGEST = 1800;
const WIDEST = 2600;
const RATIO = 1.5;
const NARROW_LETTERS = new Set("ijl.,:;'|!()[]{}/ tfrI");
const WIDE_LETTER = /[\u1100-\u115f\u2e80-\ua4cf\uac00-\ud7a3\uf900-\ufaff\ufe30-\ufe4f\uff00-\uff60\uffe0-\uffe6\u{1f300}-\u{1faff}\u{20000}-\u{3fffd}]/u;
const FOLDED_HEIGHT = 46;

// arrangeCells(automaton, collapsed) -> {cells, groups, failing, visible, folded}
//   visible: cell numbers that are drawn; folded(cell): whether it is a folded group
export function arrangeCells(automaton, collapsed) {
  const tree = cellTree(automaton);
  const failing = new Set(automaton.failing);
  const inputs = joinInputs(automaton);
  const beside = automaton.nodes.some((node) => node.hidden) ? NOTHING : FAILURE;
  const context = { beside, automaton, cells: tree.cells, groups: tree.groups, failing, inputs, collapsed };
  const isFolded = (cell) => cell.group >= 0 && collapsed.has(cell.group);
  const visible = [];
  tree.cells.forEach((cell, number) => {
    const around = tree.cells[cell.parent];
    cell.hidden = number > 0 && (around.hidden || around.folded);
    cell.folded = !cell.hidden && isFolded(cell);
    cell.tracks = [];
    if (!cell.hidden) visible.push(number);
  });
  for (let at = visible.length - 1; at >= 0; at -= 1) sizeCell(context, tree.cells[visible[at]]);
  const top = tree.cells[0];
  top.x = top.left;
  top.y = 0;
  for (const number of visible.slice(1)) {
    const cell = tree.cells[number];
    cell.x += tree.cells[cell.parent].x;
    cell.y += tree.cells[cell.parent].y;
  }
  return { ...context, visible };
}

// The box of a cell, without the place that is kept beside a node for the name of an event.
export function cellBox(cell) {
  const right = cell.node >= 0 || cell.folded ? cell.left : cell.right;
  return { x: cell.x - cell.left, y: cell.y, width: cell.left + right, height: cell.height };
}

function joinInputs(automaton) {
  const found = new Map();
  for (const edge of automaton.edges) {
    if (edge.target < 0) continue;
    if (!found.has(edge.target)) found.set(edge.target, []);
    found.get(edge.target).push(edge.source);
  }
  return found;
}

function captionWidth(label) {
  let width = 2 * PADDING;
  for (const letter of label) {
    if (NARROW_LETTERS.has(letter)) width += 4.2;
    else width += WIDE_LETTER.test(letter) ? 12.5 : 7.3;
  }
  return width;
}

function sizeCell(context, cell) {
  if (cell.flow === FLOW.NODE) sizeNode(context, cell);
  else if (cell.folded) sizeFolded(context, cell);
  else if (cell.flow === FLOW.GUARD) sizeGuard(context, cell);
  else if (cell.flow === FLOW.ACROSS) border(context, cell, across(context, cell));
  else if (cell.flow === FLOW.BESIDE) border(context, cell, beside(context, cell));
  else border(context, cell, down(context, cell));
}

function sizeNode(context, cell) {
  const node = context.automaton.nodes[cell.node];
  cell.height = node.box[3];
  cell.left = node.box[2] / 2;
  cell.right = cell.left + (node.kind === "runner" ? context.beside : 0);
  cell.entry = cell.height / 2;
}

function sizeFolded(context, cell) {
  cell.left = Math.max(120, captionWidth(context.groups[cell.group].label)) / 2;
  cell.right = cell.left + context.beside;
  cell.height = FOLDED_HEIGHT;
  cell.entry = cell.height / 2;
}

function inside(context, cell) {
  return cell.children.map((child) => context.cells[child]);
}

function most(cells, size) {
  let found = -Infinity;
  for (const cell of cells) found = Math.max(found, size(cell));
  return found;
}

const leftOf = (cell) => cell.left;
const rightOf = (cell) => cell.right;

// -- arrangements: each gives the left, right and lower side of the content ----------------------

function down(context, cell) {
  let [left, right, bottom] = [0, 0, 0];
  cellColumns(inside(context, cell), ROW_GAP, false).forEach((column, number) => {
    const widest = most(column, leftOf);
    const spine = number ? right + COLUMN_GAP + widest : 0;
    bottom = Math.max(bottom, stack(column, spine, number));
    left = Math.max(left, number ? column[0].left : widest);
    right = spine + most(column, rightOf);
    cell.tracks.push([spine - widest, right]);
  });
  return [left, right, bottom];
}

function stack(column, spine, number) {
  let y = 0;
  for (const row of column) {
    row.x = spine;
    row.y = y;
    row.track = number;
    y += row.height + ROW_GAP;
  }
  return y - ROW_GAP;
}

function beside(context, cell) {
  const units = inside(context, cell);
  if (!units.length) return [0, 0, 0];
  const columns = cellColumns(units, ROW_GAP, true);
  const gap = columns.length < units.length ? COLUMN_GAP : UNIT_GAP;
  let [x, bottom] = [0, 0];
  columns.forEach((column, number) => {
    const start = x + (number ? gap : 0);
    const spine = start + most(column, leftOf);
    bottom = Math.max(bottom, stack(column, spine, number));
    x = spine + most(column, rightOf);
    cell.tracks.push([start, x]);
  });
  const middle = (units[0].x + units[units.length - 1].x) / 2;
  for (const unit of units) {
    unit.x -= middle;
    unit.y += FAN;
  }
  cell.tracks = cell.tracks.map(([one, other]) => [one - middle, other - middle]);
  return [middle, x - middle, bottom + FAN];
}

function across(context, cell) {
  let [left, right, top] = [0, 0, 0];
  cellRows(inside(context, cell)).forEach((row, number) => {
    const y = top + (number ? ROW_GAP : 0);
    right = Math.max(right, placeRow(row, y, number));
    left = Math.max(left, row[0].left);
    top = most(row, (each) => each.y + each.height);
    cell.tracks.push([y, top]);
  });
  return [left, right, top];
}

function placeRow(row, top, number) {
  const entry = most(row, (each) => each.entry);
  let x = 0;
  row.forEach((each, place) => {
    if (place) x += ALTERNATIVE_GAP + each.left;
    each.x = x;
    each.y = top + entry - each.entry;
    each.track = number;
    x += each.right;
  });
  return x;
}

function sizeGuard(context, cell) {
  const row = inside(context, cell);
  cell.left = row[0].left;
  cell.right = placeRow(row, 0, 0);
  cell.entry = row[0].y + row[0].entry;
  let y = most(row, (each) => each.y + each.height);
  cell.tracks.push([0, y]);
  cell.joins.forEach((number, place) => {
    const join = context.cells[number];
    join.x = 0;
    join.y = y + (place ? LEVEL_GAP : GUARD_GAP);
    y = join.y + join.height;
  });
  cell.height = y;
}

// -- joins and borders ---------------------------------------------------------------------------

function border(context, cell, content) {
  const plan = cell.flow === FLOW.PLAN;
  const [left, right, bottom] = placeJoins(context, cell, content);
  const padding = plan ? MARGIN : PADDING;
  const top = padding + (plan ? 0 : CAPTION);
  cell.left = left + padding;
  cell.right = right + padding;
  cell.height = top + bottom + padding;
  if (!plan) {
    const label = context.groups[cell.group]?.label || "";
    cell.right = Math.max(cell.right, captionWidth(label) - cell.left);
  }
  const units = inside(context, cell);
  cell.entry = units.length ? top + units[0].y + units[0].entry : cell.height / 2;
  if (cell.flow === FLOW.ACROSS) {
    cell.tracks = cell.tracks.map(([one, other]) => [one + top, other + top]);
  }
  for (const each of units) each.y += top;
  for (const join of cell.joins) context.cells[join].y += top;
}

function placeJoins(context, cell, [left, right, bottom]) {
  if (!cell.joins.length) return [left, right, bottom];
  const fails = (join) =>
    context.failing.has(join.node) || context.automaton.nodes[join.node].kind === "give_up";
  const channel = right + CHANNEL;
  levelsOf(context, cell).forEach((joins, level) => {
    const top = bottom + (level ? LEVEL_GAP : JOIN_GAP);
    const good = joins.filter((join) => !fails(join));
    const width = good.reduce((sum, join) => sum + 2 * join.left + UNIT_GAP, -UNIT_GAP);
    let x = -width / 2;
    left = Math.max(left, -x);
    for (const join of good) {
      Object.assign(join, { x: x + join.left, y: top });
      x += 2 * join.left + UNIT_GAP;
    }
    if (good.length) right = Math.max(right, x - UNIT_GAP);
    x = good.length ? Math.max(channel, x + UNIT_GAP) : channel;
    joins.filter(fails).forEach((join, number) => {
      if (number) x += UNIT_GAP + join.left;
      Object.assign(join, { x, y: top });
      x += join.right;
      right = Math.max(right, x);
    });
    bottom = top + most(joins, (join) => join.height);
  });
  return [left, right, bottom];
}

function levelsOf(context, cell) {
  const level = new Map();
  const found = [];
  for (const number of cell.joins) {
    const join = context.cells[number];
    let above = -1;
    for (const source of context.inputs.get(join.node) || []) {
      above = Math.max(above, level.get(source) ?? -1);
    }
    level.set(join.node, above + 1);
    while (found.length <= above + 1) found.push([]);
    found[above + 1].push(join);
  }
  return found.filter((joins) => joins.length);
}

function cellColumns(cells, gap, sideBySide) {
  if (!cells.length) return [];
  const sizes = cells.map((cell) => cell.height + gap);
  const height = sizes.reduce((sum, size) => sum + size, 0);
  if (sideBySide) {
    const total = cells.reduce((sum, cell) => sum + cell.left + cell.right + UNIT_GAP, 0);
    if (total <= WIDEST) return cells.map((cell) => [cell]);
  } else if (height <= LONGEST) {
    return [cells];
  }
  const width = most(cells, (cell) => cell.left + cell.right) + COLUMN_GAP;
  const even = Math.max(1, Math.round(Math.sqrt((RATIO * height) / width)));
  // One that is much larger than the others may do better with these beside it than above it.
  const counts = [...new Set([1, 2, even])].sort((one, other) => one - other);
  let best = null;
  let least = Infinity;
  for (const count of counts) {
    const columns = filled(cells, sizes, height / count);
    const extent = extentOf(columns, gap);
    if (extent < least) [best, least] = [columns, extent];
  }
  return best;
}

// How large columns are beside each other, in the direction that counts more.
function extentOf(columns, gap) {
  let [height, width] = [0, COLUMN_GAP * columns.length];
  for (const column of columns) {
    height = Math.max(height, column.reduce((sum, cell) => sum + cell.height + gap, 0));
    width += most(column, leftOf) + most(column, rightOf);
  }
  return Math.max(height, width / RATIO);
}

function cellRows(cells) {
  const sizes = cells.map((cell) => cell.left + cell.right + ALTERNATIVE_GAP);
  const width = sizes.reduce((sum, size) => sum + size, 0);
  if (width <= WIDEST) return cells.length ? [cells] : [];
  const height = most(cells, (cell) => cell.height) + ROW_GAP;
  const count = Math.max(1, Math.round(Math.sqrt(width / (RATIO * height))));
  return filled(cells, sizes, width / count);
}

function filled(cells, sizes, limit) {
  const parts = [];
  let total = 0;
  cells.forEach((cell, number) => {
    if (!parts.length || Math.floor((total + sizes[number] / 2) / limit) >= parts.length) {
      parts.push([]);
    }
    parts[parts.length - 1].push(cell);
    total += sizes[number];
  });
  return parts;
}
