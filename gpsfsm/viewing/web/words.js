// The words and signs of the page: severities, states, events, kinds of elements, and what happens in a
// run. Everything that has a colour has a sign as well, so that the page can be read without colours.

import { clipText, visibleText } from "./dom.js";
import { planIndex } from "./state.js";

export const SEVERITIES = {
  error: { letter: "E", word: "error" },
  warning: { letter: "W", word: "warning" },
  info: { letter: "I", word: "info" },
};

export const STATES = {
  idle: { sign: "", word: "not reached yet", color: "" },
  triggered: { sign: "⋯", word: "triggered", color: "--state-triggered" },
  running: { sign: "▶", word: "running", color: "--state-running" },
  succeeded: { sign: "✓", word: "succeeded", color: "--state-succeeded" },
  failed: { sign: "✗", word: "failed", color: "--state-failed" },
  timeout: { sign: "◔", word: "timed out", color: "--state-failed" },
  stopped: { sign: "■", word: "stopped", color: "--state-stopped" },
  waiting: { sign: "…", word: "waits for inputs", color: "--state-triggered" },
  stuck: { sign: "∞", word: "waits for ever", color: "--state-failed" },
  fired: { sign: "✓", word: "has fired", color: "--state-succeeded" },
  never: { sign: "–", word: "never ran", color: "--state-never" },
  reached: { sign: "●", word: "reached", color: "--state-reached" },
};

export const EVENTS = {
  SUCCEEDED: { word: "succeeded", color: "--event-succeeded", line: "solid" },
  FAILED: { word: "failed", color: "--event-failed", line: "dashed" },
  STARTED: { word: "started", color: "--event-started", line: "dotted" },
  STOPPED: { word: "stopped", color: "--event-stopped", line: "dotted" },
  STOPS: { word: "stops", color: "--event-stops", line: "broken" },
};

export const CONTROL_SIGNS = {
  sequential: "→",
  recovery: "↺",
  parallel_any: "∥1",
  parallel_all: "∥∗",
};

// A short sign for an element of the plan.
export function elementSign(element) {
  if (element.kind === "runner") return "▸";
  if (element.kind === "plan") return "◆";
  return CONTROL_SIGNS[element.type] || "○";
}

// What a join waits for, in a word.
export function joinWord(node) {
  if (node.need === 1) return "any";
  return node.need >= node.inputs ? `all ${node.need}` : `${node.need} of ${node.inputs}`;
}

// The most severe of some findings that are not suppressed, or "" if there is none.
export function worstSeverity(findings) {
  const severities = new Set(findings.filter((one) => !one.suppressed).map((one) => one.severity));
  return ["error", "warning", "info"].find((one) => severities.has(one)) || "";
}

// -- what a record of a run tells, in a sentence, and how runs end ------------------------------

const VERBS = {
  TRIGGERED: "is triggered",
  HELD: "is triggered, and waits: the run is paused",
  STARTED: "starts",
  SUCCEEDED: "succeeds",
  FAILED: "fails",
  TIMEOUT: "times out",
  STOPPING: "is asked to stop",
  STOPPED: "stops",
  NOT_LOADED: "cannot be loaded",
  LATE: "answers too late, which changes nothing",
  RESTARTED: "is started again",
};

const OF_RUNS = {
  BEGIN: "the run begins",
  PAUSE: "the run is paused",
  RESUME: "the run resumes",
  CANCEL: "the run is cancelled",
  SILENCE: "nothing more can happen",
  REPORTED: "the server reports the end",
  CONTINUED: "the run continues in another process",
};

