// Lookups in one plan of the view document: elements, nodes, groups and lines.

import { cellTree } from "./cells.js";

const known = new WeakMap();

const NONE = Object.freeze([]);

// planIndex(plan) ->
//   nodesOf(element)     nodes of the automaton that come from an element
//   groupOf(element)     the group that a control is drawn as, -1 if none
//   groups               the groups of the automaton, with the parts of long rows (cells.js)
//   groupAround(node)    the innermost group around a node, -1 if none
//   childrenOf(element)  elements directly inside
//   elementAt(line, column)   the innermost element at a place (from 1), -1 if none
//   findingsOf(element)  indices of the findings whose place is the element
//   findingsAt(line)     indices of the findings on a line
//   outputs(node)        indices of the edges that leave a node, inputs(node) of those that enter
//   isInside(element, outer)
export function planIndex(plan) {
  let index = known.get(plan);
  if (!index) {
    index = makeIndex(plan);
    known.set(plan, index);
  }
  return index;
}

function put(map, key, value) {
  const found = map.get(key);
  if (found) found.push(value);
  else map.set(key, [value]);
}

function makeIndex(plan) {
  const nodes = new Map();
  const children = new Map();
  const groupOf = new Map();
  const groupAround = [];
  const { cells, groups } = plan.automaton ? cellTree(plan.automaton) : { cells: [], groups: [] };
  const findings = new Map();
  const findingLines = new Map();
  const outputs = new Map();
  const inputs = new Map();
  plan.elements.forEach((element, number) => put(children, element.parent, number));
  if (plan.automaton) {
    plan.automaton.nodes.forEach((node, number) => put(nodes, node.element, number));
    groups.forEach((group, number) => group.element >= 0 && groupOf.set(group.element, number));
    const inside = [];
    cells.forEach((cell, number) => {
      inside[number] = cell.group >= 0 ? cell.group : (inside[cell.parent] ?? -1);
      if (cell.node >= 0) groupAround[cell.node] = inside[number];
    });
    plan.automaton.edges.forEach((edge, number) => {
      put(outputs, edge.source, number);
      if (edge.target >= 0) put(inputs, edge.target, number);
    });
  }
  plan.findings.forEach((finding, number) => {
    if (finding.element >= 0) put(findings, finding.element, number);
    if (finding.line > 0) put(findingLines, finding.line, number);
  });
  return {
    nodesOf: (element) => (element < 0 ? NONE : nodes.get(element) || NONE),
    groups,
    groupAround: (node) => groupAround[node] ?? -1,
    groupOf: (element) => groupOf.get(element) ?? -1,
    childrenOf: (element) => children.get(element) || NONE,
    findingsOf: (element) => findings.get(element) || NONE,
    findingsAt: (line) => findingLines.get(line) || NONE,
    outputs: (node) => outputs.get(node) || NONE,
    inputs: (node) => inputs.get(node) || NONE,
    elementAt: lineFinder(plan.elements),
    isInside: (element, outer) => {
      let at = element;
      while (at > outer) at = plan.elements[at].parent;
      return at === outer;
    },
  };
}

// The element that begins last on or before a place and has not ended is the innermost. Elements of
// behaviour trees need not stand in the order of the text.
function lineFinder(elements) {
  const compare = (one, other) => one.line - other.line || one.column - other.column;
  const order = elements.map((element, number) => number);
  order.sort((one, other) => compare(elements[one], elements[other]) || one - other);
  return (line, column = Infinity) => {
    const place = { line, column };
    let low = 0;
    let high = order.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (compare(elements[order[middle]], place) <= 0) low = middle + 1;
      else high = middle;
    }
    let found = low ? order[low - 1] : -1;
    while (found >= 0 && elements[found].endLine < line) found = elements[found].parent;
    return found;
  };
}
