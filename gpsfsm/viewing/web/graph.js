// The pane of the automaton. The picture is drawn on canvases (screen.js), so that a step of a play
// restyles nothing and large plans open at once; above them lies what moves the view (camera.js).
//
// mountGraph(container, store) -> {fit, show, setStates, redraw, destroy, element, camera}
//   setStates(states: Map(node -> {state, count}), taken: Set(edge))   also taken from the store

import { GOOD_TO_READ, GraphCamera } from "./camera.js";
import { el, themeColor } from "./dom.js";
import { graphLegend } from "./legend.js";
import { cutAt, mountMinimap } from "./overview.js";
import { NAMES_FROM } from "./paint.js";
import { emptyPicture, makePicture } from "./picture.js";
import { saveButtons } from "./saving.js";
import { GraphScreen } from "./screen.js";
import { worstSeverity } from "./words.js";

const SMALLEST_READABLE = 0.4;
const TOGGLE_WIDTH = 24;
const CAPTION_HEIGHT = 24;

export function mountGraph(container, store) {
  const pane = new GraphPane(container, store);
  pane.touch.gpsfsmGraph = pane; // for the console, and for measurements
  return {
    element: pane.box,
    camera: pane.camera,
    fit: () => pane.camera.fit(),
    show: (node) => pane.showNode(node),
    follow: (node) => pane.followNode(node),
    showSelection: () => pane.showSelection(),
    setStates: (states, taken) => pane.setStates(states, taken),
    redraw: () => pane.screen.redraw(),
    picture: () => pane.picture,
    blocks: (picture, zoom) => cutAt(picture, zoom).blocks,
    destroy: () => pane.destroy(),
  };
}

class GraphPane {
  picture = emptyPicture();
  /** @type {Map<number, string>} */
  findings = new Map(); // the worst severity per item
  /** @type {Map<number, string>} */
  groupFindings = new Map(); // and per element that is drawn as an open group
  /** @type {(() => void)[]} */
  stops = [];
  /** @type {Map<number, number[]>} */
  edgesAt = new Map();

  constructor(container, store) {
    this.store = store;
    this.touch = el("div", { class: "graph-touch" });
    this.empty = el("p", { class: "graph-empty", hidden: true });
    this.legend = graphLegend();
    this.minimap = mountMinimap(this);
    this.box = el(
      "div",
      { class: "graph", role: "application", tabindex: "0", "aria-label": "Automaton" },
      this.touch, this.empty,
      graphTools(store, this), this.legend.element, this.minimap.element,
    );
    this.screen = new GraphScreen(this.box, () => this.pointers());
    this.box.prepend(...this.screen.elements);
    container.append(this.box);
    this.states = store.state.states;
    this.taken = store.state.taken;
    /** @type {number | null} */
    this.anchor = null; // the group that is folded or unfolded: it stays where it is
    /** @type {{pan: {x: number, y: number}, zoom: number, fitted: boolean, opened: boolean} | null} */
    this.viewBefore = null; // the one before printing
    this.camera = new GraphCamera(this.box, this.touch, {
      onChange: () => {
        this.screen.viewChanged();
        this.minimap.move();
      },
      onHover: (target) => this.hover(target),
      onTap: (target, point) => this.tap(target, point),
      onDoubleTap: (target) => target.group >= 0 && target.kind !== "folded" && this.toggle(target.group),
    });
    this.screen.camera = this.camera;
    this.listen();
    this.rebuild();
    this.camera.openView();
  }

  listen() {
    const { store } = this;
    this.box.addEventListener("keydown", (event) => this.key(event));
    const theme = matchMedia("(prefers-color-scheme: dark)");
    const recolor = () => {
      this.screen.recolor();
      this.legend.recolor();
      this.minimap.recolor();
    };
    theme.addEventListener("change", recolor);
    const themed = new MutationObserver(recolor);
    themed.observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
    const sized = new ResizeObserver(() => this.resized());
    sized.observe(this.box);
    const print = () => this.print();
    const paper = matchMedia("print"); // its colours are there only when this changes
    const printed = () => this.printed();
    const changed = () => (paper.matches ? this.print() : this.printed());
    addEventListener("beforeprint", print);
    addEventListener("afterprint", printed);
    paper.addEventListener("change", changed);
    this.stops = [
      () => theme.removeEventListener("change", recolor),
      () => themed.disconnect(),
      () => sized.disconnect(),
      () => removeEventListener("beforeprint", print),
      () => removeEventListener("afterprint", printed),
      () => paper.removeEventListener("change", changed),
      store.subscribe(["plan"], () => this.changePlan()),
      store.subscribe(["collapsed", "layout"], (state, changed) => changed.has("plan") || this.refold()),
      store.subscribe(["element", "node", "finding"], () => this.follow()),
      store.subscribe(["states", "taken", "play"], () => this.setStates(store.state.states, store.state.taken)),
      store.subscribe(["hovered", "hoveredNode", "severities"], () => this.screen.pointersChanged()),
    ];
  }

