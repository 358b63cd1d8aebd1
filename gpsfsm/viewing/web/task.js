// How a plan is graded against its task, and the place where it leaves the task.

import { el, visibleText } from "./dom.js";
import { openPlayAt } from "./playbar.js";

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
    openPlayAt(store, player, task.play, { kind: "task", index: 0 });
    player.play();
  };
  return el("button", { type: "button", class: "finding-play", onclick: start }, "▶ Play");
}
