// What can be taken out of a page: the picture of the automaton as a file, and texts by the clipboard.

import { el, replaceContent } from "./dom.js";
import { FONT } from "./paint.js";
import { SvgPen } from "./svgpen.js";

const MARGIN = 24;
const DOTS = 2; // of a PNG per pixel of the screen
const LONGEST_SIDE = 8192;
const LONGEST_NAME = 80;
const KEPT_MS = 20_000;
const SAID_MS = 1500;
const CONTROL = /[\x00-\x1f\x7f-\x9f]/; // a terminal would obey it

// savedPart(pane) -> {left, top, width, height, zoom}: the whole picture, or what is in view of it.
export function savedPart({ camera, picture }) {
  if (camera.fitted) {
    return { left: -MARGIN, top: -MARGIN, width: picture.width + 2 * MARGIN, height: picture.height + 2 * MARGIN, zoom: 1 };
  }
  const { left, top, right, bottom, zoom } = camera.viewNow();
  return { left, top, width: right - left, height: bottom - top, zoom };
}

const viewOfPart = ({ left, top, width, height, zoom }) => ({
  left, top, right: left + width, bottom: top + height, zoom, pan: { x: -left * zoom, y: -top * zoom }, far: false,
});

// saveButtons(pane, name): `pane` paints its picture with paintSaved(context, view), name() is that of its plan.
export function saveButtons(pane, name) {
  const save = {
    svg() {
      const part = savedPart(pane);
      const pen = new SvgPen();
      pane.paintSaved(pen, viewOfPart(part));
      const text = pen.file(part, part.zoom, { title: name(), paper: pane.paper() });
      saveFile(new Blob([text], { type: "image/svg+xml" }), fileName(name(), "svg"));
    },
    png() {
      const part = savedPart(pane);
      const scale = Math.min(DOTS * part.zoom, LONGEST_SIDE / part.width, LONGEST_SIDE / part.height);
      const canvas = el("canvas", { width: Math.round(part.width * scale), height: Math.round(part.height * scale) });
      const context = canvas.getContext("2d");
      context.fillStyle = pane.paper();
      context.fillRect(0, 0, canvas.width, canvas.height);
      context.setTransform(scale, 0, 0, scale, -part.left * scale, -part.top * scale);
      context.font = `12px ${FONT}`;
      pane.paintSaved(context, viewOfPart(part));
      canvas.toBlob((blob) => blob && saveFile(blob, fileName(name(), "png")));
    },
  };
  return Object.entries(save).map(([form, run]) => {
    const title = `Save the automaton as ${form.toUpperCase()}, as it is shown`;
    return el("button", { type: "button", class: "tool save", title, "aria-label": title, onclick: run }, form.toUpperCase());
  });
}

// "plans/door check.xml" -> "door_check.svg"
export function fileName(name, form) {
  const last = name.split(/[\\/]/).pop() || "";
  const stem = last.replace(/\.\w{1,8}$/, "").replace(/[^\w-]+/g, "_").slice(0, LONGEST_NAME);
  return `${stem.replace(/^[_-]+|[_-]+$/g, "") || "plan"}.${form}`;
}

function saveFile(blob, name) {
  const href = URL.createObjectURL(blob);
  el("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), KEPT_MS);
}

// -- texts -----------------------------------------------------------------------------------------

// A button that copies what text() says when it is pressed, and says so itself.
export function copyButton(word, title, text) {
  const said = el("span", { role: "status" }, word);
  let timer = 0;
  const say = (words) => {
    clearTimeout(timer);
    replaceContent(said, words);
    timer = setTimeout(() => replaceContent(said, word), SAID_MS);
  };
  const copy = async () => {
    const copied = text();
    if (await copyText(copied)) say("Copied");
    else showText(copied);
  };
  return el("button", { type: "button", class: "copy", title, "aria-label": title, onclick: copy }, said);
}

// Pages from disk may have no clipboard, and some browsers refuse it: then what is selected is copied.
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return copySelected(text);
  }
}

