// The tree of cells by which the automaton is laid out, as Python's picture/cells.py grows it: a
// cell is a node, a control with its units and joins, or a unit with the recoveries that guard it.
//
// A row of automaton.cells is [flow, parent, element, node, isJoin]; parents stand before children.

export const FLOW = {
  NODE: "node",
  DOWN: "down",
  BESIDE: "beside",
  ACROSS: "across",
  GUARD: "guard",
  PLAN: "plan",
};

// Above this many nodes, long rows are divided into parts that can be folded.
export const LARGE_PLAN = 2500;
const LEAST_PART = 50;
const MOST_PARTS = 150;

const grown = new WeakMap();

// cellTree(automaton) -> {cells, groups}. `groups` are automaton.groups and, for large plans, the
// parts: {element: -1, parent, label, depth, part: true}. Cells know their `group`, -1 for none.
export function cellTree(automaton) {
  let found = grown.get(automaton);
  if (!found) {
    found = growCells(automaton);
    grown.set(automaton, found);
  }
  return found;
}

function newCell(flow, parent, element, node, isJoin) {
  return {
    flow, parent, element, node, isJoin,
    group: -1, children: [], joins: [], place: 0, depth: 0,
    x: 0, y: 0, left: 0, right: 0, height: 0, entry: 0, tracks: [], track: 0,
  };
}

function growCells(automaton) {
  const cells = automaton.cells.map((row) => newCell(row[0], row[1], row[2], row[3], Boolean(row[4])));
  const groups = automaton.groups.map((group) => ({ ...group }));
  const groupOf = new Map(groups.map((group, number) => [group.element, number]));
  cells.forEach((cell, number) => {
    if (number > 0) {
      const around = cells[cell.parent];
      (cell.isJoin ? around.joins : around.children).push(number);
    }
    const isGroup = ![FLOW.NODE, FLOW.GUARD, FLOW.PLAN].includes(cell.flow);
    if (isGroup) cell.group = groupOf.get(cell.element) ?? -1;
  });
  if (automaton.nodes.length > LARGE_PLAN) divide(cells, groups, automaton);
  inOrder(cells);
  numberPlaces(cells);
  return { cells, groups };
}

function numberPlaces(cells) {
  for (const cell of cells) {
    cell.children.forEach((child, place) => Object.assign(cells[child], { place, depth: cell.depth + 1 }));
    cell.joins.forEach((join, place) => Object.assign(cells[join], { place, depth: cell.depth + 1 }));
  }
}

// Puts long rows of children into parts of their own.
function divide(cells, groups, automaton) {
  const last = cells.length;
  for (let number = 0; number < last; number += 1) {
    const cell = cells[number];
    if (cell.children.length <= 2 * LEAST_PART || cell.flow === FLOW.GUARD) continue;
    const size = Math.max(LEAST_PART, Math.ceil(cell.children.length / MOST_PARTS));
    const [before, inside, after] = withoutEnds(cells, cell.children, automaton);
    const parts = [];
    for (let at = 0; at < inside.length; at += size) {
      parts.push(addPart(cells, groups, number, inside.slice(at, at + size), automaton));
    }
    cell.children = [...before, ...parts, ...after];
  }
  regroup(cells, groups);
}

function withoutEnds(cells, children, automaton) {
  const isEnd = (child) => ["start", "complete"].includes(automaton.nodes[cells[child].node]?.kind);
  const before = children.filter((child, place) => place === 0 && isEnd(child));
  const after = children.filter((child, place) => place > 0 && isEnd(child));
  return [before, children.filter((child) => !isEnd(child)), after];
}

function addPart(cells, groups, parent, children, automaton) {
  const flow = cells[parent].flow === FLOW.PLAN ? FLOW.DOWN : cells[parent].flow;
  const made = newCell(flow, parent, -1, -1, false);
  made.children = children;
  made.group = groups.length;
  const number = cells.push(made) - 1;
  for (const child of children) cells[child].parent = number;
  const [first, last] = [children[0], children[children.length - 1]].map((child) =>
    firstLine(cells, child, automaton),
  );
  const label = first && last ? `lines ${first} – ${last}` : `${children.length} units`;
  groups.push({ element: -1, parent: -1, label, depth: 0, part: true });
  return number;
}

function firstLine(cells, number, automaton) {
  let at = cells[number];
  while (at.children.length) at = cells[at.children[0]];
  const label = at.node >= 0 ? automaton.nodes[at.node].label : [];
  const found = /^line (\d+)$/.exec(label[label.length - 1] || "");
  return found ? found[1] : "";
}

// Which group is in which, with the parts between.
function regroup(cells, groups) {
  for (const cell of cells) {
    if (cell.group < 0) continue;
    let around = cell.parent;
    while (around >= 0 && cells[around].group < 0) around = cells[around].parent;
    groups[cell.group].parent = around >= 0 ? cells[around].group : -1;
  }
  for (const group of groups) {
    group.depth = 0;
    for (let at = group.parent; at >= 0; at = groups[at].parent) group.depth += 1;
  }
}

// Sorts the list so that every parent stands before its children again.
function inOrder(cells) {
  const order = [];
  const stack = [0];
  while (stack.length) {
    const number = stack.pop();
    order.push(number);
    stack.push(...[...cells[number].children, ...cells[number].joins].reverse());
  }
  const moved = new Map(order.map((number, place) => [number, place]));
  const sorted = order.map((number) => cells[number]);
  for (const cell of sorted) {
    cell.parent = cell.parent < 0 ? -1 : moved.get(cell.parent);
    cell.children = cell.children.map((child) => moved.get(child));
    cell.joins = cell.joins.map((join) => moved.get(join));
  }
  cells.splice(0, cells.length, ...sorted);
}
