// Draws a world: walls, places, people and the robot at one time of a run, and what is said.
//
// What never moves is drawn when the world or the size of the pane changes; the rest is drawn for a
// time. North is up, lengths are to scale, texts have one size whatever the scale.

import { clipText, el, replaceContent, svg, visibleText } from "./dom.js";
import { lineWords } from "./words.js";

/** @import { createScene } from "./scene.js" */

const MAP_MARGIN = 14;
const LETTER_WIDTH = 6.5; // the width of one in a label
const BUBBLE_LETTERS = 30;
const BUBBLE_LINES = 3;
const MOST_GRID_LINES = 60;
const NUMBERED_GOALS = 30;
const NO_WORLD = "No map: no world is simulated, and no robot reports its position.";
const NO_PLACE = "The robot has not reported its position yet.";

// Breaks a text into at most `most` lines of `width` letters.
export function wrapped(text, width, most) {
  const lines = [];
  let line = "";
  for (const word of text.split(/\s+/)) {
    const longer = line ? `${line} ${word}` : word;
    if (longer.length <= width || !line) {
      line = clipText(longer, width);
    } else {
      lines.push(line);
      line = clipText(word, width);
    }
    if (lines.length === most) break;
  }
  if (lines.length < most && line) lines.push(line);
  else if (lines.length === most && line) lines[most - 1] = clipText(`${lines[most - 1]} …`, width + 2);
  return lines;
}

// How metres become pixels in a pane of this size.
function scaleFor(area, width, height) {
  const [x0, y0, x1, y1] = area;
  const across = Math.max(x1 - x0, 0.1);
  const up = Math.max(y1 - y0, 0.1);
  const scale = Math.max(1, Math.min((width - 2 * MAP_MARGIN) / across, (height - 2 * MAP_MARGIN) / up));
  const left = (width - across * scale) / 2;
  const top = (height - up * scale) / 2;
  return {
    scale,
    x: (x) => left + (x - x0) * scale,
    y: (y) => top + (y1 - y) * scale,
  };
}

function boxOf(view, area, attributes, ...children) {
  const [x0, y0, x1, y1] = area;
  const place = { x: view.x(x0), y: view.y(y1) };
  const size = { width: (x1 - x0) * view.scale, height: (y1 - y0) * view.scale };
  return svg("rect", { ...place, ...size, ...attributes }, ...children);
}

function pathOf(view, points) {
  return points.map(([x, y], i) => `${i ? "L" : "M"}${view.x(x).toFixed(1)} ${view.y(y).toFixed(1)}`).join("");
}

// Finds free room for labels: the first side of a mark where its label covers no other, and none of
// the signs at `points`; it crosses the walls of the world only if there is no other room.
function labelPlacer(width, height, points, inner) {
  const taken = points.map(([x, y]) => ({ x: x - 6, y: y - 8, width: 12, height: 14 }));
  const free = (box) =>
    box.x >= 0 &&
    box.y >= 0 &&
    box.x + box.width <= width &&
    box.y + box.height <= height &&
    !taken.some(
      (other) =>
        box.x < other.x + other.width &&
        other.x < box.x + box.width &&
        box.y < other.y + other.height &&
        other.y < box.y + box.height,
    );
  const place = (x, y, text, gap) => {
    const wide = text.length * LETTER_WIDTH + 4;
    const sides = [
      { x: x + gap, y: y - 7 },
      { x: x - gap - wide, y: y - 7 },
      { x: x - wide / 2, y: y - gap - 14 },
      { x: x - wide / 2, y: y + gap },
    ];
    const boxes = sides.map((side) => ({ ...side, width: wide, height: 14 })).filter(free);
    const box = boxes.find((each) => each.x >= inner.left && each.x + wide <= inner.right) || boxes[0];
    if (!box) return null;
    taken.push(box);
    return { x: box.x + 2, y: box.y + 11 };
  };
  return { place, free };
}

function label(place, text, kind) {
  return place ? svg("text", { class: `map-label ${kind}`, x: place.x, y: place.y }, text) : null;
}

function gridLines(view, area) {
  const [x0, y0, x1, y1] = area;
  let step = 1;
  while (Math.max(x1 - x0, y1 - y0) / step > MOST_GRID_LINES) step *= 5;
  const parts = [];
  for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
    parts.push(`M${view.x(x).toFixed(1)} ${view.y(y0).toFixed(1)}V${view.y(y1).toFixed(1)}`);
  }
  for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
    parts.push(`M${view.x(x0).toFixed(1)} ${view.y(y).toFixed(1)}H${view.x(x1).toFixed(1)}`);
  }
  return svg("path", { class: "map-grid", d: parts.join("") });
}

