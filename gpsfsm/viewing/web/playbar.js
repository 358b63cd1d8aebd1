// The bar with which a run is stepped and played, and the binding of a player to the store.

import { clipText, debounce, el, oncePerFrame, replaceContent, sign, visibleText } from "./dom.js";
import { Player } from "./player.js";
import { ENDS, STATES, recordSentence } from "./words.js";

const NO_AUTOMATON = Object.freeze({ nodes: [], edges: [] });
const SPEEDS = [0.5, 1, 2, 4, 8, 16, 40];
// What is played faster than this is not followed by the other panes: they would only flicker.
const FOLLOWED_SPEED = 2;
const FOLLOW_MS = 60;
const COUNTED = ["running", "triggered", "succeeded", "failed", "timeout", "stopped", "never"];

// The player of a store: it plays `store.state.play` and writes what is seen into the store.
export function bindPlayer(store) {
  const automaton = () => store.plan.automaton || NO_AUTOMATON;
  const player = new Player(automaton());
  let loaded = null;

  function load() {
    const { play } = store.state;
    if (play === loaded && player.history.automaton === automaton()) {
      // opened once more: it begins anew
      if (store.state.states !== player.states) player.toStart();
      return;
    }
    loaded = play;
    player.reset(automaton());
    if (play) player.load(play.records, play);
  }

  // The other panes go to what happens, once the steps rest for a moment.
  const follow = debounce(() => {
    const node = lastNode(player);
    const calm = !player.playing || player.speed <= FOLLOWED_SPEED;
    if (node > 0 && calm && store.state.play === loaded) store.selectNode(node, "player");
  }, FOLLOW_MS);

  function show() {
    const { position, playing, speed, states, taken } = player;
    const isNew = position !== store.state.frame;
    store.set({ frame: position, playing, speed, states, taken });
    if (isNew && loaded) follow();
  }

  const stops = [store.subscribe(["plan", "play"], load), player.subscribe(show)];
  player.speed = store.state.speed;
  load();
  return Object.assign(player, { release: () => stops.forEach((stop) => stop()) });
}

const END_NODES = { COMPLETED: "complete", GAVE_UP: "give_up" };

// The node of the last sentence, or at which the run has ended.
function lastNode({ position, history }) {
  for (let place = position - 1; place >= 0; place -= 1) {
    const { kind, node = -1, data } = history.records[place];
    if (node > 0) return node;
    const end = kind === "ENDED" ? history.automaton.nodes.findIndex((one) => one.kind === END_NODES[data?.status]) : -1;
    if (end > 0) return end;
  }
  return -1;
}

// Opens a play and shows it; line: the sentence of its story to show, from its start without one.
export function openPlayAt(store, player, number, origin, line = -1) {
  const play = store.plan.plays[number];
  if (!play) return;
  if (store.state.play !== play) store.openPlay(play, origin);
  if (line >= 0) {
    player.pause();
    player.seekStory(line);
  }
}

// Plays it from its start; the keyboard is then at the button that plays and pauses.
export function startPlay(store, player, number, origin) {
  openPlayAt(store, player, number, origin);
  player.play();
  player.wantsFocus = true;
}

// mountPlayerBar(container, {player, play, story, onClose, now}) -> {element, destroy}
//   player: a Player or a PairPlayer;  play(): what is played, {title, ends} or null;
//   story(): [{text, when, show()}], see Player.story;  now(): the sentence about what is seen now
/**
 * @param {HTMLElement} container
 * @param {{player: any, play: () => any, story: () => any[], now: () => string, counts?: () => any,
 *   onClose?: () => void}} hooks
 */
export function mountPlayerBar(container, { player, play, story, now, counts, onClose }) {
  const parts = makeControls(player, onClose);
  const box = el(
    "section",
    { class: "playbar", "aria-label": "Player", hidden: true },
    parts.head,
    parts.row,
    parts.story,
  );
  container.append(box);
  const draw = oncePerFrame(() => drawBar(box, parts, { player, play, story, now, counts }));
  const stop = player.subscribe(draw);
  draw();
  return {
    element: box,
    redraw: draw,
    destroy() {
      stop();
      box.remove();
    },
  };
}

function makeControls(player, onClose) {
  const button = (icon, label, onclick, key) =>
    el(
      "button",
      { type: "button", class: "play-button", "aria-label": label, title: key ? `${label} (${key})` : label, onclick },
      sign(icon),
    );
  const toggle = button("play", "Play", () => player.toggle(), "space");
  const scrub = el("input", {
    type: "range",
    class: "scrub",
    min: 0,
    step: 1,
    value: 0,
    "aria-label": "Step",
    oninput: () => {
      player.pause();
      player.seekStep(Number(scrub.value));
    },
  });
  const speed = el(
    "select",
    { class: "speed", "aria-label": "Speed", onchange: () => (player.speed = Number(speed.value)) },
    SPEEDS.map((factor) => el("option", { value: factor }, `${factor}×`)),
  );
  const close = el(
    "button",
    { type: "button", class: "play-close", "aria-label": "Close the player", title: "Close the player", onclick: onClose },
    sign("fail"),
  );
  const [title, end, place] = [el("strong"), el("span"), el("span", { class: "play-place" })];
  const [said, tally] = [
    el("p", { class: "play-now", "aria-live": "polite" }),
    el("p", { class: "play-tally" }),
  ];
  const story = el("ol", { class: "story" });
  return {
    head: el("div", { class: "play-head" }, title, end, tally, onClose ? close : null),
    row: el(
      "div",
      { class: "play-row", role: "group", "aria-label": "Steps" },
      button("start", "To the start", () => player.toStart()),
      button("back", "Step back", () => player.back(), ","),
      toggle,
      button("on", "Step forward", () => player.step(), "."),
      button("end", "To the end", () => player.toEnd()),
      scrub,
      place,
      speed,
    ),
    story: el("div", { class: "play-story" }, said, story),
    list: story,
    ...{ toggle, scrub, speed, title, end, place, said, tally, shown: null },
  };
}

