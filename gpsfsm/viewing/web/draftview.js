// The automaton of the plan that is being written, and the scenarios of its findings.

import { el, replaceContent } from "./dom.js";
import { mountGraph } from "./graph.js";
import { bindPlayer, mountStoreBar } from "./playbar.js";
import { createStore } from "./state.js";

// What somebody has chosen and folded stays when the text changes; elements are known by their paths.
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

// -> {show(document) -> store or null, store, selectLine}
export function mountDraftStage(container) {
  const empty = el("div", { class: "stage-empty" });
  const box = el("div", { class: "graph-box" });
  const bar = el("div", { class: "draft-player" });
  container.append(empty, box, bar);
  const shared = { store: null, graph: null, bar: null, player: null };
  tell(null);

  function tell(store) {
    const plan = store ? store.plan : null;
    const drawn = Boolean(plan && plan.automaton);
    empty.hidden = drawn;
    box.hidden = bar.hidden = !drawn;
    if (drawn) return;
    const words = plan
      ? ["There is no automaton yet.", "What is wrong with the text stands below the editor."]
      : ["No plan yet.", "Type one, drop a file, take the example, or let a model write one from a task."];
    replaceContent(empty, el("p", {}, el("strong", {}, words[0])), el("p", {}, words[1]));
  }

  function clear() {
    for (const part of [shared.graph, shared.bar, shared.player]) if (part) part.destroy();
    if (shared.player) shared.player.release();
    shared.graph = shared.bar = shared.player = null;
    replaceContent(box);
    replaceContent(bar);
  }

  return {
    store: () => shared.store,
    player: () => shared.player,
    graph: () => shared.graph,
    show(found) {
      clear();
      const store = found ? createStore(found) : null;
      if (store) carryOver(shared.store, store);
      shared.store = store;
      tell(store);
      if (store) shared.player = bindPlayer(store);
      if (store && store.plan.automaton) {
        shared.graph = mountGraph(box, store);
        shared.bar = mountStoreBar(bar, store, shared.player);
      }
      return store;
    },
    selectLine(line) {
      if (shared.store && shared.store.plan.elements.length) shared.store.selectLine(line, "source");
    },
  };
}