function patterns() {
  const hatch = (id, kind) =>
    svg(
      "pattern",
      { id, width: 7, height: 7, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
      svg("rect", { class: `${kind} ground`, width: 7, height: 7 }),
      svg("line", { class: `${kind} stroke`, y2: 7, "stroke-width": 4 }),
    );
  return svg("defs", {}, hatch("map-shut", "map-shut"), hatch("map-low", "map-low"), svg("clipPath", { id: "map-clip" }));
}

// Goals are {x, y, text, element}: where runners of the plan drive to. onElement(element) is called when
// one is clicked.
/** @param {HTMLElement} container @param {{onElement?: (element: number) => void}} hooks */
export function createMap(container, { onElement = () => {} } = {}) {
  const still = svg("g", {});
  const moving = svg("g", {});
  const above = svg("g", {});
  const picture = svg("svg", { class: "map-picture", role: "img", "aria-label": "Map" }, patterns(), still, moving, above);
  const empty = el("p", { class: "map-empty" });
  container.append(picture, empty);
  /**
   * @type {{scene: ReturnType<typeof createScene> | null, at: number,
   *   view: ReturnType<typeof scaleFor>, size: [number, number], named: any[], goals: any[], area: number[] | null,
   *   zoneLabels: ({x: number, y: number} | null)[], isFree: ReturnType<typeof labelPlacer>["free"]}}   size 0: nothing is laid out yet
   */
  const shared = { scene: null, at: 0, view: scaleFor([0, 0, 1, 1], 0, 0), size: [0, 0], named: [], goals: [], area: null, zoneLabels: [], isFree: () => true };

  function layOut() {
    const { scene } = shared;
    shared.area = scene ? scene.world.area : null;
    picture.classList.toggle("hidden", !shared.area);
    empty.classList.toggle("hidden", Boolean(shared.area));
    empty.textContent = scene ? NO_PLACE : NO_WORLD;
    if (!scene || !shared.area) return;
    const [x0, y0, x1, y1] = shared.area;
    shared.goals = shared.named.filter(({ x, y }) => x >= x0 && x <= x1 && y >= y0 && y <= y1);
    const { width, height } = container.getBoundingClientRect();
    if (width < 20 || height < 20) return;
    picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    picture.setAttribute("width", width);
    picture.setAttribute("height", height);
    shared.view = scaleFor(scene.world.area, width, height);
    shared.size = [width, height];
    drawStill(scene.world);
    drawMoving();
  }

  function drawStill(world) {
    const { view } = shared;
    const standing = world.people.flatMap((each) => each.stays);
    const signs = [...world.places, ...world.things, ...shared.goals, ...standing];
    const inner = { left: view.x(world.area[0]), right: view.x(world.area[2]) };
    const { place, free } = labelPlacer(...shared.size, signs.map((each) => [view.x(each.x), view.y(each.y)]), inner);
    shared.isFree = free;
    shared.zoneLabels = [];
    const zones = world.zones.map((zone) => {
      const [x0, y0, x1, y1] = zone.box;
      shared.zoneLabels.push(place(view.x((x0 + x1) / 2), view.y((y0 + y1) / 2), `${zone.name}: closed`, 8));
      return boxOf(view, zone.box, { class: "map-zone" }, svg("title", {}, `${zone.name} (open)`));
    });
    const places = world.places.map((each) => {
      const [x, y] = [view.x(each.x), view.y(each.y)];
      const mark = svg("path", { class: "map-place", d: `M${x} ${y}l-4.5 -9a5 5 0 1 1 9 0z` }, svg("title", {}, each.name));
      return [mark, label(place(x, y - 6, each.name, 8), each.name, "place")];
    });
    const objects = world.things.map((each) => {
      const [x, y] = [view.x(each.x), view.y(each.y)];
      const mark = svg("path", { class: "map-object", d: `M${x} ${y - 5}l5 5l-5 5l-5 -5z` }, svg("title", {}, each.name));
      return [mark, label(place(x, y, each.name, 8), each.name, "object")];
    });
    replaceContent(picture.querySelector("#map-clip"), boxOf(view, world.area, {}));
    replaceContent(
      still,
      boxOf(view, world.area, { class: "map-ground" }),
      gridLines(view, world.area),
      world.obstacles.filter((each) => each.from_us === undefined && each.until_us === undefined).map(obstacle),
      zones,
      places,
      objects,
      shared.goals.map(goal),
    );
  }

  function goal(each, number) {
    const [x, y] = [shared.view.x(each.x), shared.view.y(each.y)];
    const few = shared.goals.length <= NUMBERED_GOALS;
    return svg(
      "g",
      { class: "map-goal", dataset: { element: each.element }, onclick: () => onElement(each.element) },
      svg("title", {}, `goal ${number + 1}: ${visibleText(each.text)}`),
      svg("circle", { cx: x, cy: y, r: few ? 8 : 3 }),
      few ? svg("text", { x, y: y + 3.5, "text-anchor": "middle" }, number + 1) : null,
    );
  }

  function obstacle(each) {
    const kind = each.low ? "map-obstacle low" : each.name ? "map-obstacle" : "map-obstacle wall";
    const fill = each.low ? { fill: "url(#map-low)" } : {};
    return boxOf(shared.view, each.box, { class: kind, ...fill }, svg("title", {}, each.name || "obstacle"));
  }

  function drawMoving() {
    const { scene, view, at } = shared;
    if (!scene || !shared.area || !shared.size[0]) return;
    const { world } = scene;
    const shut = scene.closedAt(at);
    const passing = world.obstacles.filter((each) => each.from_us !== undefined || each.until_us !== undefined);
    const pose = scene.poseAt(at);
    const people = scene.peopleAt(at);
    const ahead = scene.aheadAt(at);
    replaceContent(
      moving,
      scene.thereAt(passing, at).map(obstacle),
      world.zones.filter((_, number) => shut.has(number)).flatMap((zone) => closedZone(zone, world.zones.indexOf(zone))),
      svg("path", { class: "map-trail", d: pathOf(view, scene.trailAt(at)) }),
      ahead.length ? svg("path", { class: "map-ahead", d: pathOf(view, ahead) }) : null,
      pose && world.robot.sees_within ? cone(world.robot, pose) : null,
      people.map(person),
      pose ? robot(world.robot, pose) : null,
    );
    replaceContent(above, scene.spokenAt(at).map(bubble));
    const there = people.map((each) => each.name).join(", ");
    const closed = [...shut].map((number) => world.zones[number].name).join(", ");
    const where = pose ? `the robot is at x ${pose.x.toFixed(1)}, y ${pose.y.toFixed(1)}` : "the position of the robot is unknown";
    picture.setAttribute(
      "aria-label",
      `Map of ${world.title}: ${where}${there ? `; people: ${there}` : ""}${closed ? `; closed: ${closed}` : ""}`,
    );
    picture.dataset.pose = pose ? `${pose.x.toFixed(2)} ${pose.y.toFixed(2)}` : "";
  }

  function closedZone(zone, number) {
    const words = `${zone.name}: closed`;
    const box = boxOf(shared.view, zone.box, { class: "map-zone shut", fill: "url(#map-shut)" }, svg("title", {}, words));
    return [box, label(shared.zoneLabels[number], words, "shut")];
  }

  function cone({ sees_within: reach, view: angle }, pose) {
    const { view } = shared;
    const radius = reach * view.scale;
    const point = (turn) => {
      const x = view.x(pose.x) + radius * Math.cos(pose.yaw + turn);
      const y = view.y(pose.y) - radius * Math.sin(pose.yaw + turn);
      return `${x.toFixed(1)} ${y.toFixed(1)}`;
    };
    const start = `${view.x(pose.x).toFixed(1)} ${view.y(pose.y).toFixed(1)}`;
    const large = angle > Math.PI ? 1 : 0;
    const d = `M${start}L${point(-angle / 2)}A${radius} ${radius} 0 ${large} 0 ${point(angle / 2)}Z`;
    return svg("path", { class: "map-cone", d, "clip-path": "url(#map-clip)" });
  }

  function person(each) {
    const [x, y] = [shared.view.x(each.x), shared.view.y(each.y)];
    const body = `M${x - 7} ${y + 8}a7 7 0 0 1 14 0z`;
    const words = visibleText(each.name);
    const wide = words.length * LETTER_WIDTH + 4;
    const sides = [[x - wide / 2, y + 9], [x + 9, y - 7], [x - 9 - wide, y - 7], [x - wide / 2, y - 23]];
    const [left, top] = sides.find(([x, y]) => shared.isFree({ x, y, width: wide, height: 14 })) || sides[0];
    return svg(
      "g",
      { class: "map-person" },
      svg("title", {}, `${each.name}, ${each.looks}`),
      svg("path", { d: body }),
      svg("circle", { cx: x, cy: y - 4, r: 4.5 }),
      svg("text", { class: "map-label person", x: left + 2, y: top + 11 }, words),
    );
  }

  function robot(size, pose) {
    const { view } = shared;
    const radius = Math.max(7, size.radius * view.scale);
    const turn = (-pose.yaw * 180) / Math.PI;
    return svg(
      "g",
      { class: "map-robot", transform: `translate(${view.x(pose.x).toFixed(1)} ${view.y(pose.y).toFixed(1)}) rotate(${turn.toFixed(1)})` },
      svg("title", {}, "the robot"),
      svg("circle", { r: radius }),
      svg("path", { d: `M${radius * 0.75} 0L${-radius * 0.45} ${radius * 0.5}L${-radius * 0.15} 0L${-radius * 0.45} ${-radius * 0.5}Z` }),
    );
  }

  function bubble(spoken) {
    const { view, size } = shared;
    const lines = wrapped(visibleText(spoken.text), BUBBLE_LETTERS, BUBBLE_LINES);
    const wide = Math.max(...lines.map((each) => each.length)) * 6.6 + 16;
    const high = lines.length * 15 + 10;
    const [x, y] = [view.x(spoken.x), view.y(spoken.y) - 14];
    const left = Math.min(Math.max(4, x - wide / 2), Math.max(4, size[0] - wide - 4));
    const above = y - high - 8 > 2;
    const top = above ? y - high - 8 : y + 30;
    const tip = above ? `M${x - 5} ${top + high - 1}l5 8l5 -8z` : `M${x - 5} ${top + 1}l5 -8l5 8z`;
    return svg(
      "g",
      { class: `map-bubble ${spoken.kind}` },
      svg("rect", { x: left, y: top, width: wide, height: high, rx: 7 }),
      svg("path", { d: tip }),
      lines.map((each, i) => svg("text", { x: left + 8, y: top + 17 + i * 15 }, each)),
    );
  }

  new ResizeObserver(layOut).observe(container);
  layOut();

  return {
    setScene(scene) {
      shared.scene = scene;
      layOut();
    },
    setGoals(goals) {
      shared.named = goals;
      layOut();
    },
    // Draws the world as it is at a time of the run, in microseconds.
    setTime(at) {
      shared.at = at;
      if (shared.scene && shared.scene.world.area !== shared.area) layOut(); // it has grown
      else drawMoving();
    },
  };
}

// -- the maps of the worlds that a run can begin in; each is requested once ----------------------

// worldMaps(client, service, trouble) -> {geometry}: a map, or null where there is none
export function worldMaps(client, service, trouble) {
  const geometries = new Map();
  return {
    async geometry(name) {
      const world = service.worlds.find((each) => each.world === name);
      if (!world || !world.simulated) return null;
      if (!geometries.has(name)) {
        try {
          geometries.set(name, await client.get(`/v1/worlds/${encodeURIComponent(name)}`));
        } catch (error) {
          trouble(`The map of ${name} cannot be shown: ${error.message}.`);
          return null;
        }
      }
      return geometries.get(name);
    },
  };
}

// -- the places that a plan sends the robot to, as far as they stand in it as numbers ------------

const NUMBER = "(-?\\d+(?:\\.\\d+)?(?:[eE][-+]?\\d+)?)";
const X = new RegExp(`\\bx=${NUMBER}`);
const Y = new RegExp(`\\by=${NUMBER}`);
const MOST = 200;

// Goals {x, y, text, element} in the order of the plan, a place that is named twice once.
export function goalsOf(plan) {
  if (!plan) return [];
  const goals = new Map();
  plan.elements.forEach((each, element) => {
    if (each.kind !== "runner" || goals.size >= MOST) return;
    const [x, y] = [X.exec(each.detail), Y.exec(each.detail)];
    if (!x || !y) return;
    const place = `${Number(x[1])} ${Number(y[1])}`;
    if (!goals.has(place)) {
      goals.set(place, { x: Number(x[1]), y: Number(y[1]), text: `${each.label}, ${lineWords(plan, each)}`, element });
    }
  });
  return [...goals.values()];
}
