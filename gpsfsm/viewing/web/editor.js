// A text field for a plan: line numbers, marks of findings, files that are dropped.
//
// The text stands in a plain textarea, so that typing, undoing and reading aloud work as everywhere.
// Numbers and marks lie beside and behind it and are drawn for the lines that can be seen.

import { el, oncePerFrame, replaceContent } from "./dom.js";

const MOST_BYTES = 1 << 20; // what the service takes as a plan
const TAB = 4;
const SEVERITY_LETTER = { error: "E", warning: "W", info: "I" };
const RANK = { error: 0, warning: 1, info: 2 };

export function lineStarts(text) {
  const starts = [0];
  for (let at = text.indexOf("\n"); at >= 0; at = text.indexOf("\n", at + 1)) {
    starts.push(at + 1);
  }
  return starts;
}

// How many UTF-16 units the first `points` code points of a text take.
function unitsOf(text, points) {
  let at = 0;
  for (let left = points; left > 0 && at < text.length; left -= 1) {
    at += text.codePointAt(at) > 0xffff ? 2 : 1;
  }
  return at;
}

// How many columns a text takes in the field, where a tab goes on to the next multiple of four.
function widthOf(text) {
  let width = 0;
  for (const character of text) {
    width += character === "\t" ? TAB - (width % TAB) : 1;
  }
  return width;
}

