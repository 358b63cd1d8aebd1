// What the page's own modules make of a world, and of a stream that comes in pieces.
//
//   node scenes.mjs <folder of the modules> < {geometry, begun_s, records, times, pieces, feedback}
// Per time the place of the robot and the closed zones; the events that the pieces hold; feedback in
// words. Without a geometry it is the world of a run that says where the robot is, and nothing else.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = pathToFileURL(process.argv[2] + "/");
const { createScene, openWorld } = await import(new URL("scene.js", folder));
const { feedbackWords } = await import(new URL("watch.js", folder));
const { eventParser } = await import(new URL("client.js", folder));
const asked = JSON.parse(readFileSync(0, "utf8"));

const scene = createScene(asked.geometry || openWorld(), { begun_s: asked.begun_s });
for (const record of asked.records) scene.take(record);
const seen = asked.times.map((at) => {
  const { x, y, yaw } = scene.poseAt(at) || {};
  const closed = [...scene.closedAt(at)].sort();
  const said = scene.spokenAt(at).map(({ text }) => text);
  const people = scene.peopleAt(at).map(({ name }) => name);
  return { x, y, yaw, closed, said, people };
});

const events = [];
const parser = eventParser((event) => events.push(event));
for (const piece of asked.pieces) parser.feed(piece);

process.stdout.write(JSON.stringify({ seen, events, ended: parser.ended(), area: scene.world.area, trail: scene.trailAt(1e12), words: (asked.feedback || []).map(feedbackWords) }));
