// Several plans as a table: verdicts, counts and how they end. Choosing a row opens its plan.

import { counted, el, replaceContent, visibleText } from "./dom.js";
import { gradeBadge } from "./findings.js";
import { frequency } from "./words.js";

const VERDICTS = {
  accepted: { sign: "✓", word: "accepted", kind: "good", rank: 2 },
  rejected: { sign: "✗", word: "rejected", kind: "bad", rank: 0 },
  undecided: { sign: "!", word: "undecided", kind: "neutral", rank: 1 },
};
const OFTEN_RANK = { always: 4, "sometimes or always": 3, sometimes: 3, may: 2, unknown: 1, never: 0 };
const MOST_ROWS = 2000;

export function verdictBadge(verdict) {
  const { sign, word, kind } = VERDICTS[verdict] || VERDICTS.undecided;
  return el("span", { class: `verdict verdict-${kind}`, title: word }, `${sign} ${word}`);
}

// What the table needs of a plan: {number, name, verdict, error, warning, info, runners, …}
function summaryRow(plan, number) {
  const shown = plan.findings.filter((finding) => !finding.suppressed);
  const count = (severity) => shown.filter((finding) => finding.severity === severity).length;
  const facts = plan.facts || {};
  const engine = facts.engine || {};
  return {
    number,
    name: plan.name,
    verdict: plan.verdict,
    grade: plan.task ? plan.task.grade : "",
    error: count("error"),
    warning: count("warning"),
    info: count("info"),
    runners: facts.runners ?? runnersSeen(plan),
    completes: frequency(facts, "completes"),
    gives_up: frequency(facts, "gives_up"),
    stuck: engine.hangs || frequency(facts, "stuck"),
    aborts: engine.aborts || "",
  };
}

function runnersSeen(plan) {
  return plan.elements.filter((element) => element.kind === "runner").length;
}

function summaryColumns(rows) {
  const count = (key, title) => ({ key, title, of: (row) => row[key], number: true });
  const often = (key, title) => ({ key, title, of: (row) => OFTEN_RANK[row[key]] ?? -1, often: true });
  return [
    { key: "name", title: "Plan", of: (row) => row.name.toLowerCase() },
    { key: "verdict", title: "Verdict", of: (row) => (VERDICTS[row.verdict] || VERDICTS.undecided).rank },
    rows.some((row) => row.grade) && { key: "grade", title: "Task", of: (row) => row.grade },
    count("error", "Errors"),
    count("warning", "Warnings"),
    count("info", "Info"),
    count("runners", "Runners"),
    often("completes", "Completes"),
    often("gives_up", "Gives up"),
    often("stuck", "Stuck"),
    rows.some((row) => row.aborts) && often("aborts", "Kills the engine"),
  ].filter(Boolean);
}

// Sorts by one column; rows that are equal in it stay in their order.
function sortRows(rows, of, falling) {
  const compared = (one, other) => (one < other ? -1 : one > other ? 1 : 0);
  const sorted = [...rows].sort(
    (one, other) => compared(of(one), of(other)) * (falling ? -1 : 1) || one.number - other.number,
  );
  return sorted;
}

// mountSummary(container, viewDocument, {onOpen, current}) -> {element, focus, redraw, destroy}
//   onOpen(number): a plan is chosen;  current(): the number of the one that is shown, or -1
export function mountSummary(container, viewDocument, { onOpen, current = () => -1 }) {
  const rows = viewDocument.plans.map(summaryRow);
  const columns = summaryColumns(rows);
  /** @type {columns[number] | null} */
  const sort = null;
  const folder = commonFolder(rows.map((row) => row.name));
  const view = { rows, columns, sort, folder, falling: false, text: "", onOpen, current };
  const body = el("tbody");
  const note = el("p", { class: "summary-note", "aria-live": "polite" });
  const filter = el("input", {
    type: "search",
    class: "summary-filter",
    placeholder: "Filter by name or verdict",
    "aria-label": "Filter plans",
    oninput: () => {
      view.text = filter.value.trim().toLowerCase();
      draw();
    },
  });
  const heads = view.columns.map((column) => columnHead(column, view, () => draw()));
  const table = el(
    "table",
    { class: "summary-table" },
    el("caption", { class: "unseen" }, "Plans of this report"),
    el("thead", {}, el("tr", {}, heads)),
    body,
  );
  const box = el(
    "section",
    { class: "summary", "aria-label": "Summary" },
    el("div", { class: "summary-head" }, totals(rows, folder), filter),
    el("div", { class: "summary-scroll" }, table),
    note,
  );
  container.append(box);

  function draw() {
    const hits = matching(view);
    const sorted = view.sort ? sortRows(hits, view.sort.of, view.falling) : hits;
    replaceContent(body, sorted.slice(0, MOST_ROWS).map((row) => tableRow(row, view)));
    heads.forEach((head, place) => markSorted(head, view.columns[place] === view.sort, view.falling));
    const left = sorted.length - MOST_ROWS;
    const more = left > 0 ? `; ${left} more are not shown: filter them` : "";
    note.textContent = view.text || left > 0 ? counted(hits.length, "plan") + more : "";
  }

  draw();
  return { element: box, focus: () => filter.focus(), redraw: draw, destroy: () => box.remove() };
}

