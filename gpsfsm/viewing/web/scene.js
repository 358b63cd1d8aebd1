// What a world looks like at any time of a run: a function of the world and of what has happened.
//
// Nothing here draws or knows the clock. A scene takes the motions, words and changes of a run in
// the order of their times, while it goes on or all at once, and answers for every instant; so a run
// that is scrubbed to and fro shows what it showed while it went on.

const LONGEST_TRAIL = 300; // legs
const LINGER_US = 1.5e6; // how long words can be read after they have been said
const ENDS_OF_SPEECH = new Set(["SUCCEEDED", "FAILED", "STOPPED", "TIMEOUT"]);

// The place and heading of the robot after `part` metres along a leg.
function alongLeg(leg, part) {
  const { points, along } = leg;
  if (points.length === 1) {
    return { x: points[0][0], y: points[0][1], yaw: leg.yaw };
  }
  let corner = 1;
  while (corner < points.length - 1 && along[corner] < part) {
    corner += 1;
  }
  const [ax, ay] = points[corner - 1];
  const [bx, by] = points[corner];
  const length = along[corner] - along[corner - 1];
  const share = length > 0 ? Math.min(1, Math.max(0, (part - along[corner - 1]) / length)) : 1;
  const yaw = length > 0 ? Math.atan2(by - ay, bx - ax) : leg.yaw;
  return { x: ax + (bx - ax) * share, y: ay + (by - ay) * share, yaw };
}

function lengthsOf(points) {
  const along = [0];
  for (let i = 1; i < points.length; i += 1) {
    const [ax, ay] = points[i - 1];
    const [bx, by] = points[i];
    along.push(along[i - 1] + Math.hypot(bx - ax, by - ay));
  }
  return along;
}

// The last of `list` whose `at_us` is not after `at`; -1 if there is none.
export function lastUntil(list, at) {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle].at_us <= at) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low - 1;
}

// A leg that is driven, or a place where the robot stays: where it is at a time.
function poseOn(leg, at) {
  const whole = leg.along[leg.along.length - 1];
  const duration = leg.until_us - leg.at_us;
  if (duration <= 0 || whole <= 0) {
    return alongLeg(leg, whole);
  }
  return alongLeg(leg, (whole * (at - leg.at_us)) / duration);
}

function holds(window, at) {
  return at >= (window.from_us ?? -Infinity) && at < (window.until_us ?? Infinity);
}

// Where a sound comes from, if it comes from somewhere.
function placed(sound) {
  return sound.x === null || sound.x === undefined ? {} : { x: sound.x, y: sound.y };
}

const MARGIN = 1; // metres around all places where the robot has been
const STEP = 2;
const FARTHEST = 1e5;

// The world of a run that says where the robot is and nothing else: its map grows with the places.
export function openWorld() {
  const robot = { x: 0, y: 0, yaw: 0, radius: 0.25, sees_within: 0, view: 0 };
  const nothing = { obstacles: [], zones: [], changes: [], places: [], people: [], things: [], sounds: [] };
  return { world: "real", title: "where it says it is", area: null, resolution: 0.05, robot, ...nothing };
}

function isPlace({ x, y, yaw }) {
  const near = (value) => Number.isFinite(value) && Math.abs(value) <= FARTHEST;
  return near(x) && near(y) && Number.isFinite(yaw);
}

// The area that holds a place as well, in whole steps, so that it does not change all the time.
function grown(area, { x, y }) {
  const low = (value) => Math.floor((value - MARGIN) / STEP) * STEP;
  const high = (value) => Math.ceil((value + MARGIN) / STEP) * STEP;
  const [x0, y0, x1, y1] = area || [Infinity, Infinity, -Infinity, -Infinity];
  const wider = [Math.min(x0, low(x)), Math.min(y0, low(y)), Math.max(x1, high(x)), Math.max(y1, high(y))];
  return area && wider.every((each, i) => each === area[i]) ? area : wider;
}

function isSpeech(record) {
  const name = record.interface || "";
  return name.endsWith("SpeechRunner") && !name.includes("Prompt") && typeof record.data?.text === "string";
}

// Windows of time in seconds of the world become microseconds of a run that began at `begun_s`.
function inRun(entries, begun_s) {
  const us = (time) => (time === null || time === undefined ? undefined : (time - begun_s) * 1e6);
  return entries.map((each) => ({
    ...each,
    from_us: each.from_s ? us(each.from_s) : undefined,
    until_us: us(each.until_s),
  }));
}

