// The stage of one run: its automaton (beside that of the plan it goes on from), what can be done to
// it, and its time.

import { el, oncePerFrame, replaceContent, sign, visibleText } from "./dom.js";
import { speedChoice } from "./draft.js";
import { mountGraph } from "./graph.js";
import { statusBadge, whereWords } from "./runs.js";
import { clockText, mountTimeline } from "./timeline.js";
import { isTree, nodeWords } from "./words.js";

// What closes a menu: a click beside it, Escape, and a window of another size, since it stands at a point.
const LEAVING = ["pointerdown", "keydown", "resize"];

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
  const replay = el("div", { class: "run-replay", role: "group", "aria-label": "Replay" });
  const clock = el("span", { class: "run-clock" });
  const rows = el("div", { class: "run-timeline" });
  const foot = el("div", { class: "run-foot" }, el("div", { class: "run-time" }, commands, replay, clock));
  container.append(head, banner, difference, panes, rows, foot);
  const timeline = mountTimeline(rows, {
    plan: () => watch.store?.plan,
    history: () => watch.player?.history ?? null,
    folded: () => watch.store.state.collapsed,
    position: () => watch.at,
    length: () => watch.length,
    onSeek: (at) => watch.seek(at),
    onSelect: (node) => watch.store.selectNode(node, "timeline"),
  });
  const graphs = [];
  const drawSoon = oncePerFrame(() => !shared.gone && draw());
  /** @type {{drawn: string, gone: boolean, acting: number[], pointer: number[], menu: {menu: HTMLElement, node: number} | null, commands: any, unsubscribe: () => void}} */
  const shared = { drawn: "", gone: false, acting: [], pointer: [0, 0], menu: null, commands: null, unsubscribe: () => {} };

  mountPanes();
  const parts = replayParts();
  draw();

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
      panes.append(el("p", { class: "nothing" }, "The automaton of this run cannot be shown. Its events can."));
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
    const item = button([sign("fail"), "Make it fail"], "Make it fail", () => fail(node), { role: "menuitem" });
    const menu = el("div", { class: "fail-menu", role: "menu", "aria-label": nodeWords(watch.store.plan, node) });
    menu.append(el("p", {}, nodeWords(watch.store.plan, node)), item);
    container.append(menu);
    const { width, height } = menu.getBoundingClientRect();
    menu.style.left = `${Math.max(4, Math.min(shared.pointer[0] + 8, innerWidth - width - 8))}px`;
    menu.style.top = `${Math.max(4, Math.min(shared.pointer[1] + 8, innerHeight - height - 8))}px`;
    shared.menu = { menu, node };
    for (const kind of LEAVING) addEventListener(kind, leaveMenu, { capture: true });
  }

  function leaveMenu(event) {
    if (!shared.menu || (event.type === "keydown" && event.key !== "Escape")) return;
    if (event.type !== "pointerdown" || !shared.menu.menu.contains(event.target)) closeMenu();
  }

  function closeMenu() {
    if (!shared.menu) return;
    for (const kind of LEAVING) removeEventListener(kind, leaveMenu, { capture: true });
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
    else if (watch.real) hooks.onTrouble("Real runners cannot be made to fail.");
    else hooks.onTrouble("Select a running runner first: only that can be made to fail.");
  }

  async function command(what, values) {
    try {
      const answer = await watch.control(what, values);
      if (!answer.success) hooks.onTrouble(answer.why || `The command had no effect: ${what}.`);
    } catch (error) {
      hooks.onTrouble(`The command failed: ${error.message}.`);
    }
  }

  // -- what stands above and below ------------------------------------------------------------

  function drawHead() {
    const { info } = watch;
    const where = whereWords(info, "random outcomes");
    const links = [];
    if (info.continues_run) links.push(link(`continues run ${info.continues_run}`, info.continues_run));
    if (info.continued_by_run) links.push(link(`continued by run ${info.continued_by_run}`, info.continued_by_run));
    if (info.continues_run) {
      const words = previous ? "Show only this run" : "Show beside the previous run";
      links.push(button(words, words, () => hooks.onCompare(watch)));
    }
    replaceContent(
      head,
      el("h2", { class: "run-title" }, info.continues_run ? `Run ${info.run}` : `Run ${info.run} · ${visibleText(info.name)}`),
      statusBadge(watch.state),
      watch.running && watch.paused ? el("span", { class: "run-badge held" }, "paused") : null,
      el("span", { class: "run-where" }, `${where} · seed ${info.seed}`),
      links,
      button("Edit", "Edit this plan", () => hooks.onEdit(watch)),
    );
  }

  function link(words, run) {
    return el("button", { class: "link", type: "button", onclick: () => hooks.onOpen(run) }, words);
  }

  function commandParts() {
    const step = "Step: let one event happen, then pause";
    return {
      resume: button([sign("play"), "Resume"], "Resume the run", () => command("resume"), { class: "button primary" }),
      pause: button([sign("pause"), "Pause"], "Pause the run", () => command("pause")),
      step: button([sign("step"), "Step"], step, () => command("step", { events: 1 }), { hidden: watch.real }),
      speed: speedPart(),
      stop: button([sign("stop"), "Cancel"], "Cancel the run", () => command("cancel"), { class: "button danger" }),
    };
  }

  function speedPart() {
    const onchange = (event) => command("speed", { speed: Number(event.target.value) || null });
    const choice = speedChoice("Speed of this run", watch.speed === null ? 0 : watch.speed, onchange);
    choice.hidden = watch.real;
    return choice;
  }

  // The buttons stay as long as the run goes on: one that was replaced between the press and the
  // release of the mouse would take no click, and would lose the focus.
  function drawCommands() {
    if (!watch.running) {
      shared.commands = null;
      replaceContent(commands, el("span", { class: "run-over" }, overWords(watch)));
      return;
    }
    if (!shared.commands) {
      shared.commands = commandParts();
      replaceContent(commands, Object.values(shared.commands));
    }
    const { resume, pause, speed } = shared.commands;
    const [shown, other] = watch.paused ? [resume, pause] : [pause, resume];
    const isFocused = document.activeElement === other;
    [shown.hidden, other.hidden] = [false, true];
    if (isFocused) shown.focus();
    if (Number(speed.value) !== (watch.speed === null ? 0 : watch.speed)) {
      shared.commands.speed = speedPart();
      speed.replaceWith(shared.commands.speed);
    }
  }

  function replayParts() {
    const buttons = {
      start: button(sign("start"), "To the start", () => watch.seek(0)),
      back: button(sign("back"), "Previous event", () => watch.step(-1)),
      play: button(sign("play"), "Replay the run", () => watch.replay()),
      on: button(sign("on"), "Next event", () => watch.step(1)),
      live: button([sign("now"), "Live"], "Live: follow the run", () => watch.attach(), { class: "button live-button" }),
    };
    replaceContent(replay, Object.values(buttons));
    return buttons;
  }

  // What has begun last, or the end.
  function follow() {
    const states = [...(watch.player?.states || [])];
    const acting = states.filter(([, { state }]) => state === "running" || state === "reached").map(([node]) => node);
    const newest = acting.find((node) => !shared.acting.includes(node));
    shared.acting = acting;
    if (newest !== undefined) graphs[graphs.length - 1]?.follow(newest);
  }

  function drawTime() {
    timeline.update();
    follow();
    clock.textContent = `${clockText(watch.at)} / ${clockText(watch.length)}`;
    drawButton(parts.play, watch.replaying ? "pause" : "play", "", watch.replaying ? "Stop the replay" : "Replay the run");
    drawButton(parts.live, ...(watch.running ? ["now", "Live", "Live: follow the run"] : ["end", "", "To the end"]));
    parts.live.setAttribute("aria-pressed", String(watch.attached));
    container.classList.toggle("looking-back", watch.running && !watch.attached);
  }

  function drawButton(target, icon, words, title) {
    if (target.title === title && target.dataset.icon === icon) return;
    target.dataset.icon = icon;
    target.title = title;
    target.setAttribute("aria-label", title);
    replaceContent(target, sign(icon), words);
  }

  // All in one frame: who reads "paused" reads the time, and sees the robot, where the run stands.
  function draw() {
    const key = [watch.state, watch.paused, watch.speed, watch.info.continued_by_run].join();
    if (key !== shared.drawn) {
      shared.drawn = key;
      drawHead();
      drawCommands();
    }
    drawTime();
  }

  function update(what) {
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
      const titles = { equal: "Both plans behave the same", different: "The new plan behaves differently" };
      difference.hidden = false;
      replaceContent(
        difference,
        el("summary", {}, titles[diff.verdict] || "Undecided whether both plans behave the same"),
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
      timeline.destroy();
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
    STUCK: "The run is stuck: nothing can happen any more.",
    CANCELLED: `The run was cancelled${reason}.`,
  };
  return words[watch.state] || `The run has ended: ${watch.state}.`;
}
