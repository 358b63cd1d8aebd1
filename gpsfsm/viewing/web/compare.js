// Two plans side by side: what they do differently, played on both at once.

import { el, oncePerFrame, replaceContent, visibleText } from "./dom.js";
import { countUpTo } from "./history.js";
import { bindPlayer, drawEnd, markSentence, mountPlayerBar, sentenceNow, stateCounts } from "./playbar.js";
import { PairPlayer } from "./player.js";
import { createStore } from "./state.js";
import { verdictBadge } from "./summary.js";
import { mountPlayTimeline } from "./timeline.js";
import { STATES } from "./words.js";

const DIFF_WORDS = {
  equal: { sign: "=", word: "the plans do the same", kind: "good" },
  different: { sign: "≠", word: "the plans differ", kind: "bad" },
  undecided: { sign: "?", word: "undecided", kind: "neutral" },
};

// mountCompare(container, viewDocument, {mountPlan, onOpen}) -> {element, player, opening, redraw, destroy}
//   opening: the step with which it opens, at which the plans part
//   mountPlan(container, store): draws one plan (its automaton, or what there is of it)
//   onOpen(number): a plan is to be shown alone
export function mountCompare(container, viewDocument, { mountPlan, onOpen }) {
  const { diff } = viewDocument;
  const sides = [diff.left, diff.right].map((plan, side) =>
    makeSide(viewDocument, plan, diff.plays[side], { mountPlan, onOpen }),
  );
  const foot = el("div", { class: "compare-foot" });
  const box = el(
    "section",
    { class: "compare", "aria-label": "Two plans side by side" },
    diffHeader(diff),
    el("div", { class: "compare-sides" }, sides.map((side) => side.element)),
    foot,
  );
  container.append(box);
  sides.forEach((side) => side.mount());
  const player = new PairPlayer(sides[0].player, sides[1].player);
  const rows = sides.map((side) => side.mountTimeline(player));
  box.style.setProperty("--timeline-least", String(Math.max(...rows)));
  const opening = partingStep(player);
  const bar = mountPlayerBar(foot, {
    player,
    play: () => (diff.plays[0] || diff.plays[1] ? { title: "The same scenario on both", ends: "" } : null),
    story: () => [],
    now: () => {
      if (player.atEnd) return "That is all: see how both end.";
      return opening && player.progress.number === opening ? "Here the plans part." : "";
    },
  });
  const words = box.querySelector(".compare-words");
  const stop = player.subscribe(oncePerFrame(() => markWords(words, diff, sides)));
  const cameras = sides.flatMap((side) => side.camera() ?? []);
  for (const camera of cameras) camera.reopen = () => cameras.every((one) => one.opened) && showInOneSize(cameras);
  showInOneSize(cameras);
  player.seekStep(opening);
  return {
    element: box,
    player,
    opening,
    stores: sides.map((side) => side.store),
    redraw: bar.redraw,
    destroy() {
      stop();
      player.destroy();
      bar.destroy();
      sides.forEach((side) => side.destroy());
      box.remove();
    },
  };
}

// The step at which both have reacted to what happens last in the scenario; 0 if nothing is played.
function partingStep({ pair, times }) {
  const ends = pair.map(({ history, storyAt }) => history.times[storyAt[storyAt.length - 1]] ?? -1);
  return countUpTo(times, Math.max(...ends));
}

// Now that the panes have their heights: both pictures in the same size.
function showInOneSize(cameras) {
  for (const camera of cameras) camera.openView();
  const zoom = Math.min(...cameras.map((camera) => camera.zoom));
  for (const camera of cameras) if (camera.zoom > zoom) camera.openAt(zoom);
}

function diffHeader(diff) {
  const { sign, word, kind } = DIFF_WORDS[diff.verdict] || DIFF_WORDS.undecided;
  return el(
    "header",
    { class: "compare-head" },
    el("span", { class: `verdict verdict-${kind}` }, `${sign} ${word}`),
    el(
      "ol",
      { class: "compare-words story" },
      diff.words.map((line) => el("li", {}, visibleText(line))),
    ),
  );
}

// Of the words the first is a heading; the scenario, which is the same on both sides, follows, and
// then how either side ends.
function markWords(words, diff, sides) {
  const whens = diff.words.map(() => "");
  sides.forEach(({ store, player }, side) => {
    if (!store.state.play) return;
    player.story.forEach((when, line) => {
      const isLast = line === player.storyAt.length - 1;
      const place = isLast ? diff.words.length - 2 + side : 1 + line;
      if (whens[place] !== "current") whens[place] = when;
    });
  });
  [...words.children].forEach((item, place) => markSentence(item, whens[place]));
}

function makeSide(viewDocument, number, play, { mountPlan, onOpen }) {
  const store = createStore(viewDocument);
  store.showPlan(number);
  const player = bindPlayer(store);
  const plan = viewDocument.plans[number];
  const pane = el("div", { class: "compare-pane" });
  const [end, said, tally] = [el("span"), el("p", { class: "play-now", "aria-live": "polite" }), el("span")];
  const open = el(
    "button",
    { type: "button", class: "plan-link", title: "Show this plan alone", onclick: () => onOpen(number) },
    visibleText(plan.name),
  );
  const element = el(
    "section",
    { class: "compare-side", "aria-label": plan.name },
    el("header", { class: "compare-side-head" }, open, verdictBadge(plan.verdict), end),
    pane,
    el("div", { class: "compare-said" }, said, tally),
  );
  const show = oncePerFrame(() => {
    drawEnd(end, play && player.atEnd ? play.ends : "");
    said.textContent = sentenceNow(plan, player, play);
    const counts = stateCounts(plan.automaton, player.states);
    replaceContent(tally, counts.map(([state, count]) => `${count} ${STATES[state].word}`).join(" · "));
  });
  const stop = player.subscribe(show);
  let mounted = null;
  let timeline = null;
  return {
    store,
    player,
    element,
    camera: () => mounted?.camera,
    // pair: the player of both runs; returns how many rows of it are in view
    mountTimeline(pair) {
      if (play) timeline = mountPlayTimeline(pane, store, player, pair);
      return timeline ? timeline.rowsInView() : 0;
    },
    mount() {
      mounted = mountPlan(pane, store);
      if (play) store.openPlay(play, { kind: "diff", index: 0 });
      show();
    },
    destroy() {
      stop();
      player.release();
      player.destroy();
      if (timeline) timeline.destroy();
      if (mounted && mounted.destroy) mounted.destroy();
    },
  };
}

