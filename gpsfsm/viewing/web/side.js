// What belongs to a run beside its automaton: the map, what runs now, what is said, what happened.

import { clipText, el, replaceContent, sign, visibleText } from "./dom.js";
import { createMap } from "./map.js";
import { lastUntil } from "./scene.js";
import { makeTabs, tabPanel } from "./tabs.js";
import { clockText } from "./timeline.js";
import { nodeWords, recordSentence } from "./words.js";

/** @import { Watch } from "./watch.js" */

const MOST_SHOWN = 200;
const LONGEST_TEXT = 400;

const SIGNS = {
  BEGIN: "▷",
  TRIGGERED: "⋯",
  STARTED: "▶",
  SUCCEEDED: "✓",
  FAILED: "✗",
  TIMEOUT: "◔",
  STOPPING: "■",
  STOPPED: "■",
  HELD: "‖",
  JOINED: "⋈",
  NOT_LOADED: "✗",
  PAUSE: "‖",
  RESUME: "▶",
  CANCEL: "■",
  CONTINUED: "↻",
  RESTARTED: "↻",
  NOTE: "✎",
  ENDED: "■",
};
const LISTS = [
  ["active", "Running"],
  ["word", "Said and heard"],
  ["event", "Events"],
];
const SILENT_KINDS = new Set(["LOADING", "LOADED", "UNLOADED"]);
// What a runner says again and again while it acts is shown where it acts.
function isShown({ kind, record, data }) {
  const again = kind === "LOG" && data && (data.feedback !== undefined || data.world === "pose");
  return !again && !SILENT_KINDS.has(kind) && record !== false;
}

// The last records that are to be shown, in order.
function lastOf(records, wanted) {
  const last = [];
  for (let i = records.length - 1; i >= 0 && last.length < MOST_SHOWN; i -= 1) {
    if (wanted(records[i])) last.push(records[i]);
  }
  return last.reverse();
}

const NO_PLAN = { automaton: null, elements: [] };

function eventRow(record, plan, onSeek) {
  const mark = SIGNS[record.kind] || "·";
  const text = recordSentence(plan || NO_PLAN, record);
  return el(
    "li",
    { class: `event-row ${record.kind.toLowerCase()}` },
    el(
      "button",
      { type: "button", class: "event-button", title: "Go to this moment", onclick: () => onSeek(record.at_us) },
      el("span", { class: "event-time" }, clockText(record.at_us)),
      el("span", { class: "event-sign", "aria-hidden": "true" }, mark),
      el("span", { class: "event-text" }, clipText(text, LONGEST_TEXT)),
    ),
  );
}

const SPEAKERS = { say: "Robot", hear: "Heard", sound: "Sound" };

function wordRow(said, onSeek) {
  const who = said.kind === "reply" ? said.who : SPEAKERS[said.kind];
  return el(
    "li",
    { class: `word-row ${said.kind}` },
    el(
      "button",
      { type: "button", class: "event-button", title: "Go to this moment", onclick: () => onSeek(Math.max(0, said.at_us)) },
      el("span", { class: "event-time" }, clockText(said.at_us)),
      el("span", { class: "word-who" }, visibleText(who)),
      el("span", { class: "word-text" }, visibleText(clipText(said.text, LONGEST_TEXT))),
    ),
  );
}

// hooks: onSeek(at_us), onFail(node), onElement(element)
export function mountSide(container, hooks) {
  const mapTitle = el("h2", { class: "pane-title" }, "Map");
  const mapBox = el("div", { class: "map-box" });
  const bodies = LISTS.map(([key]) => el("ol", { class: `${key}-list` }));
  const panels = LISTS.map(([key], number) =>
    tabPanel(key, "side", { class: "side-panel", tabindex: 0 }, bodies[number]),
  );
  const wiring = { label: "What happens in the run", prefix: "side" };
  const tabs = makeTabs(LISTS, chosen, wiring);
  container.append(
    el("section", { class: "pane map-pane", "aria-label": "Map" }, mapTitle, mapBox),
    el("section", { class: "pane side-log" }, tabs.list, panels),
  );
  const map = createMap(mapBox, { onElement: hooks.onElement });
  /** @type {{watch: Watch | null, key: string, drawn: string[]}} */
  const shared = { watch: null, key: "active", drawn: ["", "", ""] };

  function chosen(key) {
    shared.key = key;
    panels.forEach((panel, number) => {
      panel.hidden = LISTS[number][0] !== key;
    });
    drawLogs();
  }

  function drawActive() {
    const { watch } = shared;
    const store = watch?.store;
    const active = watch ? watch.active() : [];
    tabs.buttons[0].textContent = active.length ? `Running (${active.length})` : "Running";
    const now = Boolean(watch && watch.attached && watch.running);
    const says = active.map((node) => (watch ? watch.feedbackAt(node) : ""));
    const key = `${now} ${active.join()} ${says.join()}`;
    if (shared.drawn[0] === key) return;
    shared.drawn[0] = key;
    if (!store || !active.length) {
      replaceContent(bodies[0], el("li", { class: "nothing" }, watch ? "Nothing is running at this moment." : "No run is open."));
      return;
    }
    replaceContent(
      bodies[0],
      active.map((node, place) => {
        const words = nodeWords(store.plan, node);
        const danger = { class: "button danger", type: "button", disabled: !now, "aria-label": `Make it fail: ${words}` };
        const fail = watch?.real ? null : el("button", { ...danger, onclick: () => hooks.onFail(node) }, "Make it fail");
        const said = says[place] ? el("span", { class: "active-says" }, says[place]) : null;
        return el("li", { class: "active-row", dataset: { node } }, el("span", { class: "event-sign" }, sign("play")), el("span", {}, words, said), fail);
      }),
    );
  }

  function drawLogs() {
    const { watch, key } = shared;
    drawActive();
    if (key === "word") {
      const words = watch && watch.scene ? watch.scene.wordsUntil(watch.at) : [];
      list(1, words, (said) => wordRow(said, hooks.onSeek), "Nothing has been said.");
    } else if (key === "event") {
      const records = watch ? watch.records.slice(0, lastUntil(watch.records, watch.at) + 1) : [];
      const plan = watch && watch.store ? watch.store.plan : null;
      const events = lastOf(records, isShown);
      list(2, events, (record) => eventRow(record, plan, hooks.onSeek), "Nothing has happened.", records.length);
    }
  }

  // Draws the last rows of a list, if they are others than before; the newest is in view.
  function list(number, items, row, empty, length = items.length) {
    const last = items[items.length - 1];
    const key = `${length} ${last ? last.at_us : ""}`;
    if (shared.drawn[number] === key) return;
    shared.drawn[number] = key;
    const rows = items.slice(-MOST_SHOWN).map(row);
    replaceContent(bodies[number], rows.length ? rows : el("li", { class: "nothing" }, empty));
    panels[number].scrollTop = panels[number].scrollHeight;
  }

  tabs.choose("active");

  return {
    // A run, or a world that no run is in yet (watch null).
    show(watch, scene, title, goals) {
      shared.watch = watch;
      shared.drawn = ["", "", ""];
      mapTitle.textContent = title ? `Map · ${title}` : "Map";
      map.setScene(scene);
      map.setGoals(goals);
      map.setTime(watch ? watch.at : 0);
      drawLogs();
    },
    update() {
      if (shared.watch) map.setTime(shared.watch.at);
      drawLogs();
    },
  };
}
