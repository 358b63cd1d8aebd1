// A run along its time, one row for each instance and each join: who was active when, which joins
// waited, and how each came to its end. It is read off the history of a run (history.js), so that a
// scenario, a diff and a run on the live page show the same.
//
//   mountTimeline(container, {plan, history, folded, position, length, times, onSeek, onSelect})
//     -> {rowsInView, update, refold, destroy}
//
// Scenarios are drawn step by step, runs by their seconds. What is folded in the automaton is one row.

import { counted, el, oncePerFrame, replaceContent } from "./dom.js";
import { foldedGroups } from "./folding.js";
import { countUpTo } from "./history.js";
import { virtualRows } from "./rows.js";
import { ENDS, STATES, endSentence, joinWord, lineWords, nodeName } from "./words.js";

const LANE_HEIGHT = 24; // as large as a finger can hit
const ROWS_AT_ONCE = 40; // of a run with more rows as large a part is shown at once
const GOING_ON = new Set(["triggered", "running", "waiting", "timeout"]);
const ROW_KINDS = new Set(["runner", "join", "complete", "give_up"]);

/**
 * @typedef {{from: number, to: number, state: string, end: string}} Bar   from and to are numbers of
 *   records; `to` is -1 as long as the bar goes on; `end`: the state it ended in, "" while it goes on
 */

// What was active when: rows in the order in which they began.
export class Lanes {
  /** @type {Map<number, Bar[]>} */
  rows = new Map();
  taken = 0;

  constructor(history) {
    this.history = history;
  }

  // Takes in the records that have come since; whether there are any.
  update() {
    const { frames, automaton } = this.history;
    if (this.taken === frames.length) return false;
    for (; this.taken < frames.length; this.taken += 1) {
      for (const { node, after } of frames[this.taken].changes) {
        if (ROW_KINDS.has(automaton.nodes[node].kind)) this.change(node, after.state);
      }
    }
    return true;
  }

  change(node, state) {
    if (state === "never") return;
    if (!this.rows.has(node)) this.rows.set(node, []);
    const bars = this.rows.get(node) || [];
    const last = bars[bars.length - 1];
    const isGoingOn = last && last.to < 0;
    if (isGoingOn && last.state === state) return;
    if (isGoingOn) {
      last.to = this.taken;
      if (!GOING_ON.has(state)) last.end = state;
    }
    if (GOING_ON.has(state)) bars.push({ from: this.taken, to: -1, state, end: "" });
    else if (!isGoingOn && state !== "idle") bars.push({ from: this.taken, to: this.taken, state, end: state });
  }
}

// Rows of nodes, with those of a folded group as one, which is active while any of them is.
export function rowsOf(lanes, folded) {
  const { automaton } = lanes.history;
  const around = folded ? foldedGroups(automaton, folded) : [];
  const rows = new Map();
  for (const [node, bars] of lanes.rows) {
    const group = automaton.group_of[node];
    const hiding = group >= 0 ? (around[group] ?? -1) : -1;
    const key = hiding >= 0 ? `g${hiding}` : `n${node}`;
    const row = rows.get(key);
    if (row) {
      row.bars.push(...bars);
      row.count += 1;
    } else {
      rows.set(key, { node, group: hiding, count: 1, bars: [...bars] });
    }
  }
  const ordered = [...rows.values()];
  for (const row of ordered) if (row.group >= 0) row.bars = joinedBars(row.bars);
  return ordered;
}

function joinedBars(bars) {
  const until = (bar) => (bar.to < 0 ? Infinity : bar.to);
  const joined = [];
  for (const bar of [...bars].sort((one, other) => one.from - other.from)) {
    const last = joined[joined.length - 1];
    if (last && bar.from <= until(last)) {
      if (until(bar) > until(last)) [last.to, last.end] = [bar.to, bar.end];
      if (bar.state === "running") last.state = "running";
    } else {
      joined.push({ ...bar });
    }
  }
  return joined;
}

export function clockText(us) {
  const seconds = Math.max(0, us) / 1e6;
  const minutes = Math.floor(seconds / 60);
  const rest = (seconds - minutes * 60).toFixed(1).padStart(minutes ? 4 : 3, "0");
  return minutes ? `${minutes}:${rest}` : `${rest} s`;
}

