// Two plans side by side: what they do differently, played on both at once.

import { el, oncePerFrame, replaceContent, visibleText } from "./dom.js";
import { bindPlayer, drawEnd, mountPlayerBar, sentenceNow, stateCounts } from "./playbar.js";
import { PairPlayer } from "./player.js";
import { createStore } from "./state.js";
import { verdictBadge } from "./summary.js";

const DIFF_WORDS = {
  equal: { sign: "=", word: "the plans do the same", kind: "good" },
  different: { sign: "≠", word: "the plans differ", kind: "bad" },
  undecided: { sign: "?", word: "undecided", kind: "neutral" },
};

// mountCompare(container, viewDocument, {mountPlan, onOpen}) -> {element, player, redraw, destroy}
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
  const bar = mountPlayerBar(foot, {
    player,
    play: () => (diff.plays[0] || diff.plays[1] ? { title: "The same scenario on both", ends: "" } : null),
    story: () => [],
    now: () => (player.atEnd ? "That is all: see how both end." : ""),
  });
  const words = box.querySelector(".compare-words");
  const stop = player.subscribe(oncePerFrame(() => markWords(words, diff, sides)));
  return {
    element: box,
    player,
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

// The sentences of both stories are among the words; those that are told now are marked.
function markWords(words, diff, sides) {
  const told = new Set();
  for (const { store, player } of sides) {
    const { play } = store.state;
    if (play && player.storyLine >= 0) told.add(play.story[player.storyLine]);
  }
  [...words.children].forEach((item, place) => {
    item.classList.toggle("current", told.has(diff.words[place]));
  });
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
    replaceContent(tally, counts.map(([state, count]) => `${count} ${state} `));
  });
  const stop = player.subscribe(show);
  let mounted = null;
  return {
    store,
    player,
    element,
    mount() {
      mounted = mountPlan(pane, store);
      if (play) store.openPlay(play, { kind: "diff", index: 0 });
      show();
    },
    destroy() {
      stop();
      player.release();
      player.destroy();
      if (mounted && mounted.destroy) mounted.destroy();
    },
  };
}

