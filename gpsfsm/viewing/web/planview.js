// One plan: findings and tree at the left, the automaton with the player in the middle, the text at
// the right.

import { el, grouped } from "./dom.js";
import { mountFindings, shownFindings, stepFinding } from "./findings.js";
import { mountGraph } from "./graph.js";
import { bindPlayer, mountStoreBar, openPlayAt } from "./playbar.js";
import { planCopies } from "./saving.js";
import { mountSource } from "./source.js";
import { makeTabs, mountSplitter, tabPanel } from "./tabs.js";
import { mountPlayTimeline } from "./timeline.js";
import { mountTree } from "./tree.js";

// planStage(container, store, tell) -> {player, graph, focus, stepFinding, openPlay, redraw}
//   tell(text): a pane could not be made; the others are there all the same
export function planStage(container, store, tell) {
  const boxes = {
    findings: tabPanel("findings", "tab", { class: "tab-body" }),
    tree: tabPanel("tree", "tab", { class: "tab-body", hidden: true }),
    graph: el("section", { class: "pane pane-graph", "aria-label": "Automaton" }),
    source: el("section", { class: "pane pane-source", "aria-label": "Text" }),
  };
  const showPanel = (name) => {
    boxes.findings.hidden = name !== "findings";
    boxes.tree.hidden = name !== "tree";
  };
  const entries = [["findings", "Findings"], ["tree", "Tree"]];
  const { list, buttons, choose } = makeTabs(entries, showPanel, { label: "Findings or tree", prefix: "tab" });
  const panes = el("div", { class: "panes" });
  const left = el(
    "section",
    { class: "pane pane-left", "aria-label": "Findings and tree" },
    list,
    boxes.findings,
    boxes.tree,
  );
  panes.append(
    left, mountSplitter(panes, "--left", 1), boxes.graph, mountSplitter(panes, "--right", -1), boxes.source,
  );
  container.append(panes);

  const player = bindPlayer(store);
  const made = {};
  const mount = (name, work) => {
    try {
      made[name] = work();
    } catch (error) {
      tell(`${name}: ${error.message}`);
      console.error(error);
    }
  };
  mount("findings", () => mountFindings(boxes.findings, store, player));
  mount("tree", () => mountTree(boxes.tree, store));
  mount("graph", () => mountGraph(boxes.graph, store));
  mount("timeline", () => mountPlayTimeline(boxes.graph, store, player));
  mount("bar", () => mountStoreBar(boxes.graph, store, player));
  boxes.source.append(el("div", { class: "pane-head" }, "Text", planCopies(store)));
  mount("source", () => mountSource(boxes.source, store));

  function count() {
    const { length } = store.plan.findings.filter((finding) => !finding.suppressed);
    buttons[0].textContent = `Findings ${length}`;
    buttons[1].textContent = `Tree ${grouped(store.plan.elements.length)}`;
  }

  function open() {
    count();
    choose(store.plan.findings.length ? "findings" : "tree");
  }

  store.subscribe(["plan"], open);
  open();
  return {
    player,
    graph: made.graph || { fit() {}, showSelection() {} },
    focus(name) {
      if (name === "findings" || name === "tree") choose(name);
      if (made[name] && made[name].focus) made[name].focus();
      else if (made[name]) made[name].element.focus();
    },
    stepFinding(by) {
      choose("findings");
      stepFinding(store, by);
    },
    openPlay() {
      const { findings } = store.plan;
      const index = findings[store.state.finding] ? store.state.finding : (shownFindings(store)[0] ?? -1);
      if (index >= 0 && findings[index].play >= 0) {
        openPlayAt(store, player, findings[index].play, { kind: "finding", index });
      }
    },
    redraw: () => made.graph && made.graph.redraw(),
  };
}
