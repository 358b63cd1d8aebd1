// The buttons of the graph pane and its legend.

import { el } from "./dom.js";
import { EVENTS, STATES } from "./words.js";
import { MOST_LAYERED } from "./layered.js";

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
    const nodes = store.plan.automaton ? store.plan.automaton.nodes.length : 0;
    layered.setAttribute("aria-pressed", String(store.state.layout === "layered"));
    layered.disabled = nodes > MOST_LAYERED && store.state.layout !== "layered";
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

export function graphLegend() {
  const line = (event) =>
    el(
      "li",
      {},
      el("span", { class: `legend-line legend-${EVENTS[event].line} event-${event.toLowerCase()}` }),
      EVENTS[event].word,
    );
  const state = (name) =>
    el("li", {}, el("span", { class: `state state-${name}` }, STATES[name].sign), STATES[name].word);
  return el(
    "details",
    { class: "graph-legend" },
    el("summary", {}, "Legend"),
    el(
      "ul",
      {},
      ["SUCCEEDED", "FAILED", "STARTED", "STOPPED"].map(line),
      el("li", {}, el("span", { class: "legend-open" }), "leads nowhere"),
      ["triggered", "running", "succeeded", "failed", "timeout", "stopped", "waiting", "never", "reached"].map(state),
    ),
  );
}
