// The legend of a picture: each mark that the picture uses, drawn by what draws the picture, and what
// it means. What the plan does not have is left out; the marks of runs and of pointing are always there.

import { el, replaceContent } from "./dom.js";
import { graphColors, paintEdges, paintItem, paintCaption, paintFinding, paintGroup, paintNear, paintRing, paintSelected, paintState } from "./paint.js";
import { STATES } from "./words.js";

const SAMPLE = { width: 60, height: 32, dots: 2 };
const SAMPLE_VIEW = { zoom: 1, left: -1e3, right: 1e3, top: -1e3, bottom: 1e3, pan: { x: 0, y: 0 }, far: false };

const EDGE_WORDS = {
  "SUCCEEDED solid": "succeeded: what follows is triggered",
  "FAILED dashed": "failed: what handles it is triggered",
  "FAILED solid": "a control has failed, as its join says",
  "STARTED dotted": "started",
  "STOPPED dotted": "stopped",
  "STOPS broken": "stops what it leads to",
};
const END_WORDS = { start: "the plan begins", complete: "the plan completes", give_up: "the plan gives up" };
const RUN_STATES = ["triggered", "running", "succeeded", "failed", "timeout", "stopped", "never"];
const SEVERITY_WORDS = { error: "a finding: error", warning: "a finding: warning", info: "a finding: info" };

const box = { x: 14, y: 8, width: 32, height: 15 };
const marked = { x: 24, y: 16, width: 32, height: 13 }; // the state is a sign at its corner
const item = (kind, more = {}) => ({ kind, box, lines: [], inside: [], node: 0, element: -1, group: -1, parent: -1, fails: false, ...more });
const round = { x: 28, y: 4, width: 24, height: 24 };
const join = (line, more = {}) => item("join", { box: round, lines: [line], need: 2, ...more });
const edge = (kind, line, more = {}) => ({
  kind, line, event: kind, source: 0, target: 0, route: [[4, 15], [56, 15]], merged: false, open: false, ...more,
});

const drawItem = (shown) => (context, colors) => paintItem(context, shown, SAMPLE_VIEW, colors, null);
const drawEdge = (shown, width = 1.5) => (context, colors) => paintEdges(context, [shown], SAMPLE_VIEW, colors, width);
const drawState = (shown, state, count = 0) => (context, colors) => paintState(context, shown, SAMPLE_VIEW, colors, { state, count });
const group = (part) => ({ box: { x: 6, y: 2, width: 48, height: 26 }, depth: 0, label: "", part });

// [key, words, draw(context, colors)] per mark of a picture, in the order of the legend.
/** @returns {[string, string, (context: any, colors: any) => void][]} */
export function legendOf(picture) {
  const { items, edges, groups } = picture;
  const kinds = new Set(items.map((one) => one.kind));
  const joins = new Set(items.filter((one) => one.kind === "join").map(joinKind));
  const lines = new Set(edges.filter((one) => one.route.length).map((one) => `${one.kind} ${one.line}`));
  const isBare = edges.some((one) => !one.route.length);
  const marks = [];
  const put = (has, key, words, draw) => has && marks.push([key, words, draw]);
  for (const [key, words] of Object.entries(EDGE_WORDS)) {
    const [kind, line] = key.split(" ");
    put(lines.has(key), `edge ${key}`, words, drawEdge(edge(kind, line)));
  }
  put(isBare, "edge bare", "stops what it leads to; drawn for what is selected", drawEdge(edge("STOPS", "broken")));
  for (const open of edges.filter((one) => one.open && one.route.length)) {
    const key = `open ${open.kind} ${open.line}`;
    if (marks.some(([name]) => name === key)) continue;
    put(true, key, `${open.kind === "FAILED" ? "failed" : "succeeded"}, and leads nowhere`,
      drawEdge(edge(open.kind, open.line, { open: true, route: [[4, 15], [50, 15]] })));
  }
  put(edges.some((one) => one.merged), "meeting", "lines to the same place meet", drawEdge(edge("SUCCEEDED", "solid", { merged: true, route: [[4, 15], [32, 15]] })));
  put(kinds.has("runner"), "runner", "a runner", drawItem(item("runner")));
  put(items.some((one) => one.unreachable), "unreachable", "a runner that no run reaches", drawItem(item("runner", { unreachable: true })));
  put(joins.has("any"), "any", "any: one input is enough", drawItem(join("any")));
  put(joins.has("all"), "all", "all n: waits for each of its n inputs", drawItem(join("all n")));
  put(joins.has("some"), "some", "k of n: waits for k of its n inputs", drawItem(join("k of n")));
  for (const [kind, words] of Object.entries(END_WORDS)) put(kinds.has(kind), kind, words, drawItem(item(kind)));
  const isDeep = groups.some((one) => one.depth % 2);
  put(groups.some((one) => !one.part), "group", "a control; ⊟ folds it", (context, colors) => {
    paintGroup(context, group(false), colors);
    if (isDeep) paintGroup(context, { ...group(false), depth: 1, box: { x: 28, y: 8, width: 20, height: 14 } }, colors);
    paintCaption(context, group(false), colors);
  });
  put(groups.some((one) => one.part), "part", "a part of a long row; ⊟ folds it", (context, colors) => {
    paintGroup(context, group(true), colors);
    paintCaption(context, group(true), colors);
  });
  put(kinds.has("folded"), "folded", "folded: click it to unfold it", drawItem(item("folded")));
  for (const [severity, words] of Object.entries(SEVERITY_WORDS)) {
    put(items.some((one) => one.finding === severity) || groups.some((one) => one.finding === severity), severity, words, (context, colors) =>
      paintFinding(context, item("runner", { box: { ...box, x: 8, y: 15 } }), SAMPLE_VIEW, colors, severity));
  }
  return marks;
}

