// A run that can be stepped, played and scrubbed, forwards and backwards.
//
// A play in a report, a run that goes on now and a past one deliver the same records, so all of
// them are played by this module. It knows nothing of the page.
//
//   const player = new Player(plan.automaton);
//   player.load(play.records, play)              or, for a run that goes on: player.append(record)
//   player.position      how many records are applied: 0 … player.length
//   player.states        Map(node -> {state, count}); a node that is not in it is idle
//   player.taken         Set(index of an edge): its source has emitted its event
//   player.follow()      from now on, show each record as it is appended
//   player.seek(n), player.seekTime(us)          n records; all that happens until a time
// and step, back, play, pause, … of Playback. A step is a place where something new can be seen.
// States: see words.js and history.js.

import { IDLE, RunHistory, countUpTo } from "./history.js";

// Stepping and playing, whatever it is that is played.
//
// Subclasses say at which step of how many it stands (`progress`), whether that is the last one
// (`atEnd`), go to a step (`seekStep`, which calls moved()), and know the milliseconds until the next.

const SHORTEST_STEP_MS = 16;

function browserClock() {
  return { after: (wait, work) => setTimeout(work, wait), cancel: (timer) => clearTimeout(timer) };
}

export class Playback {
  constructor(clock = browserClock()) {
    this._clock = clock;
    this._subscribers = new Set();
    this._timer = null;
    this._speed = 1;
    this.playing = false;
  }

  /** @returns {{number: number, of: number}} */
  get progress() {
    throw new Error("a subclass knows it");
  }

  /** @returns {boolean} */
  get atEnd() {
    throw new Error("a subclass knows it");
  }

  /** @param {number} _number */
  seekStep(_number) {
    throw new Error("a subclass knows it");
  }

  /** @returns {number} */
  stepDelay() {
    throw new Error("a subclass knows it");
  }

  get speed() {
    return this._speed;
  }

  set speed(factor) {
    this._speed = Number.isFinite(factor) && factor > 0 ? factor : 1;
    if (this.playing) this._plan();
    this.tell();
  }

  step() {
    this.pause();
    this.seekStep(this.progress.number + 1);
  }

  back() {
    this.pause();
    this.seekStep(this.progress.number - 1);
  }

  toStart() {
    this.pause();
    this.seekStep(0);
  }

  toEnd() {
    this.pause();
    this.seekStep(this.progress.of);
  }

  // From the start again, if it stands at the end.
  play() {
    if (this.playing || !this.progress.of) return;
    if (this.atEnd) this.seekStep(0);
    this.playing = true;
    this._plan();
    this.tell();
  }

  pause() {
    if (!this.playing) return;
    this.stopTimer();
    this.tell();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  // fn(this) after every move; returns what ends that.
  subscribe(fn) {
    this._subscribers.add(fn);
    return () => this._subscribers.delete(fn);
  }

  destroy() {
    this.stopTimer();
    this._subscribers.clear();
  }

  tell() {
    for (const fn of [...this._subscribers]) fn(this);
  }

  // At the end it stops; else the time until the next step begins anew.
  moved() {
    if (this.playing && this.atEnd) this.stopTimer();
    if (this.playing) this._plan();
    this.tell();
  }

  stopTimer() {
    this.playing = false;
    this._cancel();
  }

  _cancel() {
    if (this._timer !== null) this._clock.cancel(this._timer);
    this._timer = null;
  }

  _plan() {
    this._cancel();
    const wait = Math.max(SHORTEST_STEP_MS, this.stepDelay() / this._speed);
    this._timer = this._clock.after(wait, () => {
      this._timer = null;
      this.seekStep(this.progress.number + 1);
    });
  }
}

const EVEN_STEP_MS = 700;
const LONGEST_STEP_MS = 3000;

export class Player extends Playback {
  /** @type {RunHistory} */
  history;
  /** @type {number[]} */
  storyAt = [];
  /** @type {number[]} */
  storyFrom = [];
  position = 0;
  /** @type {Map<number, {state: string, count: number}>} */
  states = new Map();
  /** @type {Set<number>} */
  taken = new Set();

  // pace "even": every step takes the same time, for scenarios, whose times mean nothing;
  // "time": steps take as long as they did, but no step longer than three seconds.
  /** @param {any} automaton @param {{pace?: string, clock?: any}} options */
  constructor(automaton, { pace = "even", clock } = {}) {
    super(clock);
    this.pace = pace;
    this.reset(automaton);
  }

