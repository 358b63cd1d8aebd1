// The text of the plan with line numbers and the colours of XML or JSON. Only lines in view exist.

import { el, visibleText } from "./dom.js";
import { isJson, jsonFolds, jsonParts } from "./json.js";
import { virtualRows } from "./rows.js";
import { SEVERITIES, worstSeverity } from "./words.js";

const LINE_HEIGHT = 20;
const LONGEST_LINE = 2000;
const LONGEST_UNFOLDED = 48; // characters, without the indentation
const LONGEST_UNCUT = 300;
const DEEPEST = 12;

/**
 * @typedef {{line: number, start: number, text: string, depth: number, isCut: boolean, inComment: boolean}} Row
 *   a line, or a part of a long one: `start` is the number of code points before it, `depth` the
 *   number of elements of this line around it
 */

export function mountSource(container, store) {
  const box = el("div", {
    class: "source", tabindex: "0", role: "region", "aria-label": "Text of the plan",
  });
  container.append(box);
  /** @type {Row[]} */
  let rows = [];
  let rowOfLine = []; // the first row of each line
  let chosen = -1; // the row of the place that is chosen, -1: none
  let json = false;
  let marks = new Map(); // line -> [{start, end, severity}] of the findings
  const list = virtualRows(box, {
    rowHeight: LINE_HEIGHT,
    row,
    classes: rowClasses,
  });

  function arrange() {
    const { source } = store.plan;
    const lines = source === null || source === undefined ? [] : source.split("\n");
    json = isJson(source || "");
    marks = new Map();
    store.plan.findings.forEach((finding) => {
      if (finding.suppressed || !finding.line) return;
      const start = finding.column - 1;
      const mark = { start, end: start + Math.max(1, finding.length), severity: finding.severity };
      marks.set(finding.line, [...(marks.get(finding.line) || []), mark]);
    });
    // What stands behind the last end of a line is a line only if something is reported there.
    if (lines.length > 1 && !lines[lines.length - 1] && !marks.has(lines.length)) lines.pop();
    box.classList.toggle("empty", lines.length === 0);
    box.dataset.empty = "The text is not shown.";
    const digits = String(lines.length).length;
    box.style.setProperty("--digits", `${Math.max(3, digits)}ch`);
    rows = rowsOfLines(lines, json);
    rowOfLine = [];
    rows.forEach(({ line, start }, number) => start || (rowOfLine[line] = number));
    chosen = chosenRow();
    list.setCount(rows.length);
  }

  // The row of a place; without a column, the first of the line.
  function rowAt(line, column = 1) {
    let number = rowOfLine[Math.min(line, rows.length ? rows[rows.length - 1].line : 0)] ?? -1;
    while (rows[number + 1]?.line === line && rows[number + 1].start < column) number += 1;
    return number;
  }

  function chosenRow() {
    const { state, plan } = store;
    if (state.line <= 0) return -1;
    const places = [plan.elements[state.element], plan.findings[state.finding]];
    return rowAt(state.line, places.find((place) => place?.line === state.line)?.column);
  }

  function row(number) {
    const { line, start, depth } = rows[number];
    const text = rows[number].text.replace(/\r$/, "");
    const points = Array.from(text.slice(0, 2 * LONGEST_LINE));
    const shown = points.slice(0, LONGEST_LINE);
    const more = text.length - shown.join("").length;
    const code = el(
      "code",
      { class: "line-text" },
      pieces(shown, rows[number]),
      more > 0 ? el("span", { class: "line-more" }, ` … ${more} more characters`) : null,
    );
    if (depth) code.style.marginLeft = `${2 * depth}ch`;
    return el("div", { dataset: { line, column: start + 1 } }, gutter(number), code);
  }

  function gutter(number) {
    const { line, start } = rows[number];
    const all = store.index.findingsAt(line).map((index) => store.plan.findings[index]);
    const own = all.filter((finding) => isInRow(finding, number));
    const worst = worstSeverity(own);
    return el(
      "span",
      { class: "line-number", title: own.map((one) => `${one.rule} ${one.message}`).join("\n") || null },
      worst ? el("span", { class: `badge ${worst}` }, SEVERITIES[worst].letter) : null,
      start ? "" : String(line),
    );
  }

  function isInRow(place, number) {
    const { line, start, isCut } = rows[number];
    if (place.line !== line || !isCut) return place.line === line;
    const next = rows[number + 1];
    return place.column > start && (next?.line !== line || place.column <= next.start);
  }

  function pieces(points, { line, start: before, inComment }) {
    const tokens = json ? colorJson(points) : colorLine(points, inComment);
    const folds = json ? foldedJson(points) : foldedParts(tokens, points);
    const own = (marks.get(line) || [])
      .filter(({ start, end }) => end > before && start < before + points.length)
      .map((mark) => ({ ...mark, start: mark.start - before, end: mark.end - before }));
    const spans = [];
    for (const token of tokens) {
      const cuts = [...own, ...folds];
      for (const [start, end, severity] of cutByMarks(token, cuts)) {
        const within = folds.find((one) => one.start <= start && end <= one.end);
        // Of a mark that begins before what is left out, the beginning is seen.
        const isMarked = severity && !(json && own.every((mark) => mark.start < within?.start || mark.start >= within?.end));
        const fold = isMarked ? null : within;
        const folded = fold && (fold.sign && fold.start === start ? "folded first" : "folded");
        const indent = start === 0 && !points.slice(0, end).join("").trim() && "indent";
        const classes = [token.kind && `xml-${token.kind}`, severity && `mark ${severity}`, folded, indent];
        const attributes = { class: classes, dataset: { column: before + start + 1 } };
        spans.push(el("span", attributes, visibleText(points.slice(start, end).join(""))));
      }
    }
    return spans;
  }

  function rowClasses(number) {
    const { state, index } = store;
    const { line, start, isCut } = rows[number];
    const within = (element) => {
      const range = store.plan.elements[element];
      if (element <= 0 || !range || line < range.line || line > range.endLine) return false;
      return !isCut || index.isInside(index.elementAt(line, start + 1), element);
    };
    return [
      "line",
      within(state.element) && "selected",
      line === state.line && (!isCut || number === chosen) && "current",
      within(state.hovered) && "hovered",
      isRelated(number) && "is-related",
    ].filter(Boolean).join(" ");
  }

  function isRelated(number) {
    const finding = store.plan.findings[store.state.finding];
    return Boolean(finding) && finding.related.some((place) => isInRow(place, number));
  }

  function placeOf(event) {
    const row = event.target.closest("[data-line]");
    if (!row) return null;
    const piece = event.target.closest("[data-column]");
    const column = piece ? Number(piece.dataset.column) : Infinity;
    return { line: Number(row.dataset.line), column };
  }

  function onClick(event) {
    const place = placeOf(event);
    if (!place || !getSelection()?.isCollapsed) return;
    chosen = rowAt(place.line, place.column);
    store.selectLine(place.line, "source", place.column);
  }

  function onMove(event) {
    const place = placeOf(event);
    store.hoverElement(place ? store.index.elementAt(place.line, place.column) : -1);
  }

  function follow() {
    const { line, from } = store.state;
    if (from !== "source") chosen = chosenRow();
    if (line > 0 && from !== "source") list.show(chosen);
    list.restyle();
  }

  function onKey(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step || event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    chosen = Math.max(0, Math.min(rows.length - 1, chosen + step));
    const { line, start, isCut } = rows[chosen];
    store.selectLine(line, "source", isCut ? start + 1 : undefined);
    list.show(chosen);
  }

  box.addEventListener("click", onClick);
  box.addEventListener("mousemove", onMove);
  box.addEventListener("mouseleave", () => store.hoverElement(-1));
  box.addEventListener("keydown", onKey);
  const stops = [
    store.subscribe(["plan"], arrange),
    store.subscribe(["line", "element", "finding"], follow),
    store.subscribe(["hovered"], list.restyle),
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

// Where the text of a long line says nothing that tells one runner from another: the package of an
// interface, and a provider that is the interface again. With them left out,
//   <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner" x="1"
// is shown as
//   <Runner …WaypointRunner x="1"
export function foldedParts(tokens, points) {
  if (points.join("").trim().length <= LONGEST_UNFOLDED) return [];
  const textOf = ({ start, end }) => points.slice(start, end).join("");
  const places = {};
  tokens.forEach((token, number) => {
    const value = tokens.slice(number + 1, number + 3).find((one) => one.kind === "value");
    if (token.kind === "name" && value) places[textOf(token)] ??= { start: token.start, value };
  });
  const { interface: one, provider } = places;
  const slash = one ? textOf(one.value).lastIndexOf("/") : -1;
  if (slash < 2 || textOf(one.value).length < slash + 3) return [];
  const folds = [
    { start: one.start, end: one.value.start + slash + 1, sign: true },
    { start: one.value.end - 1, end: one.value.end },
  ];
  if (provider && textOf(one.value) === textOf(provider.value)) {
    folds.push({ start: provider.start - 1, end: provider.value.end });
  }
  return folds.map((fold) => ({ sign: false, ...fold, severity: "" }));
}

function foldedJson(points) {
  const text = points.join("");
  if (text.trim().length <= LONGEST_UNFOLDED) return [];
  const parts = jsonFolds(text).map(([start, end, sign]) => [start, end, Boolean(sign)]);
  return inPoints(parts, points, text).map(({ start, end, kind }) => ({ start, end, sign: kind, severity: "" }));
}

function colorJson(points) {
  const text = points.join("");
  return inPoints(jsonParts(text, 0, text.length), points, text);
}

// The parts of a token that lie in marks of findings and outside of them.
function cutByMarks(token, marks) {
  const cuts = new Set([token.start, token.end]);
  for (const mark of marks) {
    for (const at of [mark.start, mark.end]) if (at > token.start && at < token.end) cuts.add(at);
  }
  const sorted = [...cuts].sort((one, other) => one - other);
  return sorted.slice(0, -1).map((start, place) => {
    const end = sorted[place + 1];
    const covering = marks.filter((mark) => mark.start < end && mark.end > start);
    return [start, end, worstSeverity(covering)];
  });
}

// -- colours for lines of XML. It reads line by line and needs no correct XML: what it does not
// understand keeps the colour of text.

// Written in two parts: in a page that holds this script it must not look like markup.
const COMMENT = "<" + "!--";
const TOKENS = /(<[/?!]?)([^\s<>/="']*)|("[^"]*"?|'[^']*'?)|([^\s<>="'/]+)(?=\s*=)|([/?]?>)/gu;

// One row for a line; of a long one, one for each of its tags:
//   <Plan><Control type="sequential"><Runner interface="a/B"/></Control></Plan>
// has five, of which <Runner …/> is the deepest.
function rowsOfLines(lines, json) {
  const inComment = json ? [] : commentStarts(lines);
  return lines.flatMap((text, place) => {
    const whole = { line: place + 1, start: 0, text, depth: 0, isCut: false, inComment: Boolean(inComment[place]) };
    return json || text.length <= LONGEST_UNCUT ? [whole] : cutAtTags(whole);
  });
}

function cutAtTags(whole) {
  const points = Array.from(whole.text);
  const tokens = colorLine(points, whole.inComment);
  const cuts = tokens.filter(({ kind, start }) => kind === "bracket" && points[start] === "<" && start > 0);
  if (!cuts.length) return [whole];
  let depth = 0;
  return [0, ...cuts.map(({ start }) => start)].map((start, number) => {
    const text = points.slice(start, cuts[number]?.start).join("");
    if (text.startsWith("</")) depth = Math.max(0, depth - 1);
    const row = { ...whole, start, text, depth: Math.min(depth, DEEPEST), isCut: true, inComment: whole.inComment && !start };
    if (/^<[^/?!]/.test(text) && !/\/>\s*$/.test(text)) depth += 1;
    return row;
  });
}

// Per line whether it begins inside a comment.
export function commentStarts(lines) {
  let open = false;
  return lines.map((line) => {
    const atStart = open;
    let at = 0;
    while (at >= 0) {
      const next = line.indexOf(open ? "-->" : COMMENT, at);
      if (next < 0) break;
      at = next + (open ? 3 : 4);
      open = !open;
    }
    return atStart;
  });
}

// colorLine(points, inComment) -> [{start, end, kind}], which cover the whole line; positions count
// code points. Kinds: comment, bracket, tag, name, value, "".
export function colorLine(points, inComment) {
  if (!points.length) return [];
  const text = points.join("");
  const parts = [];
  let at = 0;
  let open = inComment;
  while (at < text.length) {
    if (open) {
      const end = text.indexOf("-->", at);
      const stop = end < 0 ? text.length : end + 3;
      parts.push([at, stop, "comment"]);
      at = stop;
      open = false;
      continue;
    }
    const begin = text.indexOf(COMMENT, at);
    const stop = begin < 0 ? text.length : begin;
    if (stop > at) parts.push(...markupParts(text, at, stop));
    at = stop;
    open = begin >= 0;
  }
  return inPoints(parts, points, text);
}

function markupParts(text, from, to) {
  const parts = [];
  let at = from;
  TOKENS.lastIndex = from;
  const add = (start, end, kind) => end > start && parts.push([start, end, kind]);
  for (let match = TOKENS.exec(text); match && match.index < to; match = TOKENS.exec(text)) {
    const end = Math.min(to, match.index + match[0].length);
    add(at, match.index, "");
    if (match[1]) {
      add(match.index, match.index + match[1].length, "bracket");
      add(match.index + match[1].length, end, "tag");
    } else {
      add(match.index, end, match[3] ? "value" : match[4] ? "name" : "bracket");
    }
    at = end;
    if (end === match.index) TOKENS.lastIndex += 1;
  }
  add(at, to, "");
  return parts;
}

// From positions in UTF-16 units to code points.
function inPoints(parts, points, text) {
  if (points.length === text.length) return parts.map(([start, end, kind]) => ({ start, end, kind }));
  const pointAt = [];
  let unit = 0;
  points.forEach((point, number) => {
    for (let count = 0; count < point.length; count += 1) pointAt[unit + count] = number;
    unit += point.length;
  });
  pointAt[unit] = points.length;
  return parts.map(([start, end, kind]) => ({ start: pointAt[start], end: pointAt[end], kind }));
}
