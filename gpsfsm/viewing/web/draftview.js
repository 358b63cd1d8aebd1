// The plan that is being written: its automaton, the scenarios of its findings, and below it findings,
// tree and text of the plan in the middle.

import { el, replaceContent } from "./dom.js";
import { mountFindings } from "./findings.js";
import { mountGraph } from "./graph.js";
import { bindPlayer, mountStoreBar } from "./playbar.js";
import { planCopies } from "./saving.js";
import { mountSource } from "./source.js";
import { createStore } from "./state.js";
import { makeTabs, tabPanel } from "./tabs.js";
import { mountPlayTimeline } from "./timeline.js";
import { mountTree } from "./tree.js";

// What somebody has chosen and folded stays when the text changes; elements are identified by their paths.
function carryOver(old, store) {
  if (!old || !old.plan || !store.plan) return;
  const pathsOf = (plan) => new Map(plan.elements.map((each, number) => [each.path, number]));
  const paths = pathsOf(store.plan);
  const { state } = old;
  const changes = { severities: state.severities, speed: state.speed, layout: state.layout };
  const chosen = state.element >= 0 ? paths.get(old.plan.elements[state.element].path) : undefined;
  if (old.plan.automaton && store.plan.automaton) changes.collapsed = foldedAgain(old, store, paths);
  store.set(changes);
  if (chosen !== undefined) store.selectElement(chosen, "source");
}

function foldedAgain(old, store, paths) {
  const folded = new Set(store.state.collapsed);
  const groups = new Map(store.plan.automaton.groups.map((group, number) => [group.element, number]));
  for (const number of old.state.collapsed) {
    const element = old.plan.automaton.groups[number].element;
    const group = groups.get(paths.get(old.plan.elements[element]?.path));
    if (group !== undefined) folded.add(group);
  }
  return folded;
}

/** @typedef {ReturnType<typeof createStore>} Store */

// -> {show(document) -> store or null, store, selectLine}
export function mountDraftStage(container) {
  const empty = el("div", { class: "stage-empty" });
  const box = el("div", { class: "graph-box" });
  const bar = el("div", { class: "draft-player" });
  container.append(empty, box, bar);
  /**
   * @type {{store: Store | null, graph: ReturnType<typeof mountGraph> | null,
   *   timeline: ReturnType<typeof mountPlayTimeline> | null, bar: ReturnType<typeof mountStoreBar> | null,
   *   player: ReturnType<typeof bindPlayer> | null}}
   */
  const shared = { store: null, graph: null, timeline: null, bar: null, player: null };
  tell(null);

  function tell(store) {
    const plan = store ? store.plan : null;
    const drawn = Boolean(plan && plan.automaton);
    empty.hidden = drawn;
    box.hidden = bar.hidden = !drawn;
    if (drawn) return;
    const words = plan
      ? ["No automaton yet.", "The findings below the editor say what is wrong with the text."]
      : ["No plan yet.", "Type a plan, drop a file, load the example, or let a model write one for a task."];
    replaceContent(empty, el("p", {}, el("strong", {}, words[0])), el("p", {}, words[1]));
  }

  function clear() {
    for (const part of [shared.graph, shared.timeline, shared.bar, shared.player]) if (part) part.destroy();
    if (shared.player) shared.player.release();
    shared.graph = shared.timeline = shared.bar = shared.player = null;
    replaceContent(box);
    replaceContent(bar);
  }

  return {
    store: () => shared.store,
    player: () => shared.player,
    graph: () => shared.graph,
    show(view) {
      clear();
      const store = view ? createStore(view) : null;
      if (store) carryOver(shared.store, store);
      shared.store = store;
      tell(store);
      if (store) shared.player = bindPlayer(store);
      if (store && store.plan.automaton) {
        shared.graph = mountGraph(box, store);
        shared.timeline = mountPlayTimeline(bar, store, shared.player);
        shared.bar = mountStoreBar(bar, store, shared.player);
      }
      return store;
    },
    selectLine(line) {
      if (shared.store && shared.store.plan.elements.length) shared.store.selectLine(line, "source");
    },
  };
}

// -- findings, tree and text of the plan that is in the middle -----------------------------------

/** @type {[string, string, (container: any, store: any, player: any) => any][]} */
const PANES = [
  ["findings", "Findings", mountFindings],
  ["tree", "Tree", mountTree],
  ["text", "Text", mountText],
];

function mountText(container, store) {
  container.append(planCopies(store));
  return mountSource(container, store);
}

// -> {show(store, player)}: mounts the panes for another store; null shows that there is nothing.
export function mountDetails(container) {
  /** @type {{element: HTMLElement, focus?: () => void, destroy: () => void}[]} */
  const mounted = [];
  const shared = { store: null, player: null, key: "findings", mounted };
  const panels = PANES.map(([key]) => tabPanel(key, "details", { class: `details-panel ${key}` }));
  const wiring = { label: "Details of the plan", prefix: "details" };
  const tabs = makeTabs(PANES.map(([key, words]) => [key, words]), chosen, wiring);
  container.append(tabs.list, ...panels);

  function chosen(key) {
    shared.key = key;
    PANES.forEach(([each], number) => {
      panels[number].hidden = each !== key;
    });
    mountChosen();
  }

  // A pane is made when it is looked at: typing must not make three of them each time.
  function mountChosen() {
    const number = PANES.findIndex(([key]) => key === shared.key);
    if (!shared.store || shared.mounted[number]) return;
    shared.mounted[number] = PANES[number][2](panels[number], shared.store, shared.player);
  }

  tabs.choose("findings");
  return {
    choose(key, focus = false) {
      tabs.choose(key);
      const pane = shared.mounted[PANES.findIndex(([each]) => each === key)];
      if (focus && pane && pane.focus) pane.focus();
    },
    show(store, player = null) {
      if (store === shared.store && shared.mounted.length) return;
      const scroller = panels.map((panel) => panel.firstElementChild && panel.firstElementChild.scrollTop);
      for (const mounted of shared.mounted) if (mounted && mounted.destroy) mounted.destroy();
      for (const panel of panels) panel.textContent = "";
      Object.assign(shared, { store, player, mounted: [] });
      if (!store) {
        for (const panel of panels) panel.append(el("p", { class: "nothing" }, "No plan yet."));
        return;
      }
      mountChosen();
      panels.forEach((panel, place) => {
        if (panel.firstElementChild && scroller[place]) panel.firstElementChild.scrollTop = scroller[place];
      });
    },
  };
}
