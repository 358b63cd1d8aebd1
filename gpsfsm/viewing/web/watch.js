// One run, past or going on: its records, its clock, and what is shown of it at which time.
//
// A watch draws nothing. It holds a store and a player for the automaton and a scene for the map,
// takes in records as they come, and moves all three to the same instant. While it is `attached` it
// shows what happens now; a step back in time detaches it, and the run goes on meanwhile.

import { ServiceError } from "./client.js";
import { clipText, visibleText } from "./dom.js";
import { countUpTo } from "./history.js";
import { Player } from "./player.js";
import { isOpen } from "./runs.js";
import { createScene, lastUntil, openWorld } from "./scene.js";
import { createStore, unpack } from "./state.js";

const ASIDE_KINDS = new Set(["LOG", "NOTE", "CONTINUED", "RESTARTED"]);
const RECORDS_AT_ONCE = 5000;

export class Watch {
  // onChange(what) with what: "loaded", "records", "status", "time" or "trouble".
  constructor(client, onChange) {
    this.client = client;
    this.onChange = onChange;
    this.closing = new AbortController();
    this.info = null;
    this.status = null; // the last PlanAnswer
    this.store = null;
    this.player = null;
    this.scene = null;
    this.records = []; // all, with logs and notes
    this._feedback = new Map(); // node -> what it has said, with its times
    this.lastSeq = 0;
    this.length = 0; // the latest time that is known, in microseconds
    this.at = 0; // the time that is shown
    this.attached = false;
    this.replaying = false;
    this.replaySpeed = 1;
    this.clock = null; // {at, since}: where the run stood, and when that was heard
    this.trouble = "";
  }

  get running() {
    return this.info !== null && isOpen(this.state);
  }

  get state() {
    return this.status ? this.status.status : this.info.status;
  }

  // Whether real runners act, or have acted.
  get real() {
    return this.info !== null && this.info.mode === "real";
  }

  get paused() {
    return Boolean(this.status && this.status.paused);
  }

  get speed() {
    return this.status ? this.status.speed : null;
  }

  get automaton() {
    return this.store ? this.store.plan.automaton : null;
  }

  async open(number) {
    const { signal } = this.closing;
    const run = await this.client.get(`/v1/runs/${number}?records=${RECORDS_AT_ONCE}`, { signal });
    this.info = run;
    this._prepare(run);
    for (const record of run.records) this._take(record);
    if (run.next) await this._catchUp(run.next);
    if (isOpen(run.status) && run.plan_id) {
      const status = await this.client.get(`/v1/plans/${run.plan_id}`, { signal });
      if (!isOpen(status.status)) await this._catchUp(this.lastSeq); // it has ended meanwhile
      this._heard(status);
    }
    this.attached = this.running;
    if (this.attached) this._showNow();
    else this.seek(this.length);
    this.onChange("loaded");
    if (this.running) this._follow();
  }

  // Takes in all records behind one of them that there are.
  async _catchUp(after) {
    for (let next = after; next !== null; ) {
      const path = `/v1/runs/${this.info.run}/events?after=${next}&most=${RECORDS_AT_ONCE}`;
      const more = await this.client.get(path, { signal: this.closing.signal });
      for (const record of more.records) this._take(record);
      next = more.next ?? null;
    }
  }

  _prepare(run) {
    this.length = run.length_us || 0;
    if (run.world_at) {
      this.scene = createScene(run.world_at, {
        begun_s: run.begun_s || 0,
        pose: run.pose,
        closed: run.closed_zones,
      });
    } else if (this.real) {
      this.scene = createScene(openWorld());
    }
    if (!run.view) return;
    const store = createStore(withoutPlays(unpack(run.view)));
    this.store = store;
    if (this.automaton) {
      this.player = new Player(this.automaton);
      this.player.subscribe(({ states, taken, position }) => store.set({ states, taken, frame: position }));
    }
  }

  _take(record) {
    if (record.seq <= this.lastSeq) return;
    this.lastSeq = record.seq;
    this.records.push(record);
    this.length = Math.max(this.length, record.at_us);
    if (this.scene) this.scene.take(record);
    if (record.kind === "LOG" && record.data && record.data.feedback !== undefined) this._hear(record);
    if (this.player && record.record !== false && !ASIDE_KINDS.has(record.kind)) {
      this.player.append(record);
    }
    if (this.clock && record.at_us > this.clock.at) this.clock = { at: record.at_us, since: performance.now() };
  }

  _hear({ node, at_us, data }) {
    if (!this._feedback.has(node)) this._feedback.set(node, []);
    this._feedback.get(node).push({ at_us, words: feedbackWords(data) });
  }

  // How far an instance is at the time that is shown, as it says; "" if it says nothing.
  feedbackAt(node) {
    const said = this._feedback.get(node) || [];
    const last = lastUntil(said, this.at);
    return last < 0 ? "" : said[last].words;
  }

  async _follow() {
    const path = `/v1/plans/${this.info.plan_id}/events`;
    const onEvent = (message) => this._happened(message);
    try {
      await this.client.follow(path, { after: this.lastSeq, signal: this.closing.signal, onEvent });
    } catch (error) {
      this.trouble = error instanceof ServiceError ? error.message : String(error);
      this.onChange("trouble");
    }
  }

