// Findings, tree and text of the plan that is in the middle, below the editor or the list of runs.

import { el } from "./dom.js";
import { mountFindings } from "./findings.js";
import { mountSource } from "./source.js";
import { makeTabs, tabPanel } from "./tabs.js";
import { mountTree } from "./tree.js";

const PANES = [
  ["findings", "Findings", mountFindings],
  ["tree", "Tree", mountTree],
  ["text", "Text", mountSource],
];

// -> {show(store, player)}: mounts the panes for another store; null shows that there is nothing.
export function mountDetails(container) {
  const shared = { store: null, player: null, key: "findings", mounted: [], places: {} };
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
        for (const panel of panels) panel.append(el("p", { class: "nothing" }, "There is no plan yet."));
        return;
      }
      mountChosen();
      panels.forEach((panel, place) => {
        if (panel.firstElementChild && scroller[place]) panel.firstElementChild.scrollTop = scroller[place];
      });
    },
  };
}
