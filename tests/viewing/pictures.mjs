// Reads automata from standard input, and writes the pictures that the page makes of them: one with
// everything unfolded, one with everything folded, and one per list of groups to fold.
//
// Called with the folder of the page's modules.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const load = (name) => import(pathToFileURL(`${folder}/${name}`));
const { makePicture } = await load("picture.js");
const { cellTree } = await load("cells.js");

const asked = JSON.parse(readFileSync(0, "utf8"));
const made = asked.map(({ automaton, folds }) => {
  const { groups } = cellTree(automaton);
  const everything = groups.map((group, number) => number);
  return [[], everything, ...folds].map((fold) => {
    const picture = makePicture(automaton, new Set(fold), "structure");
    return { ...picture, groupCount: groups.length };
  });
});
process.stdout.write(JSON.stringify(made));