  // -- what is drawn

  rebuild() {
    const { automaton } = this.store.plan;
    this.empty.hidden = Boolean(automaton);
    this.touch.hidden = !automaton;
    this.box.classList.toggle("without", !automaton);
    if (!automaton) {
      this.empty.textContent = "No automaton: the text has errors. The findings explain what to fix.";
      this.picture = emptyPicture();
    } else {
      this.picture = makePicture(automaton, this.store.state.collapsed, this.store.state.layout);
      const { elements } = this.store.plan;
      for (const item of this.picture.items) {
        item.unreachable = item.kind === "runner" && elements[item.element]?.reachable === false;
      }
    }
    this.markFindings();
    this.edgesAt = edgesByItem(this.picture);
    this.camera.setPicture(this.picture);
    for (const [number, severity] of this.findings) this.picture.items[number].finding = severity;
    for (const group of this.picture.groups) group.finding = this.groupFindings.get(group.element);
    this.showRun();
    this.screen.setPicture(this.picture);
    this.legend.show(this.picture);
    this.minimap.show(this.picture);
  }

  // The worst severity per item, and per element that is drawn as an open group.
  markFindings() {
    this.findings = new Map();
    this.groupFindings = new Map();
    if (!this.store.plan.automaton) return;
    const open = new Set(this.picture.groups.map((group) => group.element));
    const put = (map, key, finding) =>
      map.set(key, worstSeverity([finding, { severity: map.get(key) || "" }]));
    for (const finding of this.store.plan.findings) {
      if (finding.suppressed || finding.element < 0) continue;
      if (open.has(finding.element)) put(this.groupFindings, finding.element, finding);
      for (const item of this.itemsOf(finding.element)) put(this.findings, item, finding);
    }
  }

  // The items that show an element: its nodes, or the folded box of its control.
  itemsOf(element) {
    const { itemOf, items } = this.picture;
    const isRunner = this.store.plan.elements[element]?.kind === "runner";
    const nodes = isRunner ? this.store.index.nodesOf(element) : [];
    const shown = new Set(nodes.map((node) => itemOf[node]).filter((item) => item >= 0));
    if (!isRunner) {
      const group = this.store.index.groupOf(element);
      const hiding = group >= 0 ? this.foldedAround(group) : -1;
      if (hiding >= 0) shown.add(items.findIndex((item) => item.group === hiding));
    }
    return shown;
  }

  // With those of what is inside a node of a behaviour tree, which is drawn as no group.
  itemsIn(element) {
    const { automaton, elements } = this.store.plan;
    if (!automaton?.flat || element < 1 || elements[element]?.kind === "runner") return this.itemsOf(element);
    const inside = this.store.index.childrenOf(element);
    return new Set(inside.flatMap((one) => [...this.itemsOf(one), ...this.itemsIn(one)]));
  }

  foldedAround(group) {
    let folded = -1;
    for (let at = group; at >= 0; at = this.store.index.groups[at].parent) {
      if (this.store.state.collapsed.has(at)) folded = at;
    }
    return folded;
  }

  setStates(states, taken) {
    this.states = states;
    this.taken = taken;
    this.showRun();
  }

  showRun() {
    const { edgeOf } = this.picture;
    const taken = new Set();
    for (const edge of this.taken) if (edgeOf[edge] !== undefined) taken.add(edgeOf[edge]);
    const isShown = this.store.state.play || this.states.size;
    const states = isShown ? this.itemStates() : null;
    this.screen.setRun(states, taken);
    this.minimap.setRun(states);
  }

  resized() {
    this.camera.resized();
    this.screen.redraw();
  }

  pointers() {
    const { state } = this.store;
    const { itemOf } = this.picture;
    const selected = state.element >= 0 ? this.itemsIn(state.element) : new Set();
    if (state.node >= 0 && itemOf[state.node] >= 0) selected.add(itemOf[state.node]);
    const hoveredItems =
      state.hoveredNode >= 0
        ? new Set([itemOf[state.hoveredNode]])
        : state.hovered >= 0 ? this.itemsIn(state.hovered) : new Set();
    const near = new Set();
    const addEdges = (items) => {
      for (const edge of [...items].flatMap((item) => this.edgesAt.get(item) || [])) {
        // Those without a route are drawn for one item; for many they would hide all.
        if (items.size < 2 || this.picture.edges[edge].route.length) near.add(edge);
      }
    };
    // While a run is shown, bold edges are those that were taken, and not those of the selection.
    if (!state.play) addEdges(selected);
    addEdges(hoveredItems);
    return {
      selected, hoveredItems, near, element: state.element, hovered: state.hovered,
      findings: this.findings, groupFindings: this.groupFindings,
    };
  }

