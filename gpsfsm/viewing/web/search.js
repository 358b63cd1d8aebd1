// The search over elements: labels, names, parameters, paths, line numbers and rules.

import { clipText, debounce, el, replaceContent, visibleText } from "./dom.js";
import { elementSign, lineWords } from "./words.js";

const SHOWN = 60;
const MOST_HITS = 2000;

// searchPlan(plan, index, text) -> elements whose words hold every word of the text: first those that
// show them beside each other, last those where only the path holds them.
// "12" or "line 12" finds what stands on line 12, "GP302" what a rule found something in.
export function searchPlan(plan, index, text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  if (!words.length) return [];
  const line = /^(?:line\s*)?:?(\d+)$/i.exec(text.trim());
  /** @type {number[][]} */
  const ranks = [[], [], []];
  for (let number = 0; number < plan.elements.length; number += 1) {
    const seen = searchedWords(plan, index, number);
    const all = `${seen} ${plan.elements[number].path.toLowerCase()}`;
    if (!words.every((word) => all.includes(word))) continue;
    const isTogether = seen.replaceAll("_", " ").includes(words.join(" "));
    ranks[isTogether ? 0 : words.every((word) => seen.includes(word)) ? 1 : 2].push(number);
  }
  const there = line ? [index.elementAt(Number(line[1]))].filter((element) => element >= 0) : [];
  return [...new Set([...there, ...ranks.flat()])].slice(0, MOST_HITS);
}

function searchedWords(plan, index, number) {
  const element = plan.elements[number];
  const rules = index
    .findingsOf(number)
    .map((finding) => plan.findings[finding].rule)
    .join(" ");
  const { kind, type, label, name, detail } = element;
  return `${kind} ${type} ${label} ${name} ${detail} ${rules}`.toLowerCase();
}

let searchesMade = 0;

// mountSearch(container, store) -> {focus, destroy}
export function mountSearch(container, store) {
  searchesMade += 1;
  const id = `search${searchesMade}`;
  const input = el("input", {
    type: "search", placeholder: "Search  /", "aria-label": "Search elements, parameters, lines, rules",
    role: "combobox", "aria-expanded": "false", "aria-controls": id, autocomplete: "off", spellcheck: "false",
  });
  const list = el("ul", { class: "search-hits", role: "listbox", id, hidden: true, "aria-label": "Found" });
  const box = el("div", { class: "search" }, input, list);
  container.append(box);
  let at = 0;

  function look() {
    const hits = searchPlan(store.plan, store.index, input.value);
    at = 0;
    store.set({ search: input.value, hits });
    draw();
  }

  function draw() {
    const { hits } = store.state;
    const open = input.value.trim() !== "" && document.activeElement === input;
    list.hidden = !open;
    input.setAttribute("aria-expanded", String(open));
    if (!open) return;
    const rows = hits.slice(0, SHOWN).map(option);
    if (hits.length > SHOWN) rows.push(el("li", { role: "presentation" }, `… ${hits.length - SHOWN} more`));
    if (!hits.length) rows.push(el("li", { role: "presentation" }, "Nothing found"));
    replaceContent(list, ...rows);
    input.setAttribute("aria-activedescendant", hits.length ? `${id}-${at}` : "");
    list.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest" });
  }

  function option(element, place) {
    const shown = store.plan.elements[element];
    const text = [shown.type || shown.label, shown.name && `“${shown.name}”`, shown.detail];
    return el(
      "li",
      {
        role: "option", id: `${id}-${place}`, "aria-selected": String(place === at),
        onmousedown: (event) => {
          event.preventDefault();
          choose(place);
        },
      },
      el("span", { class: "sign" }, elementSign(shown)),
      el("span", { class: "hit-text" }, clipText(visibleText(text.filter(Boolean).join(" ")), 120)),
      el("span", { class: "hit-line" }, lineWords(store.plan, shown)),
    );
  }

  function choose(place) {
    at = place;
    const element = store.state.hits[place];
    if (element !== undefined) store.selectElement(element, "search");
    draw();
  }

  function onKey(event) {
    const last = Math.min(store.state.hits.length, SHOWN) - 1;
    if (event.key === "ArrowDown") choose(Math.min(last, at + 1));
    else if (event.key === "ArrowUp") choose(Math.max(0, at - 1));
    else if (event.key === "Enter") {
      if (store.state.search !== input.value) look();
      choose(at);
    } else if (event.key === "Escape") {
      input.value = "";
      look();
      input.blur();
    } else return;
    event.preventDefault();
  }

  input.addEventListener("input", debounce(look, 80));
  input.addEventListener("keydown", onKey);
  input.addEventListener("focus", draw);
  input.addEventListener("blur", draw);
  const stop = store.subscribe(["plan"], () => {
    input.value = "";
    draw();
  });
  return {
    focus() {
      input.focus();
      input.select();
    },
    destroy() {
      stop();
      box.remove();
    },
  };
}
