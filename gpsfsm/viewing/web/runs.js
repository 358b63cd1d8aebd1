// The runs that the journal knows, the newest first.

import { el, pathWords, replaceContent, visibleText } from "./dom.js";
import { clockText } from "./timeline.js";

const RUNS_AT_ONCE = 30;

export const STATUSES = {
  QUEUED: { sign: "⋯", word: "waits", kind: "open" },
  RUNNING: { sign: "▶", word: "running", kind: "running" },
  STOPPING: { sign: "■", word: "stopping", kind: "running" },
  COMPLETED: { sign: "✓", word: "completed", kind: "good" },
  GAVE_UP: { sign: "✗", word: "gave up", kind: "bad" },
  STUCK: { sign: "∞", word: "stuck", kind: "bad" },
  HANG: { sign: "∞", word: "hangs", kind: "bad" },
  ABORT: { sign: "✗", word: "aborted", kind: "bad" },
  CANCELLED: { sign: "■", word: "cancelled", kind: "stopped" },
  REFUSED: { sign: "✗", word: "refused", kind: "bad" },
};

const OPEN_STATUSES = new Set(["QUEUED", "RUNNING", "STOPPING"]);

export function isOpen(status) {
  return OPEN_STATUSES.has(status);
}

export function statusWord(status) {
  return STATUSES[status] ? STATUSES[status].word : status.toLowerCase();
}

export function statusBadge(status) {
  const words = STATUSES[status] || { sign: "", word: status.toLowerCase(), kind: "open" };
  const sign = el("span", { class: "badge-sign", "aria-hidden": "true" }, words.sign);
  return el("span", { class: `run-badge ${words.kind}`, dataset: { status } }, sign, ` ${words.word}`);
}

// In which world a run was, or is; `drawn` for none.
export function whereWords(run, drawn) {
  if (run.mode === "real") return "real robot";
  return run.world && run.world !== "drawn" ? `world ${run.world}` : drawn;
}

function when(text) {
  const time = new Date(text);
  if (Number.isNaN(time.getTime())) return "";
  const today = new Date().toDateString() === time.toDateString();
  const clock = time.toLocaleTimeString("en-GB");
  return today ? clock : `${time.toLocaleDateString("en-CA")} ${clock}`;
}

function row(run, chosen, onOpen) {
  const links = [];
  if (run.continues_run) links.push(`continues run ${run.continues_run}`);
  if (run.continued_by_run) links.push(`continued by run ${run.continued_by_run}`);
  const where = whereWords(run, "random outcomes");
  const details = [where, `seed ${run.seed}`, when(run.began)].filter(Boolean).join(" · ");
  return el(
    "li",
    {},
    el(
      "button",
      {
        class: ["run-row", run.run === chosen && "chosen"],
        type: "button",
        dataset: { run: run.run },
        "aria-current": run.run === chosen ? "true" : null,
        onclick: () => onOpen(run.run),
      },
      el("span", { class: "run-number" }, `Run ${run.run}`),
      el("span", { class: "run-name path" }, pathWords(run.name)),
      statusBadge(run.status),
      el("span", { class: "run-length" }, isOpen(run.status) ? "" : clockText(run.length_us)),
      el("span", { class: "run-details" }, details),
      links.length ? el("span", { class: "run-links" }, `↳ ${links.join(", ")}`) : null,
    ),
  );
}

// mountRuns(container, {client, onOpen}) -> {refresh, choose}; onOpen(run) is called with a number.
export function mountRuns(container, { client, onOpen }) {
  const list = el("ol", { class: "run-list", "aria-label": "Runs, newest first" });
  const more = el("button", { class: "button", type: "button", hidden: true }, "Older runs");
  const note = el("p", { class: "run-note", role: "status" }, "");
  container.append(note, list, more);
  /** @type {any[]} */
  const runs = [];
  const shared = { runs, next: null, chosen: 0, asking: false, again: false };

  function draw() {
    const focused = list.querySelector(":focus")?.getAttribute("data-run");
    replaceContent(list, shared.runs.map((run) => row(run, shared.chosen, onOpen)));
    if (focused) list.querySelector(`[data-run="${focused}"]`)?.focus();
    more.hidden = shared.next === null;
    note.textContent = shared.runs.length ? "" : "No plan has run yet.";
  }

  // The first page again; what older pages have brought stays.
  async function refresh() {
    if (shared.asking) {
      shared.again = true;
      return;
    }
    shared.asking = true;
    try {
      const page = await client.get(`/v1/runs?most=${RUNS_AT_ONCE}`);
      const oldest = page.runs.length ? page.runs[page.runs.length - 1].run : 0;
      const older = shared.runs.filter((run) => run.run < oldest);
      if (!older.length) shared.next = page.next;
      shared.runs = [...page.runs, ...older];
      draw();
    } catch (error) {
      note.textContent = `The runs could not be read: ${error.message}.`;
    } finally {
      shared.asking = false;
    }
    if (shared.again) {
      shared.again = false;
      await refresh();
    }
  }

  more.addEventListener("click", async () => {
    more.disabled = true;
    try {
      const page = await client.get(`/v1/runs?most=${RUNS_AT_ONCE}&before=${shared.next}`);
      shared.runs.push(...page.runs);
      shared.next = page.next;
      draw();
    } catch (error) {
      note.textContent = `Older runs could not be read: ${error.message}.`;
    } finally {
      more.disabled = false;
    }
  });

  return {
    refresh,
    focus() {
      const row = list.querySelector(".chosen") || list.querySelector("button");
      if (row) row.focus();
    },
    choose(run) {
      shared.chosen = run;
      draw();
    },
  };
}