// hooks: onInput(), onCaretLine(line), onFile(name), onTrouble(message)
export function createEditor(container, hooks) {
  const numbers = el("pre", { class: "editor-numbers", "aria-hidden": "true" });
  const signs = el("div", { class: "editor-signs", "aria-hidden": "true" });
  const gutter = el("div", { class: "editor-gutter" }, numbers, signs);
  const marksLayer = el("div", { class: "editor-marks", "aria-hidden": "true" });
  const area = el("textarea", {
    class: "editor-text",
    wrap: "off",
    spellcheck: "false",
    autocapitalize: "off",
    autocomplete: "off",
    "aria-label": "Text of the plan",
    placeholder: "Type or paste a plan,\nor drop a file here.",
  });
  const body = el("div", { class: "editor-body" }, gutter, el("div", { class: "editor-sheet" }, marksLayer, area));
  container.append(body);
  /** @type {{line: number, column: number, length: number, severity: string, rule: string, message: string}[]} */
  const marks = [];
  const shared = { starts: [0], marks, line: 0, shown: 0, character: 8, height: 20, top: 0, left: 0 };

  function measure() {
    const style = getComputedStyle(area);
    const pen = document.createElement("canvas").getContext("2d");
    if (!pen) return; // the sizes stay what they are in most fonts
    pen.font = `${style.fontSize} ${style.fontFamily}`;
    shared.character = pen.measureText("0".repeat(100)).width / 100;
    shared.height = parseFloat(style.lineHeight) || 20;
    shared.top = parseFloat(style.paddingTop) || 0;
    shared.left = parseFloat(style.paddingLeft) || 0;
  }

  function lineText(line) {
    const text = area.value;
    const end = line < shared.starts.length ? shared.starts[line] - 1 : text.length;
    return text.slice(shared.starts[line - 1], end);
  }

  function visible() {
    const first = Math.floor(area.scrollTop / shared.height);
    const last = Math.ceil((area.scrollTop + area.clientHeight) / shared.height);
    return [Math.max(1, first), Math.min(shared.starts.length, last + 1)];
  }

  const draw = oncePerFrame(() => {
    const [first, last] = visible();
    const lines = [];
    for (let line = first; line <= last; line += 1) {
      lines.push(line);
    }
    numbers.textContent = lines.join("\n");
    const top = shared.top + (first - 1) * shared.height - area.scrollTop;
    numbers.style.transform = `translateY(${top}px)`;
    drawMarks(first, last);
  });

  function drawMarks(first, last) {
    const worst = new Map();
    const pieces = [];
    const band = (line, kind) => {
      const found = el("div", { class: `editor-band ${kind}` });
      found.style.top = `${shared.top + (line - 1) * shared.height - area.scrollTop}px`;
      pieces.push(found);
    };
    if (shared.shown >= first && shared.shown <= last) band(shared.shown, "chosen");
    for (const mark of shared.marks) {
      if (mark.line < first || mark.line > last) continue;
      const before = worst.get(mark.line);
      if (!before || RANK[mark.severity] < RANK[before.severity]) worst.set(mark.line, mark);
      pieces.push(underline(mark));
    }
    replaceContent(marksLayer, pieces);
    replaceContent(signs, [...worst.values()].map(sign));
  }

  function underline(mark) {
    const text = lineText(mark.line);
    const from = unitsOf(text, mark.column - 1);
    const to = from + unitsOf(text.slice(from), Math.max(1, mark.length || 1));
    const start = widthOf(text.slice(0, from));
    const end = Math.max(start + 1, start + widthOf(text.slice(from, to)));
    const found = el("div", { class: `editor-underline ${mark.severity}` });
    found.style.top = `${shared.top + (mark.line - 1) * shared.height - area.scrollTop}px`;
    found.style.left = `${shared.left + start * shared.character - area.scrollLeft}px`;
    found.style.width = `${(end - start) * shared.character}px`;
    return found;
  }

  function sign(mark) {
    const words = `${mark.rule}: ${mark.message}`;
    const found = el("span", { class: `editor-sign ${mark.severity}`, title: words }, SEVERITY_LETTER[mark.severity]);
    found.style.top = `${shared.top + (mark.line - 1) * shared.height - area.scrollTop}px`;
    return found;
  }

  function caretLine() {
    const at = area.selectionStart;
    let low = 0;
    let high = shared.starts.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (shared.starts[middle] <= at) low = middle;
      else high = middle;
    }
    return low + 1;
  }

  function caretMoved() {
    const line = caretLine();
    if (line !== shared.line) {
      shared.line = line;
      hooks.onCaretLine(line);
    }
  }

  function changed() {
    shared.starts = lineStarts(area.value);
    body.classList.toggle("many-lines", shared.starts.length > 9999);
    draw();
  }

  function scrollTo(line) {
    const top = (line - 1) * shared.height;
    if (top < area.scrollTop || top > area.scrollTop + area.clientHeight - 2 * shared.height) {
      area.scrollTop = Math.max(0, top - area.clientHeight / 3);
    }
  }

  function setText(text) {
    area.value = text;
    area.scrollTop = 0;
    area.scrollLeft = 0;
    area.setSelectionRange(0, 0);
    shared.marks = [];
    shared.shown = 0;
    shared.line = 0;
    changed();
  }

  async function takeFile(file) {
    if (!file) return;
    if (file.size > MOST_BYTES) {
      hooks.onTrouble(`${file.name} is larger than 1 MiB: too long for a plan.`);
      return;
    }
    try {
      setText(await file.text());
      hooks.onFile(file.name);
      hooks.onInput();
    } catch {
      hooks.onTrouble(`${file.name} could not be read.`);
    }
  }

  area.addEventListener("input", () => {
    changed();
    caretMoved();
    hooks.onInput();
  });
  area.addEventListener("scroll", draw);
  for (const kind of ["keyup", "click", "focus"]) area.addEventListener(kind, caretMoved);
  acceptDrops(body, takeFile);
  new ResizeObserver(() => {
    measure();
    draw();
  }).observe(area);
  measure();
  draw();

  return {
    text: () => area.value,
    setText,
    takeFile,
    setMarks(marks) {
      shared.marks = marks;
      draw();
    },
    showLine(line) {
      shared.shown = line;
      if (line) scrollTo(line);
      draw();
    },
    // Puts the caret on a place and selects what is meant there.
    select(line, column, length, { focus = true } = {}) {
      if (line < 1 || line > shared.starts.length) return;
      const text = lineText(line);
      const from = unitsOf(text, Math.max(0, column - 1));
      const to = from + unitsOf(text.slice(from), length || 0);
      const start = shared.starts[line - 1];
      if (focus) area.focus();
      area.setSelectionRange(start + from, start + to);
      shared.shown = line;
      scrollTo(line);
      draw();
    },
    focus: () => area.focus(),
    area,
  };
}

function acceptDrops(target, take) {
  let depth = 0;
  const over = (event, step) => {
    if (![...event.dataTransfer.types].includes("Files")) return;
    event.preventDefault();
    depth += step;
    target.classList.toggle("dropping", depth > 0);
  };
  target.addEventListener("dragenter", (event) => over(event, 1));
  target.addEventListener("dragleave", (event) => over(event, -1));
  target.addEventListener("dragover", (event) => over(event, 0));
  target.addEventListener("drop", (event) => {
    if (!event.dataTransfer.files.length) return;
    event.preventDefault();
    depth = 0;
    target.classList.remove("dropping");
    take(event.dataTransfer.files[0]);
  });
}
