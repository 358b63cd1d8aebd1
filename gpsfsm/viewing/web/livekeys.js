// The keys of the live page. Those of plans are the keys of a report.

import { stepFinding } from "./findings.js";
import { bindKeys, helpDialog } from "./keys.js";

const LIVE_PANE_KEYS = [
  [["Ctrl+Enter"], "in the editor: run the plan"],
  [["↑", "↓", "←", "→"], "in the tree: move, open and close; in the automaton: move it"],
  [["Enter"], "open or fold what is selected"],
  [["+", "-"], "in the automaton: zoom"],
];

// -> {dialog}: the overlay that explains the keys, to be put into the page.
export function mountLiveKeys(page) {
  const onStore = (run) => () => page.store() && run(page.store());
  const onRun = (run) => () => page.shown === "run" && page.stage && run(page.stage, page.watch);
  const forward = (way) => () => {
    if (page.shown === "run" && page.watch) page.watch.step(way);
    else if (page.draftPlayer()) page.draftPlayer()[way > 0 ? "step" : "back"]();
  };
  const toggle = () => {
    if (page.shown === "run" && page.watch) page.stage.toggle();
    else if (page.draftPlayer()) page.draftPlayer().toggle();
  };
  const bindings = [
    { key: "e", word: "to the editor", run: () => page.goTo("editor") },
    { key: "r", word: "to the runs", run: () => page.goTo("runs") },
    { key: "/", word: "search", run: () => page.search && page.search.focus() },
    { key: "n", word: "next finding", run: onStore((store) => stepFinding(store, 1)) },
    { key: "p", word: "previous finding", run: onStore((store) => stepFinding(store, -1)) },
    { key: " ", word: "pause the run or let it go on; play or stop what is looked at again", run: toggle },
    { key: ".", word: "step forward", run: forward(1) },
    { key: ",", word: "step back", run: forward(-1) },
    { key: "l", word: "show what happens now", run: onRun((_, watch) => watch.attach()) },
    { key: "x", word: "let the selected runner fail, if it is running", run: onRun((stage) => stage.failSelected()) },
    { key: "f", word: "show the whole automaton", run: () => page.graph() && page.graph().fit() },
    { key: "1", word: "to the findings", run: () => page.details.choose("findings", true) },
    { key: "2", word: "to the tree", run: () => page.details.choose("tree", true) },
    { key: "3", word: "to the automaton", run: () => page.graph() && page.graph().element.focus() },
    { key: "4", word: "to the text", run: () => page.details.choose("text", true) },
    { key: "Escape", word: "select nothing", run: onStore((store) => store.selectElement(-1)) },
    { key: "t", word: "theme", run: () => page.theme.next() },
    { key: "?", word: "these keys", run: () => dialog.showModal() },
  ];
  const dialog = helpDialog(bindings, LIVE_PANE_KEYS);
  bindKeys(bindings);
  return { dialog };
}
