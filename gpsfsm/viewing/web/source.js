// The text of the plan with line numbers and the colours of XML or JSON. Only lines in view exist.

import { el, visibleText } from "./dom.js";
import { isJson, jsonFolds, jsonParts } from "./json.js";
import { virtualRows } from "./rows.js";
import { SEVERITIES, worstSeverity } from "./words.js";

const LINE_HEIGHT = 20;
const LONGEST_LINE = 2000;
const LONGEST_UNFOLDED = 48; // characters, without the indentation

export function mountSource(container, store) {
  const box = el("div", {
    class: "source", tabindex: "0", role: "region", "aria-label": "Text of the plan",
  });
  container.append(box);
  let lines = [];
  let inComment = [];
  let json = false;
  let marks = new Map(); // line -> [{start, end, severity}] of the findings
  const list = virtualRows(box, {
    rowHeight: LINE_HEIGHT,
    row,
    classes: (number) => lineClasses(number + 1),
  });

  function arrange() {
    const { source } = store.plan;
    lines = source === null || source === undefined ? [] : source.split("\n");
    json = isJson(source || "");
    inComment = json ? [] : commentStarts(lines);
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
    list.setCount(lines.length);
  }

  function row(number) {
    const line = number + 1;
    const text = lines[number].replace(/\r$/, "");
    const points = Array.from(text.slice(0, 2 * LONGEST_LINE));
    const shown = points.slice(0, LONGEST_LINE);
    const more = text.length - shown.join("").length;
    return el(
      "div",
      { dataset: { line } },
      gutter(line),
      el(
        "code",
        { class: "line-text" },
        pieces(shown, line, inComment[number]),
        more > 0 ? el("span", { class: "line-more" }, ` … ${more} more characters`) : null,
      ),
    );
  }

  function gutter(line) {
    const findings = store.index.findingsAt(line).map((number) => store.plan.findings[number]);
    const worst = worstSeverity(findings);
    return el(
      "span",
      { class: "line-number", title: findings.map((one) => `${one.rule} ${one.message}`).join("\n") || null },
      worst ? el("span", { class: `badge ${worst}` }, SEVERITIES[worst].letter) : null,
      String(line),
    );
  }

  function pieces(points, line, startsInComment) {
    const tokens = json ? colorJson(points) : colorLine(points, startsInComment);
    const folds = json ? foldedJson(points) : foldedParts(tokens, points);
    const own = marks.get(line) || [];
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
        const attributes = { class: classes, dataset: { column: start + 1 } };
        spans.push(el("span", attributes, visibleText(points.slice(start, end).join(""))));
      }
    }
    return spans;
  }

  function lineClasses(line) {
    const { state, plan } = store;
    const within = (index) =>
      index > 0 && plan.elements[index] && line >= plan.elements[index].line && line <= plan.elements[index].endLine;
    let classes = "line";
    if (within(state.element)) classes += " selected";
    if (line === state.line) classes += " current";
    if (within(state.hovered)) classes += " hovered";
    return isRelated(line) ? `${classes} is-related` : classes;
  }

  function isRelated(line) {
    const finding = store.plan.findings[store.state.finding];
    return Boolean(finding) && finding.related.some((place) => place.line === line);
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
    if (place && getSelection()?.isCollapsed) store.selectLine(place.line, "source", place.column);
  }

  function onMove(event) {
    const place = placeOf(event);
    store.hoverElement(place ? store.index.elementAt(place.line, place.column) : -1);
  }

  function follow() {
    const { line, from } = store.state;
    if (line > 0 && from !== "source") list.show(Math.min(lines.length, line) - 1);
    list.restyle();
  }

  function onKey(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step || event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const line = Math.max(1, Math.min(lines.length, store.state.line + step));
    store.selectLine(line, "source");
    list.show(line - 1);
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