function copySelected(text) {
  const before = document.activeElement;
  const area = el("textarea", { class: "copied-text", "aria-hidden": "true", readonly: true });
  area.value = text;
  document.body.append(area);
  area.select();
  let isDone = false;
  try {
    isDone = document.execCommand("copy");
  } catch {
    // It is shown instead.
  }
  area.remove();
  if (before instanceof HTMLElement) before.focus({ preventScroll: true });
  return isDone;
}

// The last resort: the text, selected, to be copied by hand.
function showText(text) {
  const area = el("textarea", { rows: 12, cols: 60, readonly: true, "aria-label": "Text to copy" });
  area.value = text;
  const dialog = el(
    "dialog",
    { class: "help", "aria-label": "Copy", onclose: () => dialog.remove() },
    el("p", {}, "The browser refused to copy. The text is selected: press Ctrl+C."),
    area,
    el("form", { method: "dialog" }, el("button", {}, "Close")),
  );
  document.body.append(dialog);
  dialog.showModal();
  area.select();
}

// A finding with its hint and its related places, as a compiler writes it.
export function findingText(store, number) {
  const { plan, document: { rules } } = store;
  const { line, column, severity, rule, message, hint, related } = plan.findings[number];
  const place = (at) => (at > 0 ? `${plan.name}:${at}` : plan.name);
  const head = line > 0 && column > 0 ? `${place(line)}:${column}` : place(line);
  const words = [severity, rule, rules[rule]?.name].filter(Boolean).join(" ");
  return [
    `${head}: ${words}: ${message}`,
    ...(hint ? [`  hint: ${hint}`] : []),
    ...related.map((one) => `  ${place(one.line)}: ${one.message}`),
    "",
  ].join("\n");
}

// A scenario, a sentence on a line.
export function scenarioText(title, story, ends) {
  const lines = story.map((sentence, place) => `${place + 1}. ${sentence}`);
  return [`Scenario of ${title}${ends ? `, which ends: ${ends}` : ""}`, ...lines, ""].join("\n");
}

// What can be copied of a finding.
export function findingCopies(store, number) {
  const finding = store.plan.findings[number];
  const play = store.plan.plays[finding.play];
  const story = play ? play.story : finding.story || [];
  const title = play ? play.title : finding.rule;
  const { link } = store;
  return el(
    "p",
    { class: "copies" },
    "Copy ",
    copyButton("finding", "Copy the finding as text", () => findingText(store, number)),
    story.length > 0 &&
      copyButton("scenario", "Copy the scenario as text", () => scenarioText(title, story, play ? play.ends : finding.ends)),
    link && copyButton("link", "Copy a link to this finding", () => link(number)),
  );
}

// Of a plan: its text, and the command that checks it in the same way, where the page has its options.
// There is none for a name with control characters, with which a terminal does something else.
export function planCopies(store) {
  const { check } = store.document;
  const copies = el("span", { class: "copies" }, copyButton("Copy", "Copy the text of the plan", () => store.plan.source || ""));
  if (check === undefined) return copies;
  const title = "Copy command: it checks this plan in the same way";
  const command = copyButton("Copy command", title, () => checkCommand(store.plan.name, check));
  const show = () => {
    command.hidden = CONTROL.test(store.plan.name);
  };
  copies.append(command);
  store.subscribe(["plan"], show);
  show();
  return copies;
}

// "gpsfsm check --engine ros1 'door check.xml'"
export function checkCommand(name, options) {
  const path = name === "<stdin>" ? "-" : name.replace(/^-/, "./-");
  const isPlain = /^[\w@%+=:,./-]+$/.test(path);
  const quoted = isPlain ? path : `'${path.replaceAll("'", "'\"'\"'")}'`;
  return ["gpsfsm check", options, quoted].filter(Boolean).join(" ");
}