  // Forgets the run and begins with the automaton of another one.
  reset(automaton = this.history.automaton) {
    this.stopTimer();
    this.history = new RunHistory(automaton);
    this.storyAt = [];
    this.storyFrom = [];
    this.position = 0;
    this.states = new Map();
    this.taken = new Set();
    this.following = false;
  }

  // story_at, story_from: per sentence of a story the record at which it has happened, and begins.
  load(records, { story_at = [], story_from = story_at } = {}) {
    this.reset();
    for (const record of records) this.history.append(record);
    this.storyAt = story_at;
    this.storyFrom = story_from;
    this.tell();
  }

  // One more record of a run that goes on.
  append(record) {
    this.history.append(record);
    if (this.following) this._move(this.length);
    this.tell();
  }

  follow() {
    this.pause();
    this.following = true;
    this._move(this.length);
    this.tell();
  }

  get length() {
    return this.history.length;
  }

  // The last record that is applied, or null.
  get record() {
    return this.position ? this.history.records[this.position - 1] : null;
  }

  // The time of the run in microseconds.
  get at() {
    return this.position ? this.history.times[this.position - 1] : 0;
  }

  // Per sentence of the story: "current" if it happens in the step that is shown, "past" if it has
  // happened before, "" if it will. A sentence about a row of runners happens from the first to the
  // last of them.
  get story() {
    const { stops } = this.history;
    const before = stops[countUpTo(stops, this.position - 1) - 1] ?? 0;
    return this.storyAt.map((last, line) => {
      if (this.storyFrom[line] >= this.position) return "";
      return last >= before ? "current" : "past";
    });
  }

  get progress() {
    const { stops } = this.history;
    return { number: countUpTo(stops, this.position), of: stops.length };
  }

  get atEnd() {
    return this.position === this.length;
  }

  // Shows the states after so many records.
  seek(position) {
    this.following = false;
    this._move(Math.max(0, Math.min(this.length, Math.round(position) || 0)));
    this.moved();
  }

  seekStep(number) {
    const { stops } = this.history;
    if (number >= stops.length) this.seek(this.length);
    else this.seek(number <= 0 ? 0 : stops[number - 1]);
  }

  // Shows the states at a time of the run: everything that has happened until then.
  seekTime(at) {
    this.seek(countUpTo(this.history.times, at));
  }

  // To the sentence of the story with this number.
  seekStory(line) {
    if (line in this.storyAt) this.seek(this.storyAt[line] + 1);
  }

  back() {
    const { stops } = this.history;
    this.pause();
    this.seek(stops[countUpTo(stops, this.position - 1) - 1] ?? 0);
  }

  stepDelay() {
    if (this.pace === "even") return EVEN_STEP_MS;
    const { stops, times } = this.history;
    const next = stops[this.progress.number] ?? this.length;
    return Math.min(LONGEST_STEP_MS * this.speed, ((times[next - 1] ?? this.at) - this.at) / 1000);
  }

  _move(position) {
    const { frames } = this.history;
    while (this.position < position) {
      this._apply(frames[this.position]);
      this.position += 1;
    }
    while (this.position > position) {
      this.position -= 1;
      this._undo(frames[this.position]);
    }
  }

  _apply({ changes, edges }) {
    for (const { node, after } of changes) this.states.set(node, after);
    for (const edge of edges) this.taken.add(edge);
  }

  _undo({ changes, edges }) {
    for (let place = changes.length - 1; place >= 0; place -= 1) {
      const { node, before } = changes[place];
      if (before === IDLE) this.states.delete(node);
      else this.states.set(node, before);
    }
    for (const edge of edges) this.taken.delete(edge);
  }
}

// Two runs of the same scenario, side by side: a step shows all that happens in both of them
// until the next time at which something can be seen in either.
export class PairPlayer extends Playback {
  /** @param {Player} left @param {Player} right @param {{clock?: any}} options */
  constructor(left, right, { clock } = {}) {
    super(clock);
    this.pair = [left, right];
    this.number = 0;
    const seen = this.pair.map(({ history }) => history.stops.map((stop) => history.times[stop - 1]));
    this.times = [...new Set(seen.flat())].sort((one, other) => one - other);
  }

  get progress() {
    return { number: this.number, of: this.times.length };
  }

  get atEnd() {
    return this.number === this.times.length;
  }

  seekStep(number) {
    this.number = Math.max(0, Math.min(this.times.length, number));
    for (const player of this.pair) {
      if (this.number === 0) player.seek(0);
      else player.seekTime(this.times[this.number - 1]);
    }
    this.moved();
  }

  stepDelay() {
    return 2 * EVEN_STEP_MS;
  }
}
