// How panes share a place: rows of tabs, of which one is chosen, and bars between two panes. The
// arrow keys go to the next tab, and move a bar.

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

// -- bars between panes -------------------------------------------------------------------------

const LEAST = 160;
const KEY_STEP = 24;

// mountSplitter(panes, property, direction): it sets a custom property of `panes`, the width of the
// pane before (direction 1) or after (-1) the bar.
export function mountSplitter(panes, property, direction) {
  const bar = el("div", {
    class: "splitter", role: "separator", tabindex: "0", "aria-orientation": "vertical",
    "aria-label": direction > 0 ? "Width of the left pane" : "Width of the right pane",
    "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": 0,
  });
  const pane = () => (direction > 0 ? bar.previousElementSibling : bar.nextElementSibling);
  // Read aloud is the share of the whole width.
  const tellShare = () => {
    const share = panes.clientWidth ? Math.round((100 * pane().clientWidth) / panes.clientWidth) : 0;
    bar.setAttribute("aria-valuenow", share);
    bar.setAttribute("aria-valuetext", `${share} percent`);
  };
  const resize = (width) => {
    const most = panes.clientWidth - 2 * LEAST - 20;
    panes.style.setProperty(property, `${Math.round(Math.max(LEAST, Math.min(most, width)))}px`);
    tellShare();
  };
  bar.addEventListener("focus", tellShare);
  bar.addEventListener("pointerdown", (event) => {
    const begun = { x: event.clientX, width: pane().clientWidth };
    bar.setPointerCapture(event.pointerId);
    const move = (moved) => resize(begun.width + direction * (moved.clientX - begun.x));
    bar.addEventListener("pointermove", move);
    bar.addEventListener("lostpointercapture", () => bar.removeEventListener("pointermove", move), { once: true });
    event.preventDefault();
  });
  bar.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -KEY_STEP, ArrowRight: KEY_STEP }[event.key];
    if (!step) return;
    event.preventDefault();
    resize(pane().clientWidth + direction * step);
  });
  bar.addEventListener("dblclick", () => {
    panes.style.removeProperty(property);
    tellShare();
  });
  return bar;
}
