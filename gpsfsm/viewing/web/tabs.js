// A row of tabs: one is chosen, the arrow keys go to the next ones.

import { el } from "./dom.js";

// makeTabs([[key, words], …], onChoose, {label, prefix}) -> {list, buttons, choose}
//   The tab of a key has the id `<prefix>-<key>` and leads to what has the id `<prefix>-panel-<key>`.
export function makeTabs(entries, onChoose, { label, prefix }) {
  const keys = entries.map(([key]) => key);
  const buttons = entries.map(([key, words]) =>
    el(
      "button",
      {
        class: "tab",
        type: "button",
        role: "tab",
        id: `${prefix}-${key}`,
        "aria-controls": `${prefix}-panel-${key}`,
        onclick: () => choose(key),
      },
      words,
    ),
  );
  const list = el("div", { class: "tabs", role: "tablist", "aria-label": label }, buttons);

  function choose(key) {
    buttons.forEach((each, number) => {
      const chosen = keys[number] === key;
      each.setAttribute("aria-selected", String(chosen));
      each.tabIndex = chosen ? 0 : -1;
    });
    onChoose(key);
  }

  list.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const at = buttons.indexOf(document.activeElement);
    if (!step || at < 0) return;
    event.preventDefault();
    let next = at;
    do next = (next + step + keys.length) % keys.length;
    while (buttons[next].disabled);
    choose(keys[next]);
    buttons[next].focus();
  });
  return { list, buttons, choose };
}

// What a tab of makeTabs leads to.
export function tabPanel(key, prefix, attributes, ...children) {
  const wired = { role: "tabpanel", id: `${prefix}-panel-${key}`, "aria-labelledby": `${prefix}-${key}` };
  return el("div", { ...attributes, ...wired }, children);
}