// `geometry` is what the service tells of a world; `pose` is [x, y, yaw] where the run begins, and
// `closed` holds the numbers of the zones that are closed then; null: as the world has it.
export function createScene(geometry, { begun_s = 0, pose = null, closed = null } = {}) {
  const robot = geometry.robot;
  const world = {
    ...geometry,
    obstacles: inRun(geometry.obstacles, begun_s),
    things: inRun(geometry.things, begun_s),
    people: geometry.people.map((each) => ({ ...each, stays: inRun(each.stays, begun_s) })),
  };
  const [x, y, yaw] = pose || [robot.x, robot.y, robot.yaw];
  const open = geometry.area === null;
  const legs = open ? [] : [{ at_us: -Infinity, until_us: -Infinity, points: [[x, y]], along: [0], yaw }];
  const words = []; // {at_us, until_us, who, text, kind, x, y}
  const turns = []; // {at_us, zone, closed}; zones are numbers
  const spoken = new Map(); // node -> the text that it was given to say
  const speaking = new Map(); // node -> what it is saying, as long as its end is not known

  // Where the robot is at a time; null as long as nobody knows.
  function poseAt(at) {
    const last = lastUntil(legs, at);
    return last < 0 ? null : poseOn(legs[last], at);
  }

  function insert(list, item) {
    const place = lastUntil(list, item.at_us) + 1;
    list.splice(place, 0, item);
  }

  for (const change of geometry.changes) {
    if (change.at_s !== null && change.at_s !== undefined) {
      const at_us = (change.at_s - begun_s) * 1e6;
      if (at_us > 0 || !closed) turn(at_us, change);
    }
  }
  for (const sound of inRun(geometry.sounds, begun_s)) {
    utter(sound.from_us ?? 0, sound.until_us ?? Infinity, sound.text, "sound", placed(sound));
  }

  function turn(at_us, change) {
    insert(turns, { at_us, zone: change.zone, closed: change.closed });
  }

  function utter(at_us, until_us, text, kind, more) {
    const said = { at_us, until_us, text, kind, ...more };
    insert(words, said);
    return said;
  }

  function drive(at_us, points, speed) {
    const along = lengthsOf(points);
    const until_us = at_us + (along[along.length - 1] / speed) * 1e6;
    insert(legs, { at_us, until_us, points, along, yaw: poseAt(at_us)?.yaw ?? 0 });
  }

  // What a record says about the world; most say nothing.
  function seen(at_us, data, node) {
    const here = { x: data.x, y: data.y };
    if (data.world === "drive") {
      drive(at_us, data.way, data.speed);
    } else if (data.world === "pose" && (!open || isPlace(data))) {
      if (open) world.area = grown(world.area, data);
      insert(legs, { at_us, until_us: at_us, points: [[data.x, data.y]], along: [0], yaw: data.yaw });
    } else if (data.world === "say") {
      silence(node);
      const start = Math.max(0, at_us - data.seconds * 1e6);
      utter(start, at_us + LINGER_US, data.text, "say", { who: "robot", ...here });
    } else if (data.world === "reply") {
      const start = at_us + data.after_s * 1e6;
      utter(start, start + data.seconds * 1e6 + LINGER_US, data.text, "reply", { who: data.who, ...here });
    } else if (data.world === "hear") {
      utter(at_us, at_us, data.text, "hear", { who: "robot" });
    } else if (data.world === "arrive") {
      for (const change of geometry.changes) {
        if (change.after_arrivals === data.count) turn(at_us, change);
      }
    }
  }

  function silence(node) {
    const said = speaking.get(node);
    if (said) {
      words.splice(words.indexOf(said), 1);
      speaking.delete(node);
    }
  }

  // Until the end of a speech is known, it is taken to go on from its start.
  function speech(record) {
    const { kind, node, at_us } = record;
    if (kind === "STARTED" && spoken.has(node)) {
      const { x, y } = poseAt(at_us) || {};
      speaking.set(node, utter(at_us, Infinity, spoken.get(node), "say", { who: "robot", x, y }));
    } else if (kind === "TRIGGERED" && isSpeech(record)) {
      spoken.set(node, record.data.text);
    } else if (ENDS_OF_SPEECH.has(kind)) {
      silence(node);
    }
  }

  return {
    world,
    words,
    take(record) {
      if (record.kind === "LOG") {
        if (record.data && record.data.world) seen(record.at_us, record.data, record.node);
      } else {
        speech(record);
      }
    },
    poseAt,
    // The leg that is being driven at a time, from where the robot is to where it leads.
    aheadAt(at) {
      const leg = legs[lastUntil(legs, at)];
      if (!leg || at >= leg.until_us || leg.points.length < 2) {
        return [];
      }
      return [...partOf(leg, at, true)];
    },
    // All places where the robot has been, in order.
    trailAt(at) {
      const last = lastUntil(legs, at);
      const trail = [];
      for (let i = Math.max(0, last - LONGEST_TRAIL); i <= last; i += 1) {
        const end = i < last ? Math.min(legs[i + 1].at_us, at) : at;
        trail.push(...partOf(legs[i], end, false));
      }
      return trail;
    },
    closedAt(at) {
      const shut = new Set(closed || world.zones.flatMap((zone, number) => (zone.closed ? [number] : [])));
      for (const each of turns) {
        if (each.at_us > at) break;
        if (each.closed) shut.add(each.zone);
        else shut.delete(each.zone);
      }
      return shut;
    },
    peopleAt(at) {
      const people = [];
      for (const person of world.people) {
        const stay = person.stays.find((each) => holds(each, at));
        if (stay) {
          people.push({ name: person.name, looks: person.looks, x: stay.x, y: stay.y });
        }
      }
      return people;
    },
    thereAt: (entries, at) => entries.filter((each) => holds(each, at)),
    spokenAt(at) {
      const last = lastUntil(words, at);
      const shown = [];
      for (let i = Math.max(0, last - 20); i <= last; i += 1) {
        if (words[i].until_us > at && words[i].x !== undefined) {
          shown.push(words[i]);
        }
      }
      return shown;
    },
    wordsUntil: (at) => words.slice(0, lastUntil(words, at) + 1),
  };
}

// The points of a leg that are behind the robot at a time, or ahead of it; with where it is.
function partOf(leg, at, ahead) {
  const here = poseOn(leg, at);
  const whole = leg.along[leg.along.length - 1];
  const duration = leg.until_us - leg.at_us;
  const gone = duration > 0 ? Math.min(1, Math.max(0, (at - leg.at_us) / duration)) * whole : whole;
  if (ahead) {
    return [[here.x, here.y], ...leg.points.filter((_, i) => leg.along[i] > gone)];
  }
  return [...leg.points.filter((_, i) => leg.along[i] < gone), [here.x, here.y]];
}
