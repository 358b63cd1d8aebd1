// The words and signs of the page: severities, states, events and kinds of elements. Everything
// that has a colour has a sign as well, so that the page can be read without colours.

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
  timeout: { sign: "⧖", word: "timed out", color: "--state-failed" },
  stopped: { sign: "■", word: "stopped", color: "--state-stopped" },
  waiting: { sign: "…", word: "waits for inputs", color: "--state-triggered" },
  fired: { sign: "✓", word: "has fired", color: "--state-succeeded" },
  never: { sign: "–", word: "never ran", color: "--state-never" },
  reached: { sign: "●", word: "reached", color: "--state-reached" },
};

export const EVENTS = {
  SUCCEEDED: { word: "succeeded", color: "--event-succeeded", line: "solid" },
  FAILED: { word: "failed", color: "--event-failed", line: "dashed" },
  STARTED: { word: "started", color: "--event-started", line: "dotted" },
  STOPPED: { word: "stopped", color: "--event-stopped", line: "dotted" },
};

const CONTROL_SIGNS = {
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
