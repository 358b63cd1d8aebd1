// The list of findings, and above it the task: filters, explanations, related places, stories and what plays them.

import { clipText, counted, el, oncePerFrame, replaceContent, visibleText } from "./dom.js";
import { drawEnd, markSentence, openPlayAt, scrollWithin, startPlay, storyItem } from "./playbar.js";
import { findingCopies } from "./saving.js";
import { SEVERITIES, lineWords } from "./words.js";

const FILTERS = ["error", "warning", "info", "suppressed"];
// More are not put into the page at once: ten thousand would make it slow.
const SHOWN_AT_ONCE = 200;
const PRINTED_AT_ONCE = 2000;
const FILTERS_HEIGHT = 38; // pixels: they stay above the list

// Which filter shows a finding.
export function filterOf(finding) {
  return finding.suppressed ? "suppressed" : finding.severity;
}

// The indices of the findings that the filters let through, in their order.
export function shownFindings(store) {
  const { severities } = store.state;
  return store.plan.findings.flatMap((finding, number) =>
    severities[filterOf(finding)] ? [number] : [],
  );
}

// Selects the next finding that is shown, or the last one before; around the ends.
export function stepFinding(store, by) {
  const shown = shownFindings(store);
  if (!shown.length) return;
  const { finding } = store.state;
  const behind = shown.findIndex((number) => number >= finding);
  let place;
  if (finding < 0) place = by > 0 ? 0 : shown.length - 1;
  else if (behind < 0) place = by > 0 ? 0 : shown.length - 1;
  else if (shown[behind] === finding) place = behind + by;
  else place = by > 0 ? behind : behind - 1;
  store.selectFinding(shown[(place + shown.length) % shown.length]);
}

let listsMade = 0;

// mountFindings(container, store, player) -> {element, focus, destroy}
export function mountFindings(container, store, player) {
  listsMade += 1;
  const parts = {
    prefix: `findings${listsMade}`,
    top: el("div", { class: "findings-top" }),
    filters: el("div", { class: "filters", role: "group", "aria-label": "Show findings" }),
    list: el("ol", { class: "finding-list", "aria-label": "Findings" }),
    more: el("div", { class: "findings-more" }),
    first: 0,
    room: SHOWN_AT_ONCE, // so many findings from the first one on are in the page
    rules: new Set(), // findings whose rule is explained
  };
  const box = el("div", { class: "findings" }, parts.top, parts.filters, parts.list, parts.more);
  container.append(box);
  const draw = () => drawFindings(store, player, parts);
  const mark = oncePerFrame(() => {
    markStory(parts.list, store, player);
    const now = parts.list.querySelector(".story li.current");
    if (now) scrollWithin(box, now, FILTERS_HEIGHT);
  });

  function drawPlan() {
    parts.first = 0;
    parts.rules.clear();
    replaceContent(parts.top, taskCard(store, player));
    draw();
  }

  function follow() {
    const place = shownFindings(store).indexOf(store.state.finding);
    if (place >= 0 && (place < parts.first || place >= parts.first + SHOWN_AT_ONCE)) {
      parts.first = Math.floor(place / SHOWN_AT_ONCE) * SHOWN_AT_ONCE;
    }
    draw();
    const open = parts.list.querySelector(".finding.selected");
    if (open) open.scrollIntoView({ block: "nearest" });
  }

  const print = (room) => () => {
    Object.assign(parts, { first: 0, room });
    draw();
  };
  const [before, after] = [print(PRINTED_AT_ONCE), print(SHOWN_AT_ONCE)];
  addEventListener("beforeprint", before);
  addEventListener("afterprint", after);
  box.addEventListener("keydown", (event) => moveFocus(event, parts.list));
  const stops = [
    () => removeEventListener("beforeprint", before),
    () => removeEventListener("afterprint", after),
    store.subscribe(["plan"], drawPlan),
    store.subscribe(["severities", "play"], draw),
    store.subscribe(["finding"], follow),
    store.subscribe(["frame"], mark),
  ];
  drawPlan();
  return {
    element: box,
    focus: () => (parts.list.querySelector(".finding-head") || box).focus(),
    destroy() {
      stops.forEach((stop) => stop());
      box.remove();
    },
  };
}

// Up and down go from finding to finding, as in the tree.
function moveFocus(event, list) {
  const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!by || event.altKey || event.ctrlKey || event.metaKey) return;
  const heads = [...list.querySelectorAll(".finding-head")];
  const at = heads.indexOf(document.activeElement);
  if (at < 0 || !heads[at + by]) return;
  event.preventDefault();
  heads[at + by].focus();
}

function drawFindings(store, player, parts) {
  const focused = document.activeElement;
  const isOurs = parts.list.contains(focused) || parts.filters.contains(focused);
  const key = (isOurs && focused?.id) || "";
  const shown = shownFindings(store);
  parts.first = Math.min(parts.first, Math.max(0, shown.length - 1));
  const inPage = shown.slice(parts.first, parts.first + parts.room);
  const make = (number) => findingItem(store, player, parts, number);
  replaceContent(parts.filters, ...FILTERS.map((name) => filterButton(store, parts, name)));
  replaceContent(parts.list, inPage.map(make));
  drawMore(store, player, parts, shown.length);
  markStory(parts.list, store, player);
  if (key) document.getElementById(key)?.focus();
}