function drawBar(box, parts, { player, play, story, now, counts }) {
  const current = play();
  box.hidden = !current;
  if (!current) return;
  const { number, of } = player.progress;
  parts.title.textContent = visibleText(current.title);
  drawEnd(parts.end, current.ends);
  parts.scrub.max = of;
  parts.scrub.value = number;
  parts.place.textContent = `${number} / ${of}`;
  parts.scrub.setAttribute("aria-valuetext", `step ${number} of ${of}`);
  if (parts.toggle.dataset.playing !== String(player.playing)) {
    parts.toggle.dataset.playing = String(player.playing);
    parts.toggle.setAttribute("aria-label", player.playing ? "Pause" : "Play");
    replaceContent(parts.toggle, sign(player.playing ? "pause" : "play"));
  }
  parts.speed.value = String(player.speed);
  if (player.wantsFocus) parts.toggle.focus({ preventScroll: true });
  player.wantsFocus = false;
  parts.said.setAttribute("aria-live", player.playing ? "off" : "polite");
  parts.said.textContent = now();
  drawTally(parts.tally, counts ? counts() : []);
  drawStory(parts, story());
}

// "✗ gave up"
export function drawEnd(badge, ends) {
  const end = ENDS[ends];
  badge.className = `end end-${end ? end.kind : "neutral"}`;
  badge.title = end ? end.sentence : "";
  badge.textContent = ends ? `${end ? end.sign + " " : ""}${ends.toLowerCase().replace("_", " ")}` : "";
}

function drawTally(paragraph, counted) {
  replaceContent(
    paragraph,
    counted.map(([state, count]) =>
      el(
        "span",
        { class: `tally state-${state}`, title: `${count} ${STATES[state].word}` },
        `${STATES[state].sign} ${count}`,
      ),
    ),
  );
}

function drawStory(parts, lines) {
  const key = lines.map(({ text }) => text).join("\n");
  if (parts.shown !== key) {
    parts.shown = key;
    replaceContent(parts.list, lines.map(storyItem));
  }
  const isFirst = lines.findIndex(({ when }) => when === "current");
  lines.forEach(({ when }, number) => {
    const item = parts.list.children[number];
    if (markSentence(item, when) && number === isFirst) scrollWithin(parts.list, item);
  });
}

// Marks a sentence of a story; true if it was not marked so before.
export function markSentence(item, when) {
  if (item.dataset.when === when) return false;
  item.dataset.when = when;
  item.classList.toggle("current", when === "current");
  item.classList.toggle("past", when === "past");
  if (when === "current") item.setAttribute("aria-current", "step");
  else item.removeAttribute("aria-current");
  return true;
}

// Scrolls a box, and not the page, so that all of what is in it can be seen, at least its beginning.
export function scrollWithin(box, item, covered = 0) {
  const [outer, inner] = [box.getBoundingClientRect(), item.getBoundingClientRect()];
  const below = inner.bottom - outer.top - box.clientTop - box.clientHeight;
  if (below > 0) box.scrollTop += below;
  const above = outer.top + box.clientTop + covered - inner.top + Math.max(0, below);
  if (above > 0) box.scrollTop -= above;
}

// A sentence of a story; clicking it shows the run at that place.
export function storyItem({ text, show }) {
  return el(
    "li",
    {},
    show
      ? el("button", { type: "button", class: "story-line", onclick: show }, visibleText(text))
      : visibleText(text),
  );
}

// The bar of one store, whatever play is open in it.
export function mountStoreBar(container, store, player) {
  const bar = mountPlayerBar(container, {
    player,
    play: () => store.state.play,
    story: () => storyOf(store.state.play, player),
    now: () => sentenceNow(store.plan, player, store.state.play),
    counts: () => stateCounts(store.plan.automaton, player.states),
    onClose: () => store.openPlay(null),
  });
  const stop = store.subscribe(["play", "plan"], bar.redraw);
  return {
    ...bar,
    destroy() {
      stop();
      bar.destroy();
    },
  };
}

export function storyOf(play, player) {
  if (!play) return [];
  const { story } = player;
  return play.story.map((text, number) => ({
    text,
    when: story[number],
    show: () => {
      player.pause();
      player.seekStory(number);
    },
  }));
}

export function sentenceNow(plan, player, play) {
  if (!play) return "";
  if (!player.record) return "Nothing has happened yet: step or play.";
  const node = player.record.node ?? -1;
  const state = player.states.get(node);
  return clipText(recordSentence(plan, player.record, state ? state.count : 0), 300);
}

// How many runners are in which state, in the order of a run.
export function stateCounts(automaton, states) {
  const counts = new Map();
  for (const [node, { state }] of states) {
    if (automaton && automaton.nodes[node] && automaton.nodes[node].kind === "runner") {
      counts.set(state, (counts.get(state) || 0) + 1);
    }
  }
  return COUNTED.filter((state) => counts.has(state)).map((state) => [state, counts.get(state)]);
}
