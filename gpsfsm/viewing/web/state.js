// The one store of a page (or of one side of a comparison): the document, lookups in it, and what is
// shown, selected and played.
//
// createStore(viewDocument) -> store
//   store.document            the view document (never changed)
//   store.state               the current values, see `initialState`; read only
//   store.plan                shorthand: document.plans[state.plan]
//   store.index               planIndex(plan): lookups between elements, nodes, groups and lines
//   store.link(i)             the address of a finding, where there is one, else null
//   store.set({key: value})   changes values and tells subscribers of these keys, even if a value
//                             is the same object as before (so that Maps may be changed in place)
//   store.subscribe(["key", …], fn) -> unsubscribe     fn(state, changedKeys: Set)
// Actions (everything that has consequences goes through these):
//   store.showPlan(i)                   another plan of the document; resets what belongs to a plan
//   store.selectElement(i, from)        -1: nothing. from: "tree" | "graph" | "source" | "finding"
//                                       | "search" | "player": panes other than `from` scroll to it
//   store.selectNode(n, from)           a node of the automaton (selects its element as well)
//   store.selectLine(line, from, column)   what stands on a line of the text
//   store.selectFinding(i)              an index in plan.findings; selects its element and line
//   store.hoverElement(i), store.hoverNode(n)
//   store.openPlay(play, origin)        a Play object, or null to close the player;
//                                       origin: {kind: "finding"|"task"|"diff"|"run", index}
//   store.toggleGroup(g), store.collapseAll(), store.expandAll(), store.collapseToDepth(d)
//
// The player (player.js) owns frame, playing, speed, states and taken: it sets
//   states: Map(node index -> {state, count})   and   taken: Set(edge index)
// and graph, tree and source draw them.

const LARGE_PLAN = 2500; // nodes; above, plans open folded, and Python has divided long rows

export function initialState() {
  return {
    plan: 0, // index in document.plans
    element: -1, // selected element
    node: -1, // selected node of the automaton, -1 if only an element is selected
    from: "", // the pane in which the selection was made
    line: 0, // line to show in the source, from 1; 0: none
    hovered: -1, // element under the pointer
    hoveredNode: -1, // node under the pointer
    finding: -1, // selected finding, index in plan.findings
    severities: { error: true, warning: true, info: true, suppressed: false }, // finding filter
    play: null, // the Play that is open
    /** @type {{kind: string, index: number} | null} */
    playOrigin: null,
    frame: 0, // number of records that are applied, 0 … play.records.length
    playing: false,
    speed: 1,
    states: new Map(), // node index -> {state, count}
    taken: new Set(), // indices in automaton.edges
    collapsed: new Set(), // groups (indices in store.index.groups) that are drawn as one box
    closed: new Set(), // elements whose rows in the tree are closed
    search: "", // text of the search
    hits: [], // elements found
    layout: "structure", // or "layered"
  };
}

function withInner(groups, chosen) {
  return new Set(groups.flatMap((group, number) => (chosen(group) ? [number] : [])));
}

// How a plan opens: small ones unfolded, large ones with what lies deeper than the top folded.
export function openingFolds(plan) {
  const automaton = plan.automaton;
  if (!automaton || automaton.nodes.length <= LARGE_PLAN) return new Set();
  return withInner(planIndex(plan).groups, () => true);
}

export function createStore(viewDocument) {
  const subscribers = new Set();
  const waiting = [];
  let telling = false;

  const store = {
    document: viewDocument,
    state: initialState(),
    /** @type {((finding: number) => string) | null} */
    link: null, // the address at which a finding is shown, set by pages that have one
    get plan() {
      return viewDocument.plans[store.state.plan];
    },
    get index() {
      return planIndex(store.plan);
    },
    set(values) {
      Object.assign(store.state, values);
      waiting.push(new Set(Object.keys(values)));
      if (telling) return; // subscribers hear of it after the change before
      telling = true;
      try {
        while (waiting.length) tell(waiting.shift());
      } finally {
        telling = false;
      }
    },
    subscribe(keys, fn) {
      const subscriber = { keys: new Set(keys), fn };
      subscribers.add(subscriber);
      return () => subscribers.delete(subscriber);
    },
  };

  function tell(changed) {
    for (const { keys, fn } of [...subscribers]) {
      if (![...changed].some((key) => keys.has(key))) continue;
      try {
        fn(store.state, changed);
      } catch (error) {
        // One pane that fails must not take the others with it.
        reportError(error);
      }
    }
  }

  store.set({ collapsed: openingFolds(store.plan) });
  return Object.assign(store, selections(store), folds(store));
}