  // A folded group shows the most telling state of what is in it.
  itemStates() {
    const states = new Map();
    const order = ["running", "failed", "timeout", "stuck", "triggered", "waiting", "stopped", "succeeded", "fired", "never"];
    this.picture.items.forEach((item, number) => {
      if (item.node >= 0) {
        const state = this.states.get(item.node);
        if (state) states.set(number, state);
        return;
      }
      let best = order.length;
      for (const node of item.inside) {
        const rank = order.indexOf(this.states.get(node)?.state);
        if (rank >= 0 && rank < best) best = rank;
      }
      if (best < order.length) states.set(number, { state: order[best], count: 0 });
    });
    return states;
  }

  // Moves the view so that a node is in its middle.
  showNode(node) {
    const item = this.picture.items[this.picture.itemOf[node]];
    if (item) this.camera.showBox(item.box);
  }

  followNode(node) {
    const item = this.picture.items[this.picture.itemOf[node]];
    if (item) this.camera.follow(item.box);
  }

  // The box of what is selected: that of a control, or else of a node; null if nothing is. In a play it is
  // that of the node to which something happens.
  selectedBox() {
    const { element, node, from } = this.store.state;
    const { groups, items, itemOf } = this.picture;
    const group = element > 0 && groups.find((one) => one.element === element);
    if (group && !(from === "player" && items[itemOf[node]])) return group.box;
    const item = items[itemOf[node]] || (element > 0 && items[[...this.itemsIn(element)][0]]);
    return item ? item.box : null;
  }

  showSelection() {
    const box = this.selectedBox();
    if (box) this.camera.showBox(box);
    else this.camera.fit();
  }

  // -- what the user and the other panes do

  changePlan() {
    this.rebuild();
    this.camera.openView();
  }

  refold() {
    const { anchor } = this;
    const before = anchor !== null && this.anchorBox(anchor);
    this.rebuild();
    const after = anchor !== null && this.anchorBox(anchor);
    this.anchor = null;
    if (this.isRevealing) {
      this.isRevealing = false;
      this.camera.fit(false);
      this.moveToSelection();
    } else if (before && after) {
      this.camera.keep(before, after);
    } else {
      this.camera.fit(false);
    }
  }

  anchorBox(group) {
    const drawn =
      this.picture.groups.find((one) => one.group === group) || this.picture.items.find((one) => one.group === group);
    return drawn && drawn.box;
  }

  follow() {
    const { element, node, from } = this.store.state;
    if (from !== "graph" && from !== "" && (element >= 0 || node >= 0) && this.store.plan.automaton) {
      const item = this.picture.items[this.picture.itemOf[node]];
      if (item && item.kind === "folded" && from !== "player") {
        this.isRevealing = true; // the picture is made again, and then moved
        this.store.reveal(node);
      } else {
        this.moveToSelection();
      }
    }
    this.minimap.settle();
    this.screen.pointersChanged();
  }

  moveToSelection() {
    const box = this.selectedBox();
    if (!box) return;
    const isPlaying = this.store.state.from === "player";
    if (isPlaying && this.camera.fitted) return; // all of it is in view
    if (this.camera.zoom >= (isPlaying ? NAMES_FROM : SMALLEST_READABLE)) this.camera.nudgeTo(box);
    else this.camera.showBox(box, isPlaying ? GOOD_TO_READ : undefined);
  }

  hover(target) {
    if (!target) this.store.hoverElement(-1);
    else if (target.node >= 0) this.store.hoverNode(target.node);
    else this.store.hoverElement(target.element);
  }

  tap(target, point) {
    this.box.focus({ preventScroll: true });
    if (!target) {
      this.store.selectElement(-1, "graph");
    } else if (target.group >= 0 && (target.kind === "folded" || onToggle(target, point))) {
      this.toggle(target.group);
    } else if (target.node >= 0) {
      this.store.selectNode(target.node, "graph");
    } else {
      this.store.selectElement(target.element, "graph");
    }
  }