  _happened({ event, data }) {
    if (event === "record") {
      this._take(data);
      if (this.attached) this._showNow();
      this.onChange("records");
    } else if (event === "status" || event === "end") {
      this.heard(data);
    }
  }

  // How the run stands, as the service has said.
  heard(status) {
    this._heard(status);
    if (this.attached) this._showNow();
    if (!isOpen(status.status)) this.attached = false;
    this.onChange("status");
  }

  // An answer may come later than the news that the run has ended.
  _heard(status) {
    if (this.status && !isOpen(this.status.status) && isOpen(status.status)) return;
    this.status = status;
    const now = Math.max(status.clock_us || 0, this.records.length ? this.records[this.records.length - 1].at_us : 0);
    this.clock = { at: now, since: performance.now() };
    this.length = isOpen(status.status) ? Math.max(this.length, now) : now;
  }

  // The time of the run now: its last news, and what has passed since at its speed.
  now() {
    if (!this.clock || !this.running || this.paused || !this.speed || this.state !== "RUNNING") {
      return this.clock ? this.clock.at : this.length;
    }
    return this.clock.at + (performance.now() - this.clock.since) * 1000 * this.speed;
  }

  _showNow() {
    if (this.player && !this.player.following) this.player.follow();
    this.at = this.now();
    this.length = Math.max(this.length, this.at);
  }

  // Whether time passes in what is shown.
  get moving() {
    if (this.replaying) return true;
    return this.attached && this.running && !this.paused && Boolean(this.speed);
  }

  // To be called for every frame that is drawn, with the milliseconds since the last one.
  tick(milliseconds) {
    if (this.attached && this.running) {
      const before = this.at;
      this._showNow();
      if (this.at !== before) this.onChange("time");
    } else if (this.replaying) {
      const wanted = this.at + milliseconds * 1000 * this.replaySpeed;
      this._show(Math.min(wanted, this.length));
      if (wanted >= this.length) this.replaying = false;
      this.onChange("time");
    }
  }

  _show(at) {
    this.at = at;
    if (this.player) {
      const wanted = countUpTo(this.player.history.times, at);
      if (wanted !== this.player.position) this.player.seek(wanted);
    }
  }

  // Shows the run at a time; it does not follow what happens now any more.
  seek(at) {
    this.attached = false;
    if (this.player) this.player.following = false;
    this._show(Math.max(0, Math.min(at, this.length)));
    this.onChange("time");
  }

  attach() {
    this.replaying = false;
    if (this.running) this.attached = true;
    if (this.attached) this._showNow();
    else this._show(this.length);
    this.onChange("time");
  }

  // One event on or back.
  step(direction) {
    this.attached = false;
    this.replaying = false;
    if (!this.player) return;
    if (direction > 0) this.player.step();
    else this.player.back();
    this.at = this.player.at;
    this.onChange("time");
  }

  replay() {
    this.attached = false;
    if (!this.replaying && this.at >= this.length) this._show(0);
    this.replaying = !this.replaying;
    this.onChange("time");
  }

  // The instances that act at the time that is shown.
  active() {
    if (!this.player) return [];
    return [...this.player.states].filter(([, { state }]) => state === "running").map(([node]) => node);
  }

  // What somebody does to the run: "pause", "resume", "step", "speed", "cancel" or "fail".
  async control(what, values = {}) {
    const answer = await this.client.post(`/v1/plans/${this.info.plan_id}/${what}`, values);
    // The answer may overtake the records: nobody is told of an end that the map does not show yet.
    if (!isOpen(answer.status)) await this._catchUp(this.lastSeq);
    this.heard(answer);
    return answer;
  }

  close() {
    this.closing.abort();
    if (this.player) this.player.destroy();
  }
}

// What is played here is the run. The scenarios of the findings are still described.
function withoutPlays(document) {
  const plans = document.plans.map((plan) => {
    const findings = plan.findings.map((finding) => {
      const { story, ends } = plan.plays[finding.play] || finding;
      return { ...finding, play: -1, story, ends };
    });
    return { ...plan, findings, plays: [], plays_left_out: 0 };
  });
  return { ...document, plans };
}

// -- how far a runner is, as it says: names end with their units, "distance_left_m" ----------------

const UNITS = { _m_per_s: ["m/s", 2], _m: ["m", 1], _s: ["s", 0], _percent: ["%", 0] };
const MOST_FIELDS = 4;

function fieldWords(name, value) {
  if (typeof value !== "number") return `${name.replaceAll("_", " ")} ${clipText(visibleText(String(value)), 60)}`;
  const suffix = Object.keys(UNITS).find((each) => name.endsWith(each));
  const words = (suffix ? name.slice(0, -suffix.length) : name).split("_");
  const exact = Number.isInteger(value) ? value : Number(value.toPrecision(6));
  const amount = suffix ? `${value.toFixed(UNITS[suffix][1])} ${UNITS[suffix][0]}` : String(exact);
  if (words[words.length - 1] !== "left") return [...words, amount].join(" ");
  const rest = words.slice(0, -1).filter((each) => each !== "distance" && each !== "time");
  return [amount, ...rest, "left"].join(" ");
}

// "1.2 m left, 12 s left"
export function feedbackWords(data) {
  const fields = Object.entries(data).filter(([name]) => name !== "feedback" && name !== "world");
  return fields
    .slice(0, MOST_FIELDS)
    .map(([name, value]) => fieldWords(clipText(visibleText(name), 60), value))
    .join(", ");
}