function matching({ rows, text }) {
  if (!text) return rows;
  const words = (row) => `${row.name} ${(VERDICTS[row.verdict] || {}).word} ${row.grade}`;
  return rows.filter((row) => words(row).toLowerCase().includes(text));
}

// The folder of all of them, with its last slash, or "".
export function commonFolder(names) {
  const [first, ...others] = names;
  const isShared = (folder) => others.every((name) => name.startsWith(folder));
  let folder = first.slice(0, first.lastIndexOf("/") + 1);
  while (folder && !isShared(folder)) folder = folder.slice(0, folder.slice(0, -1).lastIndexOf("/") + 1);
  return folder;
}

function totals(rows, folder) {
  const of = (verdict) => rows.filter((row) => row.verdict === verdict).length;
  const parts = Object.entries(VERDICTS)
    .filter(([verdict]) => of(verdict))
    .map(([verdict, { sign, word, kind }]) =>
      el("span", { class: `verdict verdict-${kind}` }, `${sign} ${of(verdict)} ${word}`),
    );
  return el("p", { class: "summary-totals" }, el("strong", {}, counted(rows.length, "plan")), folder && `in ${visibleText(folder)}`, parts);
}

function columnHead(column, view, draw) {
  const sort = () => {
    // Counts are wanted in falling order first, names in rising order.
    view.falling = view.sort === column ? !view.falling : Boolean(column.number || column.often);
    view.sort = column;
    draw();
  };
  return el(
    "th",
    { scope: "col", class: column.number && "number" },
    el("button", { type: "button", class: "sorter", onclick: sort }, column.title, el("span", { class: "arrow", "aria-hidden": "true" })),
  );
}

function markSorted(head, isSorted, falling) {
  if (isSorted) head.setAttribute("aria-sort", falling ? "descending" : "ascending");
  else head.removeAttribute("aria-sort");
  head.querySelector(".arrow").textContent = isSorted ? (falling ? " ▾" : " ▴") : "";
}

function tableRow(row, view) {
  const open = el(
    "button",
    { type: "button", class: "plan-link", title: visibleText(row.name), onclick: () => view.onOpen(row.number) },
    visibleText(row.name.slice(view.folder.length)),
  );
  const cells = {
    name: open,
    verdict: verdictBadge(row.verdict),
    grade: row.grade ? gradeBadge(row.grade) : "",
  };
  const isCurrent = row.number === view.current();
  return el(
    "tr",
    {
      class: isCurrent && "current",
      "aria-current": isCurrent && "true",
      dataset: { plan: row.number },
      onclick: (event) => event.target === open || view.onOpen(row.number),
    },
    view.columns.map((column) =>
      el("td", { class: cellClass(column, row) }, cells[column.key] ?? cellText(column, row)),
    ),
  );
}

function cellText(column, row) {
  const value = row[column.key];
  return column.often ? value || "–" : value.toLocaleString("en");
}

function cellClass(column, row) {
  const isCount = ["error", "warning", "info"].includes(column.key);
  return [
    column.number && "number",
    column.often && `fact-${row[column.key] || "unknown"}`,
    isCount && row[column.key] > 0 && `count-${column.key}`,
  ];
}
