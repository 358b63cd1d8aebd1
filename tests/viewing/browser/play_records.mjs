// Plays the runs on standard input with the page's own modules and writes the states that it shows.
//
//   node play_records.mjs <folder of the modules> < [{automaton, records, story_at, seeks}, …]
// Per run: the states after each record, forwards, then backwards, then at each of `seeks`; the
// places where a step stops, forwards and backwards; and at each place which sentences of the story
// happen in the step that ends there, and which have happened.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = pathToFileURL(process.argv[2] + "/");
const { Player } = await import(new URL("player.js", folder));

function shown(player) {
  const states = [...player.states].map(([node, { state, count }]) => [node, state, count]);
  const taken = [...player.taken];
  const byNumber = (one, other) => one - other;
  return { states: states.sort((one, other) => one[0] - other[0]), taken: taken.sort(byNumber) };
}

function walk(player, positions) {
  return positions.map((position) => {
    player.seek(position);
    return shown(player);
  });
}

function stops(player, move, isDone) {
  const positions = [];
  while (!isDone()) {
    move();
    positions.push(player.position);
    if (positions.length > 2 * player.length + 2) throw new Error("steps lead nowhere");
  }
  return positions;
}

function playOne({ automaton, records, story_at, story_from, seeks }) {
  const player = new Player(automaton);
  player.load(records, { story_at, story_from });
  const all = [...records.keys(), records.length];
  const forwards = walk(player, all);
  const story = all.map((position) => {
    player.seek(position);
    return player.story;
  });
  const backwards = walk(player, [...all].reverse()).reverse();
  const sought = walk(player, seeks);
  player.toStart();
  const steps = stops(player, () => player.step(), () => player.atEnd);
  const stepsBack = stops(player, () => player.back(), () => player.position === 0);
  const live = new Player(automaton);
  live.follow();
  const followed = records.map((record) => {
    live.append(record);
    return shown(live);
  });
  return { forwards, backwards, sought, steps, stepsBack, story, followed, ended: player.history.ended };
}

const runs = JSON.parse(readFileSync(0, "utf8"));
process.stdout.write(JSON.stringify(runs.map(playOne)));