// sign and color: for badges; sentence: what it means; good: whether the plan did what it should.
export const ENDS = {
  COMPLETED: { sign: "✓", kind: "good", sentence: "the plan completes" },
  GAVE_UP: { sign: "✗", kind: "bad", sentence: "the plan gives up" },
  STUCK: { sign: "∞", kind: "bad", sentence: "the plan is stuck: it waits for ever" },
  HANG: { sign: "∞", kind: "bad", sentence: "the engine waits for ever" },
  ENDLESS: { sign: "↻", kind: "bad", sentence: "this repeats for ever" },
  ABORT: { sign: "✗", kind: "bad", sentence: "the engine crashes" },
  CANCELLED: { sign: "■", kind: "neutral", sentence: "the run is cancelled" },
  REFUSED: { sign: "■", kind: "bad", sentence: "the plan is refused" },
};

const VERBS_OF_CHOICES = { SUCCEEDED: "holds", FAILED: "does not hold" };

// Whether it is a behaviour tree, whose elements have paths from its root on.
export function isTree(plan) {
  return plan.elements.length > 0 && plan.elements[0].path.startsWith("/root");
}

// How a run ends, of a tree and of a machine in their own words.
export function endSentence(plan, status) {
  const { sentence } = ENDS[status];
  if (isTree(plan)) return sentence.replace("the plan gives up", "the tree fails").replace("the plan", "the tree");
  return plan.elements[0]?.path === "/machine" ? sentence.replace("the plan", "the machine") : sentence;
}

// "line 4", or "line 1:88" where elements share a line
export function lineWords(plan, { line, column }) {
  return column > 0 && planIndex(plan).isShared(line) ? `line ${line}:${column}` : `line ${line}`;
}

// "SpeechRunner (text=Hello.) at line 4"
export function nodeWords(plan, number) {
  const element = plan.elements[plan.automaton?.nodes[number]?.element];
  // In sentences as the findings have it: "line 1 column 88".
  return nodeName(plan, number) + (element ? ` at ${lineWords(plan, element).replace(":", " column ")}` : "");
}

// "SpeechRunner (text=Hello.)"
export function nodeName(plan, number) {
  const node = plan.automaton && plan.automaton.nodes[number];
  if (!node) return "";
  const element = plan.elements[node.element];
  if (!element) return node.label.join(" ");
  const name = element.name ? ` “${visibleText(element.name)}”` : "";
  if (node.kind === "join") return `${element.label}${name}`;
  const detail = element.detail ? ` (${clipText(visibleText(element.detail), 60)})` : "";
  return `${visibleText(element.label)}${name || detail}`;
}

function isChoice(plan, number) {
  const node = plan.automaton && plan.automaton.nodes[number];
  return Boolean(node) && plan.elements[node.element].type === "choice";
}

// A join of the paper's automaton is the success or the failure of its control; those of engines
// are only joins.
function joinSentence(plan, number, count) {
  const { failing = [], nodes } = plan.automaton;
  const control = nodeWords(plan, number);
  if (plan.engine !== "paper") return `a join of ${control} fires`;
  if (!failing.includes(number)) return `${control} succeeds`;
  return nodes[number].need > 1 ? `${control} fails: all ${count} have failed` : `${control} fails`;
}

// What has just happened; count is that of a join.
export function recordSentence(plan, record, count = 0) {
  const { kind, node = -1, message = "", data } = record;
  const why = message ? `: ${clipText(visibleText(message), 200)}` : "";
  if (kind === "ENDED") {
    const status = data && data.status;
    return ENDS[status] ? endSentence(plan, status) : "the run ends";
  }
  if (kind === "JOINED") return joinSentence(plan, node, count);
  if (VERBS_OF_CHOICES[kind] && isChoice(plan, node)) return `${nodeWords(plan, node)} ${VERBS_OF_CHOICES[kind]}`;
  if (VERBS[kind] && node >= 0) return `${nodeWords(plan, node)} ${VERBS[kind]}${why}`;
  if (OF_RUNS[kind]) return OF_RUNS[kind] + why;
  return message ? clipText(visibleText(message), 200) : kind.toLowerCase();
}

// "sometimes", or "may" where only an over-approximation does it, "sometimes or always"
export function frequency(facts, name) {
  return { may: "may", can: "sometimes or always" }[facts.precision?.[name]] || facts[name] || "";
}