// The scale of a scenario: one step for each place at which something new can be seen.
function stepScale(history) {
  const { stops } = history;
  const stepOf = (record) => Math.min(stops.length, countUpTo(stops, record) + 1);
  return {
    length: () => stops.length,
    room: () => stops.length + 1, // so that what begins at the last step can be seen
    at: stepOf,
    words: (step) => `step ${step}`,
    unit: 1,
  };
}

// The scale of two scenarios that are played as one: the times at which something can be seen in either.
function pairScale(history, times) {
  return { ...stepScale(history), length: () => times.length, room: () => times.length + 1, at: (record) => countUpTo(times, history.times[record] ?? 0) };
}

// The scale of a run: microseconds.
function timeScale(history, length) {
  return { length, room: () => Math.max(1, length()), at: (record) => history.times[record] ?? 0, words: clockText, unit: 1000 };
}

/**
 * history(): the RunHistory that is shown, or null; position(): the step or the microseconds that are
 * shown; length(): for a run by its seconds, how long it is; times: for one of two scenarios, those of
 * its steps; onSeek(step or microseconds).
 * @param {HTMLElement} container
 * @param {{plan: () => any, history: () => any, folded?: () => Set<number>, position: () => number,
 *   length?: () => number, times?: number[], onSeek: (position: number) => void, onSelect?: (node: number) => void}} options
 */