  toggle(group) {
    this.anchor = group;
    this.store.toggleGroup(group);
  }

  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const step = 60;
    const moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (moves[event.key]) this.camera.moveBy(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") this.camera.zoomBy(1.25);
    else if (event.key === "-") this.camera.zoomBy(0.8);
    else if (event.key === "Enter") this.toggleSelected();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  toggleSelected() {
    const { element } = this.store.state;
    const group = element >= 0 ? this.store.index.groupOf(element) : -1;
    if (group >= 0) this.toggle(group);
  }

  // Printed is the whole picture, in a box of its form.
  print() {
    const { pan, zoom, fitted, opened } = this.camera;
    if (!this.viewBefore) this.viewBefore = { pan, zoom, fitted, opened };
    this.box.style.setProperty("--form", `${this.picture.width + 48} / ${this.picture.height + 48}`);
    this.camera.onPaper = true;
    this.camera.fit(false);
    this.screen.onPaper = true;
    this.screen.recolor();
    this.screen.paint();
  }

  // The view is what it was.
  printed() {
    const { viewBefore } = this;
    this.viewBefore = null;
    this.camera.onPaper = false;
    if (viewBefore) {
      this.camera.setView(viewBefore);
      this.camera.fitted = viewBefore.fitted;
      this.camera.opened = viewBefore.opened;
    }
    this.screen.onPaper = false;
    this.screen.recolor();
  }

  // With the pen of a file: what is selected stays, what is pointed at does not.
  paintSaved(pen, view) {
    this.screen.paintAll(pen, view, { hoveredItems: new Set(), hovered: -1 });
  }

  paper() {
    return themeColor("--graph-paper");
  }

  destroy() {
    this.screen.destroyed = true;
    this.stops.forEach((stop) => stop());
    this.camera.destroy();
    this.box.remove();
  }
}

function onToggle({ box }, point) {
  return point.x - box.x < TOGGLE_WIDTH && point.y - box.y < CAPTION_HEIGHT;
}

function edgesByItem(picture) {
  const edges = new Map();
  picture.edges.forEach((edge, number) => {
    for (const item of new Set([edge.source, edge.target])) {
      if (item < 0) continue;
      if (!edges.has(item)) edges.set(item, []);
      edges.get(item).push(number);
    }
  });
  return edges;
}

// -- its buttons -------------------------------------------------------------------------------

function toolButton(sign, title, onclick) {
  return el("button", { type: "button", class: "tool", title, "aria-label": title, onclick }, sign);
}

// More items than this are not unfolded at once.
const MOST_UNFOLDED = 4000;

export function graphTools(store, pane) {
  const layered = toolButton("⇅", "Layout: by structure, or layered", () => {
    store.set({ layout: store.state.layout === "layered" ? "structure" : "layered" });
  });
  const showLayout = () => {
    layered.setAttribute("aria-pressed", String(store.state.layout === "layered"));
    layered.disabled = !store.plan.automaton?.layered && store.state.layout !== "layered";
  };
  store.subscribe(["layout", "plan"], showLayout);
  showLayout();
  return el(
    "div",
    { class: "graph-tools", role: "toolbar", "aria-label": "View of the automaton" },
    toolButton("+", "Zoom in (+)", () => pane.camera.zoomBy(1.25)),
    toolButton("−", "Zoom out (-)", () => pane.camera.zoomBy(0.8)),
    toolButton("⤢", "Show everything (f)", () => pane.camera.fit()),
    toolButton("◎", "Show the selection (s)", () => pane.showSelection()),
    toolButton("⊟", "Fold everything", () => store.collapseAll()),
    toolButton("⊞", "Unfold everything", () => unfold(store)),
    depthChooser(store),
    layered,
    saveButtons(pane, () => store.plan.name),
  );
}

function depthChooser(store) {
  const chooser = el(
    "select",
    {
      class: "tool", title: "Fold what lies deeper than", "aria-label": "Fold what lies deeper than",
      onchange: () => chooser.value && store.collapseToDepth(Number(chooser.value)),
    },
    el("option", { value: "" }, "depth"),
    [1, 2, 3, 4, 5].map((depth) => el("option", { value: depth }, String(depth))),
  );
  store.subscribe(["plan"], () => (chooser.value = ""));
  return chooser;
}

// Unfolds level by level as long as the picture stays usable.
export function unfold(store) {
  const { groups } = store.index;
  const nodes = store.plan.automaton ? store.plan.automaton.nodes.length : 0;
  if (nodes <= MOST_UNFOLDED) {
    store.expandAll();
    return;
  }
  const deepest = groups.reduce((depth, group) => Math.max(depth, group.depth), 0);
  const inLevel = Array(deepest + 2).fill(0);
  for (const group of groups) inLevel[group.depth] += 1;
  for (let node = 0; node < nodes; node += 1) {
    const around = store.index.groupAround(node);
    inLevel[around < 0 ? 0 : groups[around].depth + 1] += 1;
  }
  let depth = 0;
  let shown = inLevel[0];
  while (depth <= deepest && shown + inLevel[depth + 1] <= MOST_UNFOLDED) {
    depth += 1;
    shown += inLevel[depth];
  }
  store.collapseToDepth(depth);
}
