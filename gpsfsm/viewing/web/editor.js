// A text field for a plan: line numbers, marks of findings, files that are dropped.
//
// The text stands in a plain textarea, so that typing, undoing and reading aloud work as everywhere.
// Numbers and marks lie beside and behind it and are drawn for the lines that can be seen. Long lines are
// wrapped, so that nothing has to be scrolled into view to be read; a copy that is not seen tells where they
// stand. Texts of very many lines are not wrapped.

import { el, oncePerFrame, replaceContent } from "./dom.js";

const MOST_BYTES = 1 << 20; // what the service takes as a plan
const TAB = 4;
const MOST_WRAPPED = { lines: 3000, letters: 400_000 };
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
    wrap: "soft",
    spellcheck: "false",
    autocapitalize: "off",
    autocomplete: "off",
    "aria-label": "Text of the plan",
    placeholder: "Type or paste a plan,\nor drop a file here.",
  });
  const copy = el("div", { class: "editor-copy", "aria-hidden": "true" });
  const body = el("div", { class: "editor-body" }, gutter, el("div", { class: "editor-sheet" }, copy, marksLayer, area));
  container.append(body);
  /** @type {{line: number, column: number, length: number, severity: string, rule: string, message: string}[]} */
  const marks = [];
  /** @type {string[]} */
  const copied = []; // the lines of the copy
  const shared = { starts: [0], copied, marks, line: 0, shown: 0, character: 8, height: 20, top: 0, left: 0 };

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

  // -- where lines stand, in pixels from the beginning of the text

  const copyOf = (line) => /** @type {HTMLElement | null} */ (copy.children[line - 1] || null);
  const topOf = (line) => copyOf(line)?.offsetTop ?? shared.top + (line - 1) * shared.height;
  const heightOf = (line) => copyOf(line)?.offsetHeight ?? shared.height;

  // Makes anew only what has changed, since one types into it.
  function copyLines() {
    const isWrapped = shared.starts.length <= MOST_WRAPPED.lines && area.value.length <= MOST_WRAPPED.letters;
    area.wrap = isWrapped ? "soft" : "off";
    const lines = isWrapped ? area.value.split("\n") : [];
    const before = shared.copied;
    const least = Math.min(lines.length, before.length);
    let same = 0;
    while (same < least && lines[same] === before[same]) same += 1;
    let after = 0;
    while (after < least - same && lines[lines.length - 1 - after] === before[before.length - 1 - after]) after += 1;
    const behind = copyOf(before.length - after + 1);
    for (let left = before.length - after - same; left > 0; left -= 1) copyOf(same + 1)?.remove();
    const made = document.createDocumentFragment();
    for (const text of lines.slice(same, lines.length - after)) made.append(el("div", {}, text || "\u200b"));
    copy.insertBefore(made, behind);
    shared.copied = lines;
  }

  function lineAt(top) {
    let [low, high] = [1, shared.starts.length];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (topOf(middle) <= top) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  const visible = () => [lineAt(area.scrollTop), lineAt(area.scrollTop + area.clientHeight)];

  const draw = oncePerFrame(() => {
    copy.style.width = `${area.clientWidth}px`;
    const [first, last] = visible();
    const lines = [];
    for (let line = first; line <= last; line += 1) {
      lines.push(line + "\n".repeat(Math.round(heightOf(line) / shared.height)));
    }
    numbers.textContent = lines.join("");
    numbers.style.transform = `translateY(${topOf(first) - area.scrollTop}px)`;
    drawMarks(first, last);
  });

  function drawMarks(first, last) {
    const worst = new Map();
    const pieces = [];
    const band = (line, kind) => {
      const bar = el("div", { class: `editor-band ${kind}` });
      bar.style.top = `${topOf(line) - area.scrollTop}px`;
      bar.style.height = `${heightOf(line)}px`;
      pieces.push(bar);
    };
    if (shared.shown >= first && shared.shown <= last) band(shared.shown, "chosen");
    for (const mark of shared.marks) {
      if (mark.line < first || mark.line > last) continue;
      const before = worst.get(mark.line);
      if (!before || RANK[mark.severity] < RANK[before.severity]) worst.set(mark.line, mark);
      pieces.push(...underlines(mark));
    }
    replaceContent(marksLayer, pieces);
    replaceContent(signs, [...worst.values()].map(sign));
  }

  // One for each row of the screen on which something of it stands.
  function underlines(mark) {
    const text = lineText(mark.line);
    const from = unitsOf(text, mark.column - 1);
    const to = from + unitsOf(text.slice(from), Math.max(1, mark.length || 1));
    const copied = copyOf(mark.line)?.firstChild;
    if (copied && from < text.length) {
      const range = document.createRange();
      range.setStart(copied, from);
      range.setEnd(copied, Math.min(text.length, to));
      const { left, top } = copy.getBoundingClientRect();
      return [...range.getClientRects()].map((each) => underline(mark, each.left - left, each.top - top - (shared.height - each.height) / 2, each.width));
    }
    const start = widthOf(text.slice(0, from));
    const end = Math.max(start + 1, start + widthOf(text.slice(from, to)));
    return [underline(mark, shared.left + start * shared.character, topOf(mark.line), (end - start) * shared.character)];
  }

  function underline(mark, left, top, width) {
    const stroke = el("div", { class: `editor-underline ${mark.severity}` });
    stroke.style.top = `${top - area.scrollTop}px`;
    stroke.style.left = `${left - area.scrollLeft}px`;
    stroke.style.width = `${width}px`;
    return stroke;
  }

  function sign(mark) {
    const words = `${mark.rule}: ${mark.message}`;
    const letter = el("span", { class: `editor-sign ${mark.severity}`, title: words }, SEVERITY_LETTER[mark.severity]);
    letter.style.top = `${topOf(mark.line) - area.scrollTop}px`;
    return letter;
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
    copyLines();
    body.classList.toggle("many-lines", shared.starts.length > 9999);
    draw();
  }

  function scrollTo(line) {
    const top = topOf(line) - shared.top;
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
  changed();

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