function selections(store) {
  const lineOf = (element) => (element >= 0 ? store.plan.elements[element].line : 0);
  return {
    showPlan(number) {
      const plan = store.document.plans[number];
      if (!plan) return;
      const { severities, speed, layout } = store.state;
      const fresh = { ...initialState(), severities, speed, layout, plan: number };
      store.set({ ...fresh, collapsed: openingFolds(plan) });
    },
    selectElement(element, from = "") {
      const nodes = element >= 0 ? store.index.nodesOf(element) : [];
      store.set({ element, node: nodes.length ? nodes[0] : -1, from, line: lineOf(element) });
    },
    selectNode(node, from = "") {
      const element = node >= 0 ? store.plan.automaton.nodes[node].element : -1;
      store.set({ element, node, from, line: lineOf(element) });
    },
    selectFinding(number) {
      const finding = store.plan.findings[number];
      if (!finding) {
        store.set({ finding: -1 });
        return;
      }
      const element = finding.element;
      const nodes = element >= 0 ? store.index.nodesOf(element) : [];
      const node = nodes.length ? nodes[0] : -1;
      store.set({ finding: number, element, node, from: "finding", line: finding.line });
    },
    selectLine(line, from = "source", column = Infinity) {
      const element = store.index.elementAt(line, column);
      const nodes = element >= 0 ? store.index.nodesOf(element) : [];
      store.set({ element, node: nodes.length ? nodes[0] : -1, from, line });
    },
    hoverElement(element) {
      if (element === store.state.hovered && store.state.hoveredNode === -1) return;
      store.set({ hovered: element, hoveredNode: -1 });
    },
    hoverNode(node) {
      if (node === store.state.hoveredNode) return;
      const hovered = node >= 0 ? store.plan.automaton.nodes[node].element : -1;
      store.set({ hovered, hoveredNode: node });
    },
    /** @param {any} play @param {{kind: string, index: number} | null} origin */
    openPlay(play, origin = null) {
      store.set({
        play,
        playOrigin: play ? origin : null,
        frame: 0,
        playing: false,
        states: new Map(),
        taken: new Set(),
      });
    },
  };
}

function folds(store) {
  const groups = () => store.index.groups;
  return {
    toggleGroup(group) {
      const collapsed = new Set(store.state.collapsed);
      if (!collapsed.delete(group)) collapsed.add(group);
      store.set({ collapsed });
    },
    collapseAll() {
      store.set({ collapsed: withInner(groups(), () => true) });
    },
    expandAll() {
      store.set({ collapsed: new Set() });
    },
    collapseToDepth(depth) {
      store.set({ collapsed: withInner(groups(), (group) => group.depth >= depth) });
    },
    // Unfolds what hides a node.
    reveal(node) {
      if (!store.plan.automaton || node < 0) return;
      const collapsed = new Set(store.state.collapsed);
      let group = store.index.groupAround(node);
      for (; group >= 0; group = groups()[group].parent) collapsed.delete(group);
      if (collapsed.size !== store.state.collapsed.size) store.set({ collapsed });
    },
  };
}

// -- lookups in one plan of the view document: elements, nodes, groups and lines -----------------

const indices = new WeakMap();

/** @type {readonly number[]} */
const NONE = Object.freeze([]);

// planIndex(plan) ->
//   nodesOf(element)     nodes of the automaton that come from an element
//   groupOf(element)     the group that a control is drawn as, -1 if none
//   groups               the groups of the automaton, with the parts of long rows
//   groupAround(node)    the innermost group around a node, -1 if none
//   childrenOf(element)  elements directly inside
//   elementAt(line, column)   the innermost element at a place (from 1), -1 if none
//   findingsOf(element)  indices of the findings whose place is the element
//   findingsAt(line)     indices of the findings on a line
//   isShared(line)       true if several runners, or elements called alike, begin on a line
//   outputs(node)        indices of the edges that leave a node, inputs(node) of those that enter
//   isInside(element, outer)
export function planIndex(plan) {
  let index = indices.get(plan);
  if (!index) {
    index = makeIndex(plan);
    indices.set(plan, index);
  }
  return index;
}

function put(map, key, value) {
  const list = map.get(key);
  if (list) list.push(value);
  else map.set(key, [value]);
}

function makeIndex(plan) {
  const nodes = new Map();
  const children = new Map();
  const groupOf = new Map();
  const groups = plan.automaton ? plan.automaton.groups : [];
  const findings = new Map();
  const findingLines = new Map();
  const outputs = new Map();
  const inputs = new Map();
  const columns = new Map(); // where the last one of a name begins on a line
  const shared = new Set();
  plan.elements.forEach((element, number) => {
    put(children, element.parent, number);
    const name = `${element.line} ${element.kind === "runner" ? "" : element.label}`;
    if ((columns.get(name) ?? element.column) !== element.column) shared.add(element.line);
    columns.set(name, element.column);
  });
  if (plan.automaton) {
    plan.automaton.nodes.forEach((node, number) => put(nodes, node.element, number));
    groups.forEach((group, number) => group.element >= 0 && groupOf.set(group.element, number));
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
    groupAround: (node) => plan.automaton?.group_of[node] ?? -1,
    groupOf: (element) => groupOf.get(element) ?? -1,
    childrenOf: (element) => children.get(element) || NONE,
    findingsOf: (element) => findings.get(element) || NONE,
    findingsAt: (line) => findingLines.get(line) || NONE,
    isShared: (line) => shared.has(line),
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
    let element = low ? order[low - 1] : -1;
    while (element >= 0 && elements[element].endLine < line) element = elements[element].parent;
    return element;
  };
}

// -- the document, whose lists were packed as columns (gpsfsm/viewing/page.py) ----------------

// unpack(value) -> the document; a document that is not packed comes back as it is
export function unpack(value) {
  if (Array.isArray(value)) return value.map(unpack);
  if (value === null || typeof value !== "object") return value;
  if (Array.isArray(value.$columns)) return unpackRows(value.$columns, value.$rows);
  const unpacked = {};
  for (const [name, part] of Object.entries(value)) unpacked[name] = unpack(part);
  return unpacked;
}

function unpackRows(columns, count) {
  const rows = Array.from({ length: count }, () => ({}));
  for (const column of columns) {
    const values = columnValues(column);
    values.forEach((value, place) => {
      rows[column.at ? column.at[place] : place][column.name] = value;
    });
  }
  return rows;
}

function columnValues(column) {
  if (column.of) return column.of.map((number) => column.values[number]);
  if (!column.steps) return column.all.map(unpack);
  let value = 0;
  return column.steps.map((step) => (value += step));
}
