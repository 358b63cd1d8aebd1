// A run along its time: who was active when, and a handle to go to any instant.

import { el, oncePerFrame, themeColor } from "./dom.js";

const LANE = 6; // pixels of a lane, with the gap below it
const MOST_LANES = 5;
const OUTCOMES = { SUCCEEDED: "succeeded", FAILED: "failed", TIMEOUT: "failed", STOPPED: "stopped" };

// The times at which instances were active: {node, from_us, to_us, state, lane}; `to_us` of one that
// still is, is Infinity. Fewer lanes than instances at once put some on top of others.
export function spansOf(records) {
  const spans = [];
  const open = new Map();
  const lanes = [];
  for (const record of records) {
    if (record.kind === "STARTED") {
      let lane = lanes.findIndex((until) => until <= record.at_us);
      if (lane < 0) lane = lanes.length < MOST_LANES ? lanes.length : MOST_LANES - 1;
      lanes[lane] = Infinity;
      const span = { node: record.node, from_us: record.at_us, to_us: Infinity, state: "running", lane };
      spans.push(span);
      open.set(record.node, span);
    } else if (OUTCOMES[record.kind] && open.has(record.node)) {
      const span = open.get(record.node);
      span.to_us = record.at_us;
      span.state = OUTCOMES[record.kind];
      lanes[span.lane] = record.at_us;
      if (record.kind !== "TIMEOUT") open.delete(record.node);
    } else if (record.kind === "ENDED") {
      for (const span of open.values()) span.to_us = Math.min(span.to_us, record.at_us);
    }
  }
  return spans;
}

export function clockText(us) {
  const seconds = Math.max(0, us) / 1e6;
  const minutes = Math.floor(seconds / 60);
  const rest = (seconds - minutes * 60).toFixed(1).padStart(minutes ? 4 : 3, "0");
  return minutes ? `${minutes}:${rest}` : `${rest} s`;
}

// onSeek(at_us) is told where the handle was put.
export function createTimeline(container, { onSeek }) {
  const strip = el("canvas", { class: "timeline-strip", "aria-hidden": "true" });
  const handle = el("input", {
    class: "timeline-handle",
    type: "range",
    min: 0,
    max: 1000,
    step: 1,
    value: 0,
    "aria-label": "Time of the run",
  });
  container.append(el("div", { class: "timeline" }, strip, handle));
  const shared = { spans: [], length: 1, at: 0 };

  const draw = oncePerFrame(() => {
    const { width, height } = strip.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    strip.width = Math.max(1, Math.round(width * ratio));
    strip.height = Math.max(1, Math.round(height * ratio));
    const pen = strip.getContext("2d");
    pen.scale(ratio, ratio);
    const x = (us) => 8 + ((width - 16) * Math.min(us, shared.length)) / shared.length;
    pen.fillStyle = themeColor("--line");
    pen.fillRect(8, height - 2, width - 16, 1);
    for (const span of shared.spans) drawSpan(pen, span, x);
    pen.fillStyle = themeColor("--accent");
    pen.fillRect(x(shared.at) - 0.75, 0, 1.5, height);
  });

  function drawSpan(pen, span, x) {
    const left = x(span.from_us);
    const wide = Math.max(2, x(span.to_us) - left);
    const top = 2 + span.lane * LANE;
    pen.fillStyle = themeColor(`--state-${span.state}`);
    pen.fillRect(left, top, wide, LANE - 2);
    if (span.state === "failed") {
      pen.fillRect(left + wide - 2, top - 2, 2, LANE + 2); // readable without colour
    }
  }

  handle.addEventListener("input", () => onSeek(Number(handle.value) * 1000));
  new ResizeObserver(draw).observe(strip);

  return {
    setSpans(spans) {
      shared.spans = spans;
      draw();
    },
    setPosition(at_us, length_us) {
      shared.at = at_us;
      shared.length = Math.max(1, length_us);
      handle.max = String(Math.ceil(shared.length / 1000));
      handle.value = String(Math.round(at_us / 1000));
      handle.setAttribute("aria-valuetext", `${clockText(at_us)} of ${clockText(length_us)}`);
      draw();
    },
    redraw: draw,
  };
}
