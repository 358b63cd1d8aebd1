// What the records of a run change: the states of nodes, and which edges are taken.
//
// A frame is what one record changes, {changes: [{node, before, after}], edges: [index]}, so it can
// be undone exactly. A state is {state, count}, see words.js for the states; a join counts its
// inputs, and a runner whose time is over stays "timeout" until the run ends.

const OF_RUNNER = {
  TRIGGERED: "triggered",
  HELD: "triggered",
  STARTED: "running",
  SUCCEEDED: "succeeded",
  FAILED: "failed",
  TIMEOUT: "timeout",
  STOPPED: "stopped",
};
const EMITTED = new Set(["STARTED", "SUCCEEDED", "FAILED", "STOPPED"]);
// What tells of the run and not of what its plan does.
const ASIDE = new Set(["LOG", "NOTE", "CONTINUED", "RESTARTED"]);
const ENDING = new Set(["CANCEL", "SILENCE", "REPORTED"]);
const TOLD = new Set(["CANCEL", "SILENCE", "REPORTED", "ENDED"]);
export const IDLE = Object.freeze({ state: "idle", count: 0 });

// The frames of a run: frame n takes the states from n records to n + 1.
export class RunHistory {
  constructor(automaton) {
    this.automaton = automaton;
    this.records = [];
    this.frames = [];
    this.stops = []; // positions at which something new can be seen, ascending
    this.times = []; // per record the time of the run, never falling
    this.ended = "";
    this._head = new Map();
    this._taken = new Set();
    this._over = false; // completed, given up or cancelled: nothing is emitted any more
    this._begun = false;
    this._started = new Set(); // nodes whose runner was loaded and has been asked to act
    this._triggered = new Map(); // node -> {stop, at}: where it was triggered
    this._leaving = leavingEdges(automaton);
    this._silent = new Set(automaton.silent || []);
    this._arrived = new Map(); // join of a machine -> Set(edge): the inputs that have arrived
  }

  get length() {
    return this.records.length;
  }

  // Takes in one more record and returns its frame.
  append(record) {
    const frame = { changes: [], edges: [] };
    const last = this.times.length ? this.times[this.times.length - 1] : 0;
    this.records.push(record);
    this.frames.push(frame);
    this.times.push(Math.max(last, record.at_us || 0));
    if (record.record !== false && !ASIDE.has(record.kind)) this._take(record, frame);
    this._note(record, frame);
    return frame;
  }

  _take(record, frame) {
    if (!this._begun && !ENDING.has(record.kind)) {
      this._begun = true;
      this.automaton.nodes.forEach(({ kind }, number) => {
        if (kind !== "start") return;
        this._set(number, "succeeded", 0, frame);
        this._emit(number, "SUCCEEDED", frame);
      });
    }
    const node = record.node ?? -1;
    if (ENDING.has(record.kind)) this._over = true;
    else if (record.kind === "ENDED") this._end(record, frame);
    else if (!this.automaton.nodes[node]) return;
    else if (record.kind === "JOINED") this._join(node, frame);
    else if (OF_RUNNER[record.kind]) this._runner(node, record, frame);
  }

  _runner(node, { kind }, frame) {
    const before = this._stateOf(node).state;
    const late = before === "timeout" && (kind === "STOPPED" || kind === "FAILED");
    if (!late) this._set(node, OF_RUNNER[kind], 0, frame);
    if (kind === "STARTED") this._started.add(node);
    if (EMITTED.has(kind) && !this._isMute(node, kind)) this._emit(node, kind, frame);
  }

  // Some engines let a runner start, or fail to, without any event.
  _isMute(node, kind) {
    if (kind === "STARTED") return this._silent.has(node);
    return kind === "FAILED" && Boolean(this.automaton.refusals_hang) && !this._started.has(node);
  }

  _join(node, frame) {
    this._set(node, "fired", this._stateOf(node).count, frame);
    this._emit(node, "SUCCEEDED", frame);
  }

  _emit(node, event, frame) {
    if (this._over) return;
    const edges = this._leaving.get(`${node} ${event}`) || [];
    for (const edge of edges) {
      if (this._taken.has(edge)) continue;
      this._taken.add(edge);
      frame.edges.push(edge);
    }
    for (const edge of edges) {
      if (this.automaton.flat) this._arriveInMachine(edge, frame);
      else this._arrive(this.automaton.edges[edge].target, frame);
    }
  }

  // The joins of a machine have each input once, and begin anew when they have fired and all have
  // arrived, or when they are stopped. What a runner does is in its own records.
  _arriveInMachine(edge, frame) {
    const { target, stops } = this.automaton.edges[edge];
    if (target < 0 || this.automaton.nodes[target].kind !== "join") {
      if (!stops) this._arrive(target, frame);
      return;
    }
    const arrived = stops ? new Set() : this._arrived.get(target) || new Set();
    this._arrived.set(target, arrived);
    if (!stops) arrived.add(edge);
    const fired = this._stateOf(target).state === "fired" && !stops;
    if (fired && arrived.size >= this.automaton.nodes[target].inputs) arrived.clear();
    const state = arrived.size ? "waiting" : "idle";
    this._set(target, fired ? "fired" : state, arrived.size, frame);
  }

  _arrive(target, frame) {
    if (target < 0) return;
    const { kind } = this.automaton.nodes[target];
    if (kind === "join") {
      const { state, count } = this._stateOf(target);
      this._set(target, state === "fired" ? "fired" : "waiting", count + 1, frame);
    } else if (kind === "complete" || kind === "give_up") {
      this._set(target, "reached", 0, frame);
      this._over = true;
    }
  }

  _end(record, frame) {
    this._over = true;
    this.ended = (record.data && record.data.status) || "ENDED";
    const isStuck = this.ended === "STUCK" || this.ended === "HANG";
    this.automaton.nodes.forEach((node, number) => {
      const { state, count } = this._stateOf(number);
      if (!this._head.has(number)) this._set(number, "never", 0, frame);
      else if (isStuck && state === "waiting") this._set(number, "stuck", count, frame);
    });
  }

  _stateOf(node) {
    return this._head.get(node) || IDLE;
  }

  _set(node, state, count, frame) {
    const before = this._stateOf(node);
    if (before.state === state && before.count === count) return;
    const after = Object.freeze({ state, count });
    frame.changes.push({ node, before, after });
    this._head.set(node, after);
  }

  // Loading takes no time worth looking at: a runner that starts in the instant in which it is
  // triggered is one step.
  _note(record, frame) {
    const seen = frame.changes.length || frame.edges.length || TOLD.has(record.kind);
    if (!seen) return;
    const at = this.times[this.times.length - 1];
    if (record.kind === "STARTED") {
      const triggered = this._triggered.get(record.node);
      if (triggered && triggered.at === at) dropNumber(this.stops, triggered.stop);
    }
    this.stops.push(this.records.length);
    if (record.kind === "TRIGGERED" || record.kind === "HELD") {
      this._triggered.set(record.node, { stop: this.records.length, at });
    }
  }
}

function leavingEdges(automaton) {
  const leaving = new Map();
  automaton.edges.forEach(({ source, event }, number) => {
    const key = `${source} ${event}`;
    if (leaving.has(key)) leaving.get(key).push(number);
    else leaving.set(key, [number]);
  });
  return leaving;
}

// How many of some ascending numbers are at most `limit`.
export function countUpTo(numbers, limit) {
  let low = 0;
  let high = numbers.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

function dropNumber(numbers, one) {
  const place = countUpTo(numbers, one) - 1;
  if (numbers[place] === one) numbers.splice(place, 1);
}