function filterButton(store, parts, name) {
  const count = store.plan.findings.filter((finding) => filterOf(finding) === name).length;
  if (name === "suppressed" && !count) return null;
  const on = store.state.severities[name];
  const letter = name === "suppressed" ? "S" : SEVERITIES[name].letter;
  return el(
    "button",
    {
      type: "button",
      id: `${parts.prefix}-filter-${name}`,
      class: ["filter", name, !count && "none"],
      "aria-pressed": String(on),
      title: `${on ? "Hide" : "Show"} ${name === "suppressed" ? "suppressed findings" : `findings of severity ${name}`}`,
      onclick: () => store.set({ severities: { ...store.state.severities, [name]: !on } }),
    },
    el("span", { class: `badge ${name}`, "aria-hidden": "true" }, letter),
    el("span", { class: "filter-word" }, name),
    el("span", { class: "filter-count" }, String(count)),
  );
}

function drawMore(store, player, parts, count) {
  const last = Math.min(count, parts.first + parts.room);
  const turn = (first, words) =>
    el(
      "button",
      {
        type: "button",
        class: "plain",
        onclick: () => {
          parts.first = first;
          drawFindings(store, player, parts);
          parts.list.scrollIntoView({ block: "start" });
        },
      },
      words,
    );
  replaceContent(
    parts.more,
    !count && el("p", { class: "nothing" }, emptyWords(store)),
    parts.first > 0 && turn(Math.max(0, parts.first - SHOWN_AT_ONCE), "← earlier"),
    count > parts.room && el("span", {}, `${parts.first + 1} to ${last} of ${count}`),
    last < count && turn(last, "later →"),
    leftOut(store.plan),
  );
}

function leftOut({ plays_left_out: count }) {
  if (!count) return null;
  const words = `${counted(count, "scenario is", "scenarios are")} described but cannot be played here.`;
  return el("p", { class: "nothing" }, words);
}

function emptyWords(store) {
  const { findings, verdict } = store.plan;
  if (findings.length) return "The filters above hide all findings.";
  return verdict === "undecided" ? "The plan is undecided." : "No findings.";
}

function findingItem(store, player, parts, number) {
  const finding = store.plan.findings[number];
  const isOpen = number === store.state.finding;
  const id = `${parts.prefix}-${number}`;
  const isPlaying = finding.play >= 0 && store.state.play === store.plan.plays[finding.play];
  return el(
    "li",
    {
      class: ["finding", filterOf(finding), isOpen && "selected", isPlaying && "playing", finding.play >= 0 && "playable"],
      dataset: { finding: number },
    },
    headOf(store, finding, number, id, isOpen),
    finding.play >= 0 && playButton(store, player, finding, number, `${id}-play`, isPlaying),
    el(
      "div",
      { class: "finding-body", id: `${id}-body` },
      bodyOf(store, player, parts, finding, number, id),
    ),
  );
}

function headOf(store, finding, number, id, isOpen) {
  const rule = store.document.rules[finding.rule];
  const place = finding.line > 0 ? lineWords(store.plan, finding) : "";
  const { letter, word } = SEVERITIES[finding.severity] || SEVERITIES.info;
  return el(
    "button",
    {
      type: "button",
      id,
      class: "finding-head",
      "aria-expanded": String(isOpen),
      "aria-controls": `${id}-body`,
      onclick: () => store.selectFinding(isOpen ? -1 : number),
    },
    el("span", { class: `badge ${finding.severity}`, title: word }, letter),
    el("span", { class: "rule-code" }, finding.rule),
    el("span", { class: "rule-name", title: rule ? rule.summary : "" }, rule ? rule.name : ""),
    finding.suppressed && el("span", { class: "tag" }, "suppressed"),
    finding.confidence !== "proved" &&
      el("span", { class: "tag" }, finding.confidence === "may" ? "not proved" : "heuristic"),
    el("span", { class: "finding-line" }, place),
    el("span", { class: "finding-message" }, visibleText(finding.message)),
  );
}

function playButton(store, player, finding, number, id, isPlaying) {
  const words = isPlaying ? "Close" : "Play";
  const label = `${words} the scenario of ${finding.rule} at ${lineWords(store.plan, finding)}`;
  const start = () => {
    if (isPlaying) {
      store.openPlay(null);
      return;
    }
    if (store.state.finding !== number) store.selectFinding(number);
    startPlay(store, player, finding.play, { kind: "finding", index: number });
  };
  return el(
    "button",
    { type: "button", id, class: "finding-play", "aria-label": label, title: label, onclick: start },
    isPlaying ? "■ Close" : "▶ Play",
  );
}

