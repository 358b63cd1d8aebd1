// Reads [{automaton, records, folded}] and writes the rows of the timeline of each run.
//
// Called with the folder of the page's modules.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const load = (name) => import(pathToFileURL(`${process.argv[2]}/${name}`));
const { RunHistory } = await load("history.js");
const { Lanes, rowsOf } = await load("timeline.js");

const made = JSON.parse(readFileSync(0, "utf8")).map(({ automaton, records, folded }) => {
  const history = new RunHistory(automaton);
  const lanes = new Lanes(history);
  for (const record of records) {
    history.append(record);
    lanes.update(); // as on the live page: what has come is taken in at once
  }
  const whole = new Lanes(history);
  whole.update();
  const rows = (each) => rowsOf(each, new Set(folded));
  if (JSON.stringify(rows(lanes)) !== JSON.stringify(rows(whole))) throw new Error("piece by piece is something else");
  return rows(whole);
});
process.stdout.write(JSON.stringify(made));
