// The plan as a tree: one row per element. Only rows in view exist, so 10,000 are no problem.

import { el } from "./dom.js";
import { virtualRows } from "./rows.js";
import { SEVERITIES, STATES, elementSign, worstSeverity } from "./words.js";

const ROW_HEIGHT = 26;
const DEEPEST_INDENT = 24;

let treesMade = 0;

export function mountTree(container, store) {
  treesMade += 1;
  const prefix = `tree${treesMade}`;
  const box = el("div", { class: "tree", role: "tree", tabindex: "0", "aria-label": "Plan" });
  container.append(box);
  let shown = []; // elements of the rows
  let depths = [];
  let rowOf = new Map();
  const list = virtualRows(box, {
    rowHeight: ROW_HEIGHT,
    row,
    classes: (number) => rowClasses(shown[number]),
    update: showState,
  });

  function arrange() {
    const { elements } = store.plan;
    const { closed } = store.state;
    shown = [];
    depths = [];
    rowOf = new Map();
    const depthOf = [];
    let hiddenBelow = -1; // elements deeper than this one are not shown
    elements.forEach((element, number) => {
      depthOf[number] = element.parent < 0 ? 0 : depthOf[element.parent] + 1;
      if (hiddenBelow >= 0 && depthOf[number] > depthOf[hiddenBelow]) return;
      hiddenBelow = closed.has(number) ? number : -1;
      rowOf.set(number, shown.length);
      shown.push(number);
      depths.push(depthOf[number]);
    });
    box.classList.toggle("empty", shown.length === 0);
    list.setCount(shown.length);
  }

  function row(number) {
    const index = shown[number];
    const element = store.plan.elements[index];
    const inner = store.index.childrenOf(index).length > 0;
    const isOpen = inner && !store.state.closed.has(index);
    const made = el(
      "div",
      {
        role: "treeitem",
        id: `${prefix}-${index}`,
        "aria-level": depths[number] + 1,
        "aria-expanded": inner ? String(isOpen) : null,
        dataset: { element: index },
        title: rowTitle(element),
      },
      el("span", { class: "twisty", "aria-hidden": "true" }, inner ? (isOpen ? "▾" : "▸") : ""),
      el("span", { class: `sign sign-${element.kind}`, "aria-hidden": "true" }, elementSign(element)),
      el("span", { class: "row-text" }, ...rowText(element)),
      element.kind === "runner" ? el("span", { class: "row-line" }, useOf(element)) : null,
      badge(index),
      el("span", { class: "state" }),
      el("span", { class: "row-line" }, String(element.line)),
    );
    made.style.paddingLeft = `${6 + 16 * Math.min(depths[number], DEEPEST_INDENT)}px`;
    return made;
  }

  function rowClasses(index) {
    const { state, plan } = store;
    let classes = "row";
    if (index === state.element) classes += " selected";
    if (index === state.hovered) classes += " hovered";
    if (state.hits.includes(index)) classes += " hit";
    return plan.elements[index].reachable ? classes : `${classes} unreachable`;
  }

  function badge(index) {
    const numbers = store.index.findingsOf(index);
    const worst = worstSeverity(numbers.map((number) => store.plan.findings[number]));
    if (!worst) return null;
    const rules = [...new Set(numbers.map((number) => store.plan.findings[number].rule))];
    return el(
      "span",
      { class: `badge ${worst}`, title: rules.join(", ") },
      SEVERITIES[worst].letter,
    );
  }

  function showState(made, number) {
    const index = shown[number];
    made.setAttribute("aria-selected", String(index === store.state.element));
    const name = store.state.play || store.state.states.size ? stateOf(index) : "idle";
    if (made.dataset.state === name) return;
    made.dataset.state = name;
    const mark = made.querySelector(".state");
    mark.className = `state state-${name}`;
    mark.textContent = STATES[name] ? STATES[name].sign : "";
    mark.title = name === "idle" ? "" : STATES[name].word;
  }

  function stateOf(index) {
    for (const node of store.index.nodesOf(index)) {
      const status = store.state.states.get(node);
      const isRunner = store.plan.automaton.nodes[node].kind === "runner";
      // Of a join only that it waits, be it for ever, says something about its control: others
      // fire, or never do, for the better or the worse.
      if (status && (isRunner || status.state === "waiting" || status.state === "stuck")) return status.state;
    }
    return "idle";
  }

  function select(row_) {
    const number = Math.max(0, Math.min(shown.length - 1, row_));
    if (shown.length) store.selectElement(shown[number], "tree");
    list.show(number);
  }

  function toggle(index, open) {
    if (!store.index.childrenOf(index).length) return;
    const closed = new Set(store.state.closed);
    if (open) closed.delete(index);
    else closed.add(index);
    store.set({ closed });
  }

  function onKey(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const at = rowOf.get(store.state.element) ?? -1;
    const index = shown[at];
    const page = list.pageSize();
    const isClosed = store.state.closed.has(index);
    const inner = at >= 0 && store.index.childrenOf(index).length > 0;
    const actions = {
      ArrowDown: () => select(at + 1),
      ArrowUp: () => select(at - 1),
      PageDown: () => select(at + page),
      PageUp: () => select(at - page),
      Home: () => select(0),
      End: () => select(shown.length - 1),
      Enter: () => inner && toggle(index, isClosed),
      ArrowRight: () => (inner && isClosed ? toggle(index, true) : inner && select(at + 1)),
      ArrowLeft: () =>
        inner && !isClosed
          ? toggle(index, false)
          : at >= 0 && select(rowOf.get(store.plan.elements[index].parent) ?? 0),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  function onClick(event) {
    const row = event.target.closest("[data-element]");
    if (!row) return;
    const index = Number(row.dataset.element);
    if (event.target.classList.contains("twisty")) toggle(index, store.state.closed.has(index));
    else store.selectElement(index, "tree");
  }

  function onMove(event) {
    const row = event.target.closest("[data-element]");
    store.hoverElement(row ? Number(row.dataset.element) : -1);
  }

  // Opens what hides the selected element and scrolls to it.
  function follow() {
    const { element, from } = store.state;
    box.setAttribute("aria-activedescendant", element >= 0 ? `${prefix}-${element}` : "");
    if (element >= 0 && !rowOf.has(element)) {
      const closed = new Set(store.state.closed);
      let at = store.plan.elements[element].parent;
      for (; at >= 0; at = store.plan.elements[at].parent) closed.delete(at);
      store.set({ closed });
    }
    if (element >= 0 && from !== "tree") list.show(rowOf.get(element) ?? 0);
    list.restyle();
  }

  box.addEventListener("keydown", onKey);
  box.addEventListener("click", onClick);
  box.addEventListener("dblclick", (event) => {
    const row = event.target.closest("[data-element]");
    if (row) toggle(Number(row.dataset.element), store.state.closed.has(Number(row.dataset.element)));
  });
  box.addEventListener("mousemove", onMove);
  box.addEventListener("mouseleave", () => store.hoverElement(-1));
  const stops = [
    store.subscribe(["plan", "closed"], arrange),
    store.subscribe(["element"], follow),
    store.subscribe(["hovered", "hits", "states", "play"], list.restyle),
  ];
  arrange();
  return {
    element: box,
    focus: () => box.focus(),
    destroy() {
      stops.forEach((stop) => stop());
      list.destroy();
      box.remove();
    },
  };
}

function rowText(element) {
  const word = element.kind === "control" ? element.type || element.label : element.label;
  return [
    el("span", { class: "row-label" }, word),
    element.name ? el("span", { class: "row-name" }, `“${element.name}”`) : null,
    element.detail ? el("span", { class: "row-detail" }, element.detail) : null,
  ];
}

// Which use of a leaf of a behaviour tree it is: "@2".
const useOf = ({ path }) => /@\d+$/.exec(path)?.[0] || "";

function rowTitle(element) {
  const words = [element.path];
  if (element.detail) words.push(element.detail);
  if (!element.reachable) words.push("never triggered");
  return words.join("\n");
}