function joinKind(one) {
  if (one.need === 1) return "any";
  return one.need >= one.inputs ? "all" : "some";
}

// The marks of runs, and of what one points at.
/** @type {[string, string, (context: any, colors: any) => void][]} */
export const RUN_LEGEND = [
  ...RUN_STATES.map((state) => /** @type {[string, string, any]} */ ([state, STATES[state].word, drawState(item("runner", { box: marked }), state)])),
  ["waiting", "a join waits: so many of the inputs it needs have come", drawState(join("", { box: { ...round, x: 32 } }), "waiting", 1)],
  ["fired", "a join has fired", drawState(join(""), "fired")],
  ["collected", "a join of failures has fired: its control has failed", drawState(join("", { fails: true }), "fired")],
  ["completed", "the plan has completed", drawState(item("complete", { box: marked }), "reached")],
  ["gave up", "the plan has given up", drawState(item("give_up", { box: marked }), "reached")],
  ["stuck", "stuck: a join that waits for ever", drawState(join(""), "stuck", 1)],
  ["taken", "bold: this has happened", drawEdge(edge("SUCCEEDED", "solid"), 3.5)],
  ["selected", "brackets: selected", (context, colors) => paintSelected(context, item("runner", { box: { x: 16, y: 12, width: 28, height: 8 } }), SAMPLE_VIEW, colors)],
  ["near", "band: an edge of what is selected or pointed at", (context, colors) => paintNear(context, [edge("SUCCEEDED", "solid")], SAMPLE_VIEW, colors)],
  ["hovered", "pointed at", (context, colors) => paintRing(context, item("runner"), SAMPLE_VIEW, colors)],
];

// graphLegend() -> {element, show(picture), recolor}; it is drawn when it is opened.
export function graphLegend() {
  const body = el("div", { class: "legend-body" });
  const element = el("details", { class: "graph-legend" }, el("summary", {}, "Legend"), body);
  let picture = null;
  let drawn = "";

  function draw() {
    if (!element.open || !picture) return;
    const entries = legendOf(picture);
    const key = entries.map(([name]) => name).join("|");
    if (key === drawn) return;
    drawn = key;
    const colors = graphColors();
    const list = (entries) => el("ul", {}, entries.map(([name, words, paint]) => legendItem(name, words, paint, colors)));
    replaceContent(body, list(entries), el("p", { class: "legend-title" }, "In a run"), list(RUN_LEGEND));
  }

  element.addEventListener("toggle", draw);
  return {
    element,
    show(shown) {
      picture = shown;
      draw();
    },
    recolor() {
      drawn = "";
      draw();
    },
  };
}

function legendItem(name, words, paint, colors) {
  const canvas = el("canvas", { class: "legend-sample", "aria-hidden": "true" });
  canvas.width = SAMPLE.dots * SAMPLE.width;
  canvas.height = SAMPLE.dots * SAMPLE.height;
  const context = canvas.getContext("2d");
  context.scale(SAMPLE.dots, SAMPLE.dots);
  paint(context, colors);
  return el("li", { dataset: { mark: name } }, canvas, words);
}
