// Stepping and playing, whatever it is that is played.
//
// Subclasses have `progress` {number, of}: at which step of how many it stands, `atEnd`,
// `seekStep(n)`, which calls moved(), and `stepDelay()`: milliseconds until the next step.

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