export function mountTimeline(container, { plan, history, folded, position, length, times, onSeek, onSelect }) {
  const handle = el("input", {
    class: "timeline-handle", type: "range", min: 0, max: 1, step: 1, value: 0,
    "aria-label": length ? "Time of the run" : "Step of the scenario",
  });
  const scroller = el("div", { class: "timeline-rows", role: "list", "aria-label": "Who is active when", tabindex: "0" });
  const line = el("div", { class: "timeline-now", "aria-hidden": "true" });
  const summary = el("summary", { class: "timeline-title" }, "Timeline");
  const box = el(
    "details", { class: "timeline", open: true }, summary,
    length ? el("div", { class: "timeline-axis" }, handle) : null,
    el("div", { class: "timeline-body" }, scroller, el("div", { class: "timeline-over", "aria-hidden": "true" }, line)),
  );
  container.append(box);
  const part = el("span", { class: "timeline-part" });
  /** @type {{lanes: Lanes | null, rows: any[], scale: any, followed: number, section: {start: number, span: number}}} */
  const shared = { lanes: null, rows: [], scale: null, followed: -1, section: { start: 0, span: 1 } };
  const list = virtualRows(scroller, { rowHeight: LANE_HEIGHT, row: drawRow, classes: () => "timeline-row" });

  function drawRow(number) {
    const row = shared.rows[number];
    const { scale } = shared;
    const words = rowWords(plan(), row);
    const track = el("div", { class: "timeline-track" });
    for (const bar of row.bars) drawBar(track, bar, scale, row);
    // "14: Waypo… (x=8.0, y=1.5)": the name gives way to what tells one runner from another, if that is short.
    const end = words.search(/ [(“]/);
    const name = el("span", { class: "timeline-name" }, end < 0 ? words : words.slice(0, end));
    const detail = end < 0 ? null : el("span", { class: "timeline-detail" }, words.slice(end));
    name.style.minWidth = `${Math.min(9, name.textContent.length)}ch`;
    const kind = words.length > end + 24 ? "timeline-label long" : "timeline-label";
    const label = el("button", { type: "button", class: kind, title: words, tabindex: "-1", onclick: () => onSelect && onSelect(row.node) }, name, detail);
    return el("div", { role: "listitem", "aria-label": `${words}: ${barsWords(row, scale)}` }, label, track);
  }

  function drawBar(track, bar, scale, row) {
    const { start, span } = shared.section;
    const share = (value) => (100 * (value - start)) / span;
    const from = Math.max(start, scale.at(bar.from));
    const endsAt = bar.to < 0 ? scale.room() : scale.at(bar.to);
    const to = Math.min(start + span, endsAt);
    if (to < from) return;
    if (bar.to !== bar.from && (to > from || !bar.end)) {
      const made = el("span", { class: `timeline-bar is-${bar.state}${bar.to < 0 ? " goes-on" : ""}`, title: barWords(bar, scale) });
      made.style.left = `${share(from)}%`;
      made.style.width = `${share(to) - share(from)}%`;
      track.append(made);
    }
    if (endsAt > to || !bar.end || bar.end === "idle") return;
    const state = markOf(bar.end, row);
    const end = el("span", { class: `timeline-end state-${state}` }, STATES[state].sign);
    end.title = barWords(bar, scale);
    end.style.left = `${share(to)}%`;
    track.append(end);
  }

  // The sign of an end: a join that has collected failures, and a plan that gives up, are no success.
  function markOf(state, row) {
    const { automaton } = shared.lanes?.history || {};
    const fails = automaton?.nodes[row.node].kind === "give_up" || (automaton?.failing || []).includes(row.node);
    if (fails && (state === "fired" || state === "reached")) return "failed";
    return state === "reached" ? "succeeded" : state;
  }

  function barWords(bar, scale) {
    const words = `${STATES[bar.state].word} from ${scale.words(scale.at(bar.from))}`;
    if (bar.to >= 0 && bar.end && scale.at(bar.to) === scale.at(bar.from)) return `${STATES[bar.end].word} at ${scale.words(scale.at(bar.from))}`;
    if (bar.to < 0) return shared.lanes?.history.ended ? `${words} to the end` : `${words} on`;
    return `${words} to ${scale.words(scale.at(bar.to))}${bar.end && bar.end !== "idle" ? `, ${STATES[bar.end].word}` : ""}`;
  }

  // What has taken no time is left out.
  const barsWords = (row, scale) =>
    row.bars.filter((bar) => bar.to < 0 || bar.end || scale.at(bar.from) < scale.at(bar.to)).map((bar) => barWords(bar, scale)).join("; ");

  function rebuild() {
    const past = history();
    if (!past) {
      box.hidden = !length;
      scroller.hidden = true;
      return;
    }
    box.hidden = !past.length && !length;
    scroller.hidden = false;
    if (!shared.lanes || shared.lanes.history !== past) {
      shared.lanes = new Lanes(past);
      shared.scale = length ? timeScale(past, length) : times ? pairScale(past, times) : stepScale(past);
      shared.followed = -1;
    }
    shared.lanes.update();
    shared.rows = rowsOf(shared.lanes, folded && folded());
    const end = ENDS[past.ended];
    replaceContent(
      summary, `Timeline: ${counted(shared.rows.length, "row")}`, part,
      end ? el("span", { class: `timeline-outcome end end-${end.kind}` }, `${end.sign} ${endSentence(plan(), past.ended)}`) : null,
    );
    box.style.setProperty("--timeline-rows", String(rowsInView()));
    choosePart(position());
    list.setCount(shared.rows.length);
    drawn = signature();
  }

  const rowsInView = () => Math.min(6, Math.max(1, shared.rows.length));

  // What the rows depend on; while it is the same, only the line moves.
  let drawn = "";
  const signature = () => {
    const past = history();
    return `${past ? past.length : -1} ${length && past && !past.ended ? Math.round(length() / 1e5) : 0}`;
  };

  function move() {
    const { scale } = shared;
    const now = position();
    const whole = scale ? scale.length() : length ? length() : 1;
    const unit = scale ? scale.unit : 1000;
    handle.max = String(Math.max(1, Math.ceil(whole / unit)));
    handle.value = String(Math.round(now / unit));
    const words = scale ? scale.words : clockText;
    handle.setAttribute("aria-valuetext", `${words(now)} of ${length ? clockText(whole) : whole}`);
    if (scale) choosePart(now);
    const { start, span } = scale ? shared.section : { start: 0, span: Math.max(1, whole) };
    line.style.left = `min(100% - 2px, ${Math.max(0, (100 * (now - start)) / span)}%)`;
    follow(now);
  }

  // Of long runs a part is shown that goes along with the step: in the whole of them bars would be
  // as thin as a line.
  function choosePart(now) {
    const { scale, rows, section } = shared;
    const room = scale.room();
    const span = room * Math.min(1, ROWS_AT_ONCE / Math.max(1, rows.length));
    const grid = span / 4;
    const start = span < room ? Math.min(room - span, Math.max(0, Math.floor((now - span / 2) / grid) * grid)) : 0;
    if (section.start === start && section.span === span) return;
    shared.section = { start, span };
    const whole = scale.words(length ? start : Math.ceil(start));
    part.textContent = span < room ? ` · from ${whole} to ${scale.words(length ? start + span : Math.floor(start + span))}` : "";
    list.redraw();
  }

  // Keeps what happens at the step in view.
  function follow(now) {
    const { lanes, rows, scale } = shared;
    if (!lanes || now === shared.followed || !scale) return;
    shared.followed = now;
    let latest = -1;
    let number = -1;
    rows.forEach((row, place) => {
      for (const { from, to } of row.bars) {
        for (const record of [from, to]) {
          if (record >= latest && scale.at(record) <= now) [latest, number] = [record, place];
        }
      }
    });
    if (number >= 0) list.show(number);
  }

  const update = oncePerFrame(() => {
    if (!shared.lanes || shared.lanes.history !== history() || drawn !== signature()) rebuild();
    move();
  });

  handle.addEventListener("input", () => onSeek(Number(handle.value) * (shared.scale?.unit ?? 1000)));
  scroller.addEventListener("click", (event) => {
    const { target } = event;
    const track = target instanceof Element && target.closest(".timeline-track");
    if (!track || !shared.scale) return;
    const { left, width } = track.getBoundingClientRect();
    const { start, span } = shared.section;
    const place = start + ((event.clientX - left) / Math.max(1, width)) * span;
    onSeek(Math.max(0, Math.min(shared.scale.length(), length ? place : Math.round(place))));
  });
  scroller.addEventListener("keydown", (event) => {
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    const step = shared.scale && !length ? 1 : (length ? length() : 1) / 50;
    onSeek(Math.max(0, position() + (event.key === "ArrowLeft" ? -step : step)));
    event.preventDefault();
    event.stopPropagation();
  });

  // The line stands above the rows, whose width a scroll bar takes from.
  const fit = () => {
    const { offsetWidth, clientWidth } = scroller;
    if (!clientWidth) return;
    box.style.setProperty("--timeline-side", `${offsetWidth - clientWidth + 16}px`);
    box.style.setProperty("--timeline-label", `${Math.round(Math.max(84, Math.min(260, 0.37 * clientWidth)))}px`);
  };
  const sized = new ResizeObserver(fit);
  sized.observe(scroller);

  rebuild();
  move();
  return {
    rowsInView,
    update,
    refold() {
      drawn = "";
      update();
    },
    destroy() {
      sized.disconnect();
      list.destroy();
      box.remove();
    },
  };
}

function rowWords(plan, row) {
  const { automaton, elements } = plan;
  if (row.group >= 0) {
    const { element, label } = automaton.groups[row.group];
    const at = element >= 0 && elements[element] ? ` at ${lineWords(plan, elements[element])}` : "";
    return `⊞ ${label}${at} (${counted(row.count, "row")})`;
  }
  const node = automaton.nodes[row.node];
  const line = lineWords(plan, elements[node.element] || {}).replace("line ", "");
  if (node.kind === "join") return `${line}: ${joinWord(node)} of ${nodeName(plan, row.node)}`;
  return node.kind === "runner" ? `${line}: ${nodeName(plan, row.node)}` : node.label.join(" ") || node.kind.replace("_", " ");
}

// The timeline of the play of a store, whichever is open in it. Its steps have a handle in the bar of
// the player already. pair: the player of two runs, of which this is one.
/** @param {any} pair */
export function mountPlayTimeline(container, store, player, pair = null) {
  const timeline = mountTimeline(container, {
    plan: () => store.plan,
    history: () => (store.state.play ? player.history : null),
    folded: () => store.state.collapsed,
    position: () => (pair || player).progress.number,
    times: pair?.times,
    onSeek: (step) => {
      (pair || player).pause();
      (pair || player).seekStep(step);
    },
    onSelect: (node) => store.selectNode(node, "timeline"),
  });
  const stops = [
    player.subscribe(timeline.update),
    store.subscribe(["play", "plan"], timeline.update),
    store.subscribe(["collapsed"], timeline.refold),
  ];
  return {
    ...timeline,
    destroy() {
      stops.forEach((stop) => stop());
      timeline.destroy();
    },
  };
}