function bodyOf(store, player, parts, finding, number, id) {
  return [
    finding.hint &&
      el("p", { class: "hint" }, el("strong", {}, "Hint: "), visibleText(finding.hint)),
    relatedOf(store, finding, number),
    storyOfFinding(store, player, finding, number),
    finding.suppressed && suppressedBy(finding),
    ruleHelp(store, parts, finding, number, id),
    findingCopies(store, number),
  ];
}

function relatedOf(store, finding, number) {
  if (!finding.related.length) return null;
  const go = (related) => () => {
    if (store.state.finding !== number) store.selectFinding(number);
    if (related.element >= 0) store.selectElement(related.element, "finding");
    else store.set({ line: related.line, from: "finding" });
  };
  return el(
    "ul",
    { class: "related", "aria-label": "Related places" },
    finding.related.map((related) =>
      el(
        "li",
        {},
        el(
          "button",
          { type: "button", class: "place", onclick: go(related) },
          lineWords(store.plan, related),
        ),
        " ",
        visibleText(related.message),
      ),
    ),
  );
}

function storyOfFinding(store, player, finding, number) {
  const play = store.plan.plays[finding.play];
  const story = play ? play.story : finding.story || [];
  if (!story.length) return null;
  const ends = el("span");
  drawEnd(ends, play ? play.ends : finding.ends);
  const show = (line) => () =>
    openPlayAt(store, player, finding.play, { kind: "finding", index: number }, line);
  return el(
    "div",
    { class: "scenario" },
    el("p", { class: "scenario-head" }, "Scenario ", ends),
    el(
      "ol",
      { class: "story" },
      story.map((text, line) => storyItem({ text, show: play ? show(line) : null })),
    ),
  );
}

function suppressedBy(finding) {
  const reason = finding.justification ? `: ${clipText(finding.justification, 300)}` : "";
  return el("p", { class: "hint" }, visibleText(`Suppressed by ${finding.suppressed}${reason}`));
}

function ruleHelp(store, parts, finding, number, id) {
  const rule = store.document.rules[finding.rule];
  if (!rule) return null;
  const toggle = (event) => {
    if (event.currentTarget.open) parts.rules.add(number);
    else parts.rules.delete(number);
  };
  return el(
    "details",
    { class: "rule-help", ontoggle: toggle, open: parts.rules.has(number) },
    el("summary", { id: `${id}-rule` }, `Why ${finding.rule}?`),
    el("p", {}, el("strong", {}, `${finding.rule} ${rule.name}`), `: ${rule.summary}`),
    el("p", {}, rule.why),
    el("p", { class: "command" }, el("code", {}, `gpsfsm explain ${finding.rule}`)),
  );
}

// Marks the sentences of the play that happen in the step that is shown, and those before.
function markStory(list, store, player) {
  const { play, playOrigin } = store.state;
  const story = play ? player.story : [];
  for (const item of list.querySelectorAll(".finding.selected, .finding.playing")) {
    const number = Number(item.dataset.finding);
    const isPlayed = play && store.plan.plays[store.plan.findings[number].play] === play;
    const own = isPlayed || (playOrigin && playOrigin.index === number && playOrigin.kind === "finding");
    item.querySelectorAll(".story li").forEach((line, place) => {
      markSentence(line, own ? story[place] : "");
    });
  }
}

// -- how a plan is graded against its task, and the place where it leaves the task ---------------

const GRADES = {
  success: { sign: "✓", kind: "good" },
  partial: { sign: "◐", kind: "neutral" },
  failed: { sign: "✗", kind: "bad" },
};

// The card above the findings; null without a task.
export function taskCard(store, player) {
  const { task } = store.plan;
  if (!task) return null;
  return el(
    "section",
    { class: "task", "aria-label": "Task" },
    el("p", { class: "task-head" }, gradeBadge(task.grade), el("strong", {}, visibleText(task.name))),
    task.text && el("blockquote", {}, visibleText(task.text)),
    task.words.map((words) => el("p", {}, visibleText(words))),
    el("p", { class: "task-go" }, placeButton(store, task), playTask(store, player, task)),
  );
}

export function gradeBadge(grade) {
  const { sign, kind } = GRADES[grade] || { sign: "?", kind: "neutral" };
  return el("span", { class: `end end-${kind}` }, `${sign} ${grade}`);
}

// Selects the finding that tells where the plan leaves the task, or else the place.
function placeButton(store, task) {
  if (task.line <= 0) return null;
  const { findings } = store.plan;
  const number = findings.findIndex(
    (one) => one.rule.startsWith("GP6") && one.line === task.line && one.play === task.play,
  );
  const go = () => {
    if (number >= 0) store.selectFinding(number);
    else if (task.element >= 0) store.selectElement(task.element, "finding");
    else store.set({ line: task.line, from: "finding" });
  };
  return el("button", { type: "button", class: "place", onclick: go }, `leaves the task at line ${task.line}`);
}

function playTask(store, player, task) {
  if (!store.plan.plays[task.play]) return null;
  const start = () => {
    startPlay(store, player, task.play, { kind: "task", index: 0 });
  };
  return el("button", { type: "button", class: "finding-play", onclick: start }, "▶ Play");
}
