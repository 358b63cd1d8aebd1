// One plan: findings and tree at the left, the automaton with the player in the middle, the text at
// the right.

import { el, grouped } from "./dom.js";
import { mountFindings, shownFindings, stepFinding } from "./findings.js";
import { mountGraph } from "./graph.js";
import { bindPlayer, mountStoreBar, openPlayAt } from "./playbar.js";
import { planCopies } from "./saving.js";
import { mountSource } from "./source.js";
import { mountSplitter } from "./tabs.js";
import { mountPlayTimeline } from "./timeline.js";
import { mountTree } from "./tree.js";

// planStage(container, store, tell) -> {player, graph, focus, stepFinding, openPlay, redraw}
//   tell(text): a pane could not be made; the others are there all the same
export function planStage(container, store, tell) {
  const boxes = {
    findings: el("div", { class: "tab-body", role: "tabpanel", id: "panel-findings", "aria-labelledby": "tab-findings" }),
    tree: el("div", { class: "tab-body", role: "tabpanel", id: "panel-tree", "aria-labelledby": "tab-tree", hidden: true }),
    graph: el("section", { class: "pane pane-graph", "aria-label": "Automaton" }),
    source: el("section", { class: "pane pane-source", "aria-label": "Text" }),
  };
  const tabs = { findings: tabButton("findings", "Findings"), tree: tabButton("tree", "Tree") };
  const panes = el("div", { class: "panes" });
  const left = el(
    "section",
    { class: "pane pane-left", "aria-label": "Findings and tree" },
    el("div", { class: "tabs", role: "tablist", "aria-label": "Findings or tree" }, Object.values(tabs)),
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

  function choose(name) {
    for (const [each, tab] of Object.entries(tabs)) {
      tab.setAttribute("aria-selected", String(each === name));
      tab.tabIndex = each === name ? 0 : -1;
      boxes[each].hidden = each !== name;
    }
  }

  function tabButton(name, word) {
    return el(
      "button",
      {
        type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`,
        onclick: () => choose(name),
        onkeydown: (event) => {
          if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
          const other = name === "tree" ? "findings" : "tree";
          choose(other);
          tabs[other].focus();
        },
      },
      word,
    );
  }

  function count() {
    const { length } = store.plan.findings.filter((finding) => !finding.suppressed);
    tabs.findings.textContent = `Findings ${length}`;
    tabs.tree.textContent = `Tree ${grouped(store.plan.elements.length)}`;
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
      if (tabs[name]) choose(name);
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
