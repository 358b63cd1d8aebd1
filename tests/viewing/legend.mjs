// Paints pictures with a pen that only notes how each mark looks, and does the same with the samples of
// their legends. Reads [{automaton, collapsed, findings, states}]; writes [{picture, legend, run}].
//
// Called with the folder of the page's modules.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const load = (name) => import(pathToFileURL(`${folder}/${name}`));
const { makePicture } = await load("picture.js");
const { paintPicture, paintPointers, paintRun } = await load("paint.js");
const { RUN_LEGEND, legendOf } = await load("legend.js");

const colors = new Proxy({}, { get: (target, name) => target[name] ?? name, has: () => true });

// A pen that notes the lines, the areas and the signs that it draws.
function pen() {
  const looks = new Set();
  const state = { dash: [] };
  const members = {
    setLineDash: (dash) => (state.dash = dash),
    stroke: () => looks.add(`line ${String(state.strokeStyle)} ${state.dash.length > 0} ${state.lineWidth > 2.6}`),
    fill: () => looks.add(`area ${String(state.fillStyle)} ${state.globalAlpha ?? 1}`),
    fillText: (text) => [..."⊟⋯▶✓✗◔■–●"].includes(text) && looks.add(`sign ${text}`),
  };
  const context = new Proxy(state, {
    get: (target, name) => members[name] ?? target[name] ?? (() => {}),
    set: (target, name, value) => ((target[name] = value), true),
  });
  return { context, looks };
}

const view = { zoom: 1, left: -1e6, right: 1e6, top: -1e6, bottom: 1e6, pan: { x: 0, y: 0 }, far: false };

function painted(entries) {
  const { context, looks } = pen();
  for (const [, , draw] of entries) draw(context, colors);
  return [...looks].sort();
}

const made = JSON.parse(readFileSync(0, "utf8")).map(({ automaton, collapsed, findings, states }) => {
  const picture = makePicture(automaton, new Set(collapsed), "structure");
  const marks = new Map();
  findings.forEach((severity, place) => {
    if (!picture.items[place]) return;
    picture.items[place].finding = severity;
    marks.set(place, severity);
  });
  const still = pen();
  paintPicture(still.context, picture, view, colors);
  const pointers = { selected: new Set(), hoveredItems: new Set(), near: new Set(), element: -2, hovered: -2 };
  paintPointers(still.context, picture, view, colors, { ...pointers, findings: marks, groupFindings: new Map() });
  const run = pen();
  const shown = new Map();
  picture.items.forEach((item, place) => {
    const name = { runner: states[place % states.length], join: place % 2 ? "fired" : "waiting" }[item.kind];
    if (name || item.kind === "complete" || item.kind === "give_up") shown.set(place, { state: name || "reached", count: 1 });
  });
  const taken = new Set(picture.edges.filter((edge) => edge.kind === "SUCCEEDED").map((edge) => edge.number));
  paintRun(run.context, picture, view, colors, { states: shown, taken, isShown: true });
  return {
    still: [...still.looks].sort(),
    run: [...run.looks].sort(),
    legend: painted(legendOf(picture)),
    all: painted([...legendOf(picture), ...RUN_LEGEND]),
    keys: legendOf(picture).map(([key]) => key),
  };
});
process.stdout.write(JSON.stringify(made));
