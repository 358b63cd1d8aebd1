// Plays a run with a clock that does not wait, and tells how long it would have waited.
//
//   node play_clock.mjs <folder of the modules> < {automaton, records, other, pace, speed}
// other: the records of a second run, which is then played beside the first.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = pathToFileURL(process.argv[2] + "/");
const { PairPlayer, Player } = await import(new URL("player.js", folder));

const waits = [];
let due = null;
const clock = {
  after(wait, work) {
    waits.push(wait);
    due = work;
    return waits.length;
  },
  cancel() {
    due = null;
  },
};

const { automaton, records, other, pace, speed } = JSON.parse(readFileSync(0, "utf8"));
const first = new Player(automaton, { pace, clock });
first.load(records);
let player = first;
if (other) {
  const second = new Player(automaton, { clock });
  second.load(other);
  player = new PairPlayer(first, second, { clock });
}
player.speed = speed;
const seen = [];
player.subscribe(() => seen.push(player.playing));
player.play();
const positions = [];
while (due) {
  const work = due;
  due = null;
  work();
  positions.push(player.pair ? player.pair.map((one) => one.position) : player.position);
}
const playing = seen[seen.length - 1];
process.stdout.write(JSON.stringify({ waits, positions, playing, atEnd: player.atEnd }));
