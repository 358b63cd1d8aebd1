// Reads automata from standard input, and writes the pictures that the page makes of them: one with
// everything unfolded, one with everything folded, one per list of groups to fold, and the layered one.
//
// Called with the folder of the page's modules.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const load = (name) => import(pathToFileURL(`${folder}/${name}`));
const { makePicture } = await load("picture.js");

const cases = JSON.parse(readFileSync(0, "utf8"));
const made = cases.map(({ automaton, folds }) => {
  const everything = automaton.groups.map((group, number) => number);
  const pictures = [[], everything, ...folds].map((fold) => makePicture(automaton, new Set(fold), "structure"));
  return [...pictures, makePicture(automaton, new Set(), "layered")];
});
process.stdout.write(JSON.stringify(made));
