// The stage of one run: its automaton (beside that of the plan it goes on from), what can be done to
// it, and its time.

import { el, oncePerFrame, replaceContent, sign, visibleText } from "./dom.js";
import { speedChoice } from "./draft.js";
import { mountGraph } from "./graph.js";
import { statusBadge, whereWords } from "./runs.js";
import { clockText, createTimeline } from "./timeline.js";
import { isTree, nodeWords } from "./words.js";

function button(words, title, onclick, more = {}) {
  return el("button", { class: "button", type: "button", title, "aria-label": title, onclick, ...more }, words);
}

function graphPane(title, badge, store, kind) {
  const box = el("div", { class: "graph-box" });
  const head = el("div", { class: "run-pane-head" }, el("strong", {}, title), badge);
  const pane = el("section", { class: `run-pane ${kind}`, "aria-label": title }, head, box);
  return { pane, box, head, store };
}

// hooks: onOpen(run), onEdit(watch), onTrouble(text), onCompare(watch)
export function mountRunStage(container, { watch, previous, hooks }) {
  const head = el("div", { class: "run-head" });
  const banner = el("div", { class: "run-banner", role: "status", hidden: true });
  const difference = el("details", { class: "run-difference", hidden: true });
  const panes = el("div", { class: "run-panes" });
  const commands = el("div", { class: "run-commands", role: "group", "aria-label": "Control the run" });
  const replay = el("div", { class: "run-replay", role: "group", "aria-label": "Look back and forth" });
  const clock = el("span", { class: "run-clock" });
  const line = el("div", { class: "run-line" });
  const foot = el("div", { class: "run-foot" }, commands, el("div", { class: "run-time" }, replay, line, clock));
  container.append(head, banner, difference, panes, foot);
  const timeline = createTimeline(line, { onSeek: (at) => watch.seek(at) });
  const graphs = [];
  const drawSoon = oncePerFrame(() => !shared.gone && drawTime());
  /** @type {{drawn: string, gone: boolean, spans: any[] | null, pointer: number[], menu: {menu: HTMLElement, node: number} | null, unsubscribe: () => void}} */
  const shared = { drawn: "", gone: false, spans: null, pointer: [0, 0], menu: null, unsubscribe: () => {} };

  mountPanes();
  const parts = replayParts();
  update("loaded");

  function mountPanes() {
    const wide = Boolean(previous && previous.store);
    panes.classList.toggle("two", wide);
    const list = [];
    if (wide) {
      const title = `Before: run ${previous.info.run}`;
      list.push(graphPane(title, statusBadge(previous.state), previous.store, "old"));
    }
    if (watch.store) {
      const title = wide ? `Now: run ${watch.info.run}` : `Automaton of run ${watch.info.run}`;
      list.push(graphPane(title, null, watch.store, "new"));
    } else {
      panes.append(el("p", { class: "nothing" }, "The automaton of this run cannot be shown; its events can."));
    }
    panes.append(...list.map((each) => each.pane));
    for (const each of list) graphs.push(mountGraph(each.box, each.store));
    if (watch.store) listenToNodes(list[list.length - 1].box);
  }

  // -- to let a runner fail -------------------------------------------------------------------

  function listenToNodes(box) {
    box.addEventListener("pointerdown", (event) => {
      shared.pointer = [event.clientX, event.clientY];
    });
    shared.unsubscribe = watch.store.subscribe(["node"], (state) => {
      closeMenu();
      if (state.from === "graph" && canFail(state.node)) openMenu(state.node);
    });
  }

  function canFail(node) {
    return !watch.real && watch.attached && watch.running && watch.active().includes(node);
  }

  function openMenu(node) {
    const item = button([sign("fail"), "Let it fail"], "Let this runner fail", () => fail(node), { role: "menuitem" });
    const menu = el("div", { class: "fail-menu", role: "menu", "aria-label": nodeWords(watch.store.plan, node) });
    menu.append(el("p", {}, nodeWords(watch.store.plan, node)), item);
    document.body.append(menu);
    const { width, height } = menu.getBoundingClientRect();
    menu.style.left = `${Math.max(4, Math.min(shared.pointer[0] + 8, innerWidth - width - 8))}px`;
    menu.style.top = `${Math.max(4, Math.min(shared.pointer[1] + 8, innerHeight - height - 8))}px`;
    shared.menu = { menu, node };
    addEventListener("pointerdown", leaveMenu, { capture: true });
  }

  function leaveMenu(event) {
    if (shared.menu && !shared.menu.menu.contains(event.target)) closeMenu();
  }

  function closeMenu() {
    if (!shared.menu) return;
    removeEventListener("pointerdown", leaveMenu, { capture: true });
    shared.menu.menu.remove();
    shared.menu = null;
  }

  async function fail(node) {
    closeMenu();
    await command("fail", { node });
  }

  function failSelected() {
    const { node } = watch.store ? watch.store.state : { node: -1 };
    const [only] = watch.active().length === 1 ? watch.active() : [-1];
    const chosen = canFail(node) ? node : only;
    if (canFail(chosen)) fail(chosen);
    else if (watch.real) hooks.onTrouble("Real runners are not let fail.");
    else hooks.onTrouble("Select a runner that is running: that one can be let fail.");
  }

  async function command(what, values) {
    try {
      const answer = await watch.control(what, values);
      if (!answer.success) hooks.onTrouble(answer.why || `That had no effect: ${what}.`);
    } catch (error) {
      hooks.onTrouble(`That did not work: ${error.message}.`);
    }
  }

  // -- what stands above and below ------------------------------------------------------------

  function drawHead() {
    const { info } = watch;
    const where = whereWords(info, "outcomes drawn by chance");
    const links = [];
    if (info.continues_run) links.push(link(`goes on from run ${info.continues_run}`, info.continues_run));
    if (info.continued_by_run) links.push(link(`continued by run ${info.continued_by_run}`, info.continued_by_run));
    if (info.continues_run) {
      const words = previous ? "Only this one" : "Beside the plan before";
      links.push(button(words, words, () => hooks.onCompare(watch)));
    }
    replaceContent(
      head,
      el("h2", { class: "run-title" }, info.continues_run ? `Run ${info.run}` : `Run ${info.run} · ${visibleText(info.name)}`),
      statusBadge(watch.state),
      watch.running && watch.paused ? el("span", { class: "run-badge held" }, "paused") : null,
      el("span", { class: "run-where" }, `${where} · seed ${info.seed}`),
      links,
      button("Edit", "Put this plan into the editor", () => hooks.onEdit(watch)),
    );
  }

  function link(words, run) {
    return el("button", { class: "link", type: "button", onclick: () => hooks.onOpen(run) }, words);
  }

  function drawCommands() {
    if (!watch.running) {
      replaceContent(commands, el("span", { class: "run-over" }, overWords(watch)));
      return;
    }
    const { paused } = watch;
    const chosen = watch.speed === null ? 0 : watch.speed;
    replaceContent(
      commands,
      paused
        ? button([sign("play"), "Go on"], "Let the run go on", () => command("resume"), { class: "button primary" })
        : button([sign("pause"), "Pause"], "Pause the run", () => command("pause")),
      watch.real ? null : button([sign("step"), "Step"], "Let one event happen, then pause", () => command("step", { events: 1 })),
      watch.real
        ? null
        : speedChoice("Speed of this run", chosen, (event) => command("speed", { speed: Number(event.target.value) || null })),
      button([sign("stop"), "Cancel"], "Cancel the run", () => command("cancel"), { class: "button danger" }),
    );
  }

  function replayParts() {
    const found = {
      start: button(sign("start"), "To the beginning", () => watch.seek(0)),
      back: button(sign("back"), "One event back", () => watch.step(-1)),
      play: button(sign("play"), "Show it again in its time", () => watch.replay()),
      on: button(sign("on"), "One event on", () => watch.step(1)),
      live: button([sign("now"), "Now"], "Show what happens now", () => watch.attach(), { class: "button live-button" }),
    };
    replaceContent(replay, Object.values(found));
    return found;
  }

  function drawTime() {
    if (shared.spans !== watch.spans) {
      shared.spans = watch.spans;
      timeline.setSpans(watch.spans);
    }
    timeline.setPosition(watch.at, watch.length);
    clock.textContent = `${clockText(watch.at)} / ${clockText(watch.length)}`;
    drawButton(parts.play, watch.replaying ? "pause" : "play", "", watch.replaying ? "Stop here" : "Show it again in its time");
    drawButton(parts.live, ...(watch.running ? ["now", "Now", "Show what happens now"] : ["end", "", "To the end"]));
    parts.live.setAttribute("aria-pressed", String(watch.attached));
    container.classList.toggle("looking-back", watch.running && !watch.attached);
  }

  function drawButton(found, icon, words, title) {
    if (found.title === title && found.dataset.icon === icon) return;
    found.dataset.icon = icon;
    found.title = title;
    found.setAttribute("aria-label", title);
    replaceContent(found, sign(icon), words);
  }

  function update(what) {
    const key = [watch.state, watch.paused, watch.speed, watch.info.continued_by_run].join();
    if (key !== shared.drawn) {
      shared.drawn = key;
      drawHead();
      drawCommands();
    }
    if (shared.menu && !canFail(shared.menu.node)) closeMenu();
    if (what !== "trouble") drawSoon();
  }

  return {
    update,
    fail,
    failSelected,
    // Pauses what goes on, or shows again what is over.
    toggle() {
      if (watch.running && watch.attached) command(watch.paused ? "resume" : "pause");
      else watch.replay();
    },
    tellDifference(diff) {
      const titles = { equal: "Both plans do the same.", different: "The new plan does something else" };
      difference.hidden = false;
      replaceContent(
        difference,
        el("summary", {}, titles[diff.verdict] || "Whether both plans do the same is undecided"),
        el("ul", {}, diff.words.map((line) => el("li", {}, visibleText(line)))),
      );
    },
    graphs,
    // What becomes of a plan that gave up; "" takes it away.
    tell(title, lines = []) {
      banner.hidden = !title;
      const list = lines.length ? el("ul", {}, lines.map((each) => el("li", {}, visibleText(each)))) : null;
      replaceContent(banner, el("strong", {}, visibleText(title)), list);
    },
    destroy() {
      shared.gone = true;
      closeMenu();
      shared.unsubscribe();
      for (const graph of graphs) graph.destroy();
      replaceContent(container);
    },
  };
}

function overWords(watch) {
  const reason = watch.status && watch.status.reason ? `: ${visibleText(watch.status.reason)}` : "";
  const words = {
    COMPLETED: "The run has completed.",
    GAVE_UP: isTree(watch.store.plan)
      ? "The tree has failed: nothing handled a failure."
      : "The plan gave up: nothing handled a failure.",
    STUCK: "The run is stuck: nothing more can happen.",
    CANCELLED: `The run was cancelled${reason}.`,
  };
  return words[watch.state] || `The run has ended: ${watch.state}.`;
}
