// The live page of the service: a plan is written and checked, run and watched, and past runs are
// looked at again. This module is the entry: it builds the page and leads from one part to another.

import { ServiceError, createClient, mountConnection } from "./client.js";
import { debounce, el, onFailure, oncePerFrame, prefersLessMotion, replaceContent } from "./dom.js";
import { mountDraft } from "./draft.js";
import { unpackText } from "./draftlink.js";
import { mountDetails, mountDraftStage } from "./draftview.js";
import { stepFinding } from "./findings.js";
import { LINK_REFUSED, bindAddress, elementKey, elementOfKey, findingKey, findingOfKey } from "./fragment.js";
import { bindKeys, helpDialog } from "./keys.js";
import { goalsOf, worldMaps } from "./map.js";
import { mountOperator } from "./operator.js";
import { isOpen, mountRuns, statusWord } from "./runs.js";
import { mountRunStage } from "./runview.js";
import { createScene } from "./scene.js";
import { mountSearch } from "./search.js";
import { mountSide } from "./side.js";
import { makeTabs, mountSplitter, tabPanel } from "./tabs.js";
import { themeButton } from "./theme.js";
import { Watch } from "./watch.js";

const REFRESH_MS = 250;
const QUEUE_POLL_MS = 400;
const FRAME_MS = 25;
const CALM_FRAME_MS = 1000;
const MOST_AT_ONCE_MS = 1500;

class Page {
  // Of the service, once it has been reached.
  /** @type {any} */
  service = null;
  /** @type {ReturnType<typeof worldMaps>} */
  worlds;
  // Of the page, which is built then.
  /** @type {ReturnType<typeof makeTabs>} */
  left;
  /** @type {ReturnType<typeof makeTabs>} */
  stageTabs;
  /** @type {HTMLElement} */
  draftBox;
  /** @type {HTMLElement} */
  runBox;
  /** @type {ReturnType<typeof mountSide>} */
  side;
  /** @type {ReturnType<typeof mountDetails>} */
  details;
  /** @type {ReturnType<typeof mountDraftStage>} */
  draftStage;
  /** @type {ReturnType<typeof mountRuns>} */
  runs;
  /** @type {HTMLElement} */
  said;
  /** @type {ReturnType<typeof mountOperator> | null} */
  operator = null;
  /** @type {ReturnType<typeof mountDraft>} */
  draft;
  /** @type {ReturnType<typeof bindAddress>} */
  address;
  // Of the run that is shown.
  /** @type {Watch | null} */
  watch = null;
  /** @type {Watch | null} */
  previous = null;
  /** @type {ReturnType<typeof mountRunStage> | null} */
  stage = null;
  /** @type {ReturnType<typeof watchRegeneration> | null} */
  regeneration = null;
  refreshSoon = debounce(() => this.runs.refresh(), REFRESH_MS);

  constructor(root) {
    this.root = root;
    this.draftDocument = null;
    /** @type {any} */
    this.wanted = null; // what of a draft a link asks for
    this.opening = 0;
    this.drawSide = oncePerFrame(() => this.side.update());
    this.connection = mountConnection(root, {
      onToken: (token) => {
        this.client.setToken(token);
        if (this.service) this.back();
        else this.begin();
      },
    });
    this.theme = themeButton();
    this.keys = mountLiveKeys(this);
    const help = { class: "tool", type: "button", title: "Keys (?)", "aria-label": "Keys (?)" };
    this.connection.tools.append(
      this.theme,
      el("button", { ...help, onclick: () => this.keys.dialog.showModal() }, "?"),
    );
    document.body.append(this.keys.dialog);
    this.client = createClient({ onConnection: (state) => this.connected(state) });
  }

  connected(state) {
    const again = this.connection.show(state);
    if (again && this.service) this.back();
    else if (again) this.begin();
  }

  trouble(text) {
    this.connection.toast(text);
  }

  async begin() {
    if (this.service || this.beginning) return;
    this.beginning = true;
    try {
      this.service = await this.client.get("/v1/service");
    } catch (error) {
      if (!(error instanceof ServiceError)) throw error;
      if (error.status !== 0 && error.status !== 401) this.connection.toast(`The page cannot start: ${error.message}.`);
      return;
    } finally {
      this.beginning = false;
    }
    this.build();
    if (this.service.queue) this.followQueue();
  }

  build() {
    const { service, client } = this;
    const writing = tabPanel("write", "left", { class: "left-panel writing" });
    const runs = tabPanel("runs", "left", { class: "left-panel runs", hidden: true });
    const chooseLeft = (key) => {
      writing.hidden = key !== "write";
      runs.hidden = key !== "runs";
      if (key === "runs" && service.queue) this.runs.refresh();
    };
    const lefts = [["write", "Plan"], ["runs", "Runs"]];
    this.left = makeTabs(lefts, chooseLeft, { label: "Plan or runs", prefix: "left" });
    const details = el("div", { class: "details" });
    const stages = [["draft", "Draft"], ["run", "Run"]];
    const wiring = { label: "Draft or run", prefix: "stage" };
    this.stageTabs = makeTabs(stages, (key) => this.showStage(key), wiring);
    this.stageTabs.buttons[1].disabled = true;
    this.draftBox = tabPanel("draft", "stage", { class: "stage draft-stage" });
    this.runBox = tabPanel("run", "stage", { class: "stage run-stage", hidden: true });
    const side = el("div", { class: "column side" });
    const main = el("main", { class: "live-main" });
    main.append(
      el("div", { class: "column left" }, this.left.list, writing, runs, details),
      mountSplitter(main, "--left", 1),
      el("div", { class: "column centre" }, this.stageTabs.list, this.draftBox, this.runBox),
      mountSplitter(main, "--right", -1),
      side,
    );
    this.said = el("p", { class: "unseen", role: "status" });
    this.root.append(main, this.said);
    this.connection.describe(service);
    if (service.real) this.operator = mountOperator(this.connection.head, { client, onTrouble: (text) => this.trouble(text) });
    this.worlds = worldMaps(client, service, (text) => this.trouble(text));
    this.side = mountSide(side, {
      onSeek: (at) => this.watch && this.watch.seek(at),
      onFail: (node) => this.stage && this.stage.fail(node),
      onElement: (element) => this.store()?.selectElement(element, "map"),
    });
    this.details = mountDetails(details);
    this.draftStage = mountDraftStage(this.draftBox);
    this.runs = mountRuns(runs, { client, onOpen: (run) => this.openRun(run) });
    this.draft = mountDraft(writing, {
      client,
      service,
      hooks: {
        onDocument: (view) => this.drafted(view),
        onCaretLine: (line) => this.draftStage.selectLine(line),
        onQueued: (answer) => this.queued(answer),
        onWorld: () => this.shown === "draft" && this.showDraftWorld(),
        onTrouble: (text) => this.trouble(text),
        link: (draft) => this.address.link({ draft }),
      },
    });
    if (!service.queue) replaceContent(runs, el("p", { class: "nothing" }, "This service runs no plans. Start it with --journal FILE to run plans here."));
    this.left.choose("write");
    this.stageTabs.choose("draft");
    this.address = bindAddress({
      names: ["run", "at", "draft", "finding", "element"],
      state: () => this.linked(),
      show: (values) => this.showLinked(values),
      refuse: () => this.trouble(LINK_REFUSED),
    });
    this.address.open();
  }

  // -- its address: a run, the time of it that is looked at, and a finding or an element of its plan; or
  // the text of a draft, which is then as any other text, so that the address forgets it

  linked(number = this.watch?.store?.state.finding ?? -1) {
    const { watch } = this;
    if (!watch) return {};
    const isPast = !watch.attached && watch.at < watch.length;
    return {
      run: watch.info.run,
      at: isPast ? Math.round(watch.at) : undefined,
      ...(watch.store && this.chosen(watch.store, number)),
    };
  }

  chosen({ plan, state }, number) {
    const finding = findingKey(plan, number);
    return { finding, element: finding ? undefined : elementKey(plan, state.element) };
  }

  // Selects them; false if one is not there.
  choose(store, { finding = "", element = "" }) {
    const number = finding ? findingOfKey(store.plan, finding) : -1;
    if (number !== store.state.finding) store.selectFinding(number);
    const place = element ? elementOfKey(store.plan, element) : -1;
    if (place >= 0) store.selectElement(place, "link");
    return (!finding || number >= 0) && (!element || place >= 0);
  }

  // A promise of false if something of it is not there.
  async showLinked({ run = "", at = "", draft = "", ...chosen }) {
    if (draft) return !run && !at && this.showDraft(draft, chosen);
    if (!run) {
      if (this.watch) this.stageTabs.choose("draft");
      return !at && !chosen.finding && !chosen.element;
    }
    if (!this.service.queue) return false;
    const number = Number(run);
    if (this.watch?.info.run !== number) await this.openRun(number);
    const { watch } = this;
    if (watch?.info.run !== number) return true; // why is said already
    this.stageTabs.choose("run");
    if (at) watch.seek(Number(at));
    else watch.attach();
    const { store } = watch;
    const isThere = store ? this.choose(store, chosen) : !chosen.finding && !chosen.element;
    return isThere && Number(at || 0) <= watch.length;
  }

  async showDraft(code, chosen) {
    let text = "";
    try {
      text = await unpackText(code);
    } catch {
      return false;
    }
    this.left.choose("write");
    this.stageTabs.choose("draft");
    this.wanted = chosen; // once it is checked
    this.draft.replace(text);
    setTimeout(() => this.address.write());
    return true;
  }

  // The store whose plan is in the middle.
  store() {
    if (this.shown === "run") return this.watch ? this.watch.store : null;
    return this.draftStage.store();
  }

  draftPlayer() {
    return this.draftStage.player();
  }

  graph() {
    if (this.shown === "draft") return this.draftStage.graph();
    return this.stage && this.stage.graphs.length ? this.stage.graphs[this.stage.graphs.length - 1] : null;
  }

  goTo(place) {
    this.left.choose(place === "runs" ? "runs" : "write");
    if (place === "runs") this.runs.focus();
    else this.draft.editor.focus();
  }

  // Panes of the plan that is in the middle.
  showPlan(store, player) {
    this.details.show(store, player);
    if (store === this.searched) return;
    this.searched = store;
    if (this.search) this.search.destroy();
    this.search = store ? mountSearch(this.connection.searchPlace, store) : null;
  }

  showStage(key) {
    this.shown = key;
    this.draftBox.hidden = key !== "draft";
    this.runBox.hidden = key !== "run";
    if (key === "run" && this.watch) {
      this.showPlan(this.watch.store);
      this.showRunWorld(this.watch);
    } else {
      this.showPlan(this.draftStage.store(), this.draftPlayer());
      this.showDraftWorld();
    }
  }

  // -- the draft ------------------------------------------------------------------------------

  drafted(view) {
    this.draftDocument = view;
    const store = this.draftStage.show(view);
    if (store) {
      store.subscribe(["element", "line", "finding"], (state) => this.selected(store, state));
      const draft = this.draft.code(); // of the text that was checked, which may have changed since
      if (draft) store.link = (place) => this.address.link({ draft, finding: findingKey(store.plan, place) });
    }
    if (this.shown === "draft") {
      this.showPlan(store, this.draftPlayer());
      this.showDraftWorld();
    }
    if (store && this.wanted && !this.choose(store, this.wanted)) this.trouble(LINK_REFUSED);
    if (store) this.wanted = null;
  }

  // What is chosen in another pane is shown in the editor.
  selected(store, state) {
    if (this.shown !== "draft" || state.from === "source") return;
    const finding = store.plan.findings[state.finding];
    if (finding && state.from === "finding" && finding.line > 0) {
      this.draft.editor.select(finding.line, finding.column, finding.length, { focus: false });
    } else {
      this.draft.editor.showLine(state.line);
    }
  }

  async showDraftWorld() {
    const name = this.draft ? this.draft.world() : "";
    const plan = this.draftDocument ? this.draftDocument.plans[0] : null;
    const geometry = await this.worlds.geometry(name);
    if (this.shown !== "draft" || this.draft.world() !== name) return;
    const scene = geometry ? createScene(geometry) : null;
    this.side.show(null, scene, geometry ? geometry.title : "", goalsOf(plan));
  }

  // -- runs -----------------------------------------------------------------------------------

  // A plan was taken by the queue: its run is shown as soon as it begins.
  async queued(answer) {
    this.opening += 1;
    const ticket = this.opening;
    let plan = answer;
    let isSaid = false;
    while (plan.run === null && isOpen(plan.status) && ticket === this.opening) {
      if (!isSaid && plan.status === "QUEUED" && plan !== answer) {
        this.trouble(`Plan ${plan.plan_id} is waiting in the queue.`);
        isSaid = true;
      }
      await new Promise((done) => setTimeout(done, QUEUE_POLL_MS));
      try {
        plan = await this.client.get(`/v1/plans/${answer.plan_id}`);
      } catch (error) {
        if (error.status !== 0 && error.status < 500) return;
      }
    }
    if (ticket !== this.opening) return;
    if (plan.run === null) this.trouble(`The plan did not run: ${plan.reason || plan.status}.`);
    else await this.openRun(plan.run, { follow: true });
  }

  // `beside`: the run whose plan it goes on from is shown too; `follow`: if it gives up, the one that
  // goes on from there is shown as soon as it begins.
  async openRun(number, { beside = false, follow = false } = {}) {
    this.opening += 1;
    const ticket = this.opening;
    const watch = new Watch(this.client, (what) => this.changed(watch, what));
    let previous = null;
    try {
      await watch.open(number);
      if (beside && watch.info.continues_run) {
        previous = new Watch(this.client, () => {});
        await previous.open(watch.info.continues_run);
        previous.seek(previous.length);
      }
    } catch (error) {
      watch.close();
      if (error.name !== "AbortError") this.trouble(`Run ${number} cannot be shown: ${error.message}.`);
      return;
    }
    if (ticket !== this.opening) {
      watch.close();
      return;
    }
    this.closeRun();
    this.watch = watch;
    this.previous = previous;
    this.runBox.hidden = false; // a picture is fitted into what can be seen
    this.draftBox.hidden = true;
    this.stage = mountRunStage(this.runBox, {
      watch,
      previous,
      hooks: {
        onOpen: (run) => this.openRun(run),
        onEdit: () => this.edit(watch),
        onTrouble: (text) => this.trouble(text),
        onCompare: () => this.openRun(number, { beside: !previous }),
      },
    });
    this.regeneration = watchRegeneration({
      client: this.client,
      watch,
      follow: follow || watch.running,
      service: this.service,
      tell: (title, lines) => this.stage?.tell(title, lines),
      onNext: (run) => this.openRun(run, { beside: true, follow: true }),
    });
    if (previous) this.compare(previous, watch);
    const { store } = watch;
    if (store) {
      store.link = (place) => this.address.link(this.linked(place));
      store.subscribe(["finding"], (state) => this.address.write(state.finding >= 0));
      store.subscribe(["element"], () => this.address.writeSoon());
    }
    this.address.write(true);
    this.runs.choose(number);
    this.stageTabs.buttons[1].disabled = false;
    this.stageTabs.buttons[1].textContent = `Run ${number}`;
    this.stageTabs.choose("run");
    this.bringIntoView();
    this.name();
    this.runs.refresh();
    this.animate();
  }

  // In which scenarios the new plan does something else than the old one, in words.
  async compare(previous, watch) {
    const [before, now] = [previous.info, watch.info];
    const names = { name: `run ${before.run}`, other_name: `run ${now.run}` };
    try {
      const { diff } = await this.client.post("/v1/view", { plan: before.plan, other: now.plan, ...names });
      if (watch === this.watch && diff) this.stage?.tellDifference(diff);
    } catch (error) {
      if (watch === this.watch) this.trouble(`The two plans cannot be compared: ${error.message}.`);
    }
  }

  closeRun() {
    if (this.regeneration) this.regeneration.stop();
    if (this.stage) this.stage.destroy();
    if (this.watch) this.watch.close();
    if (this.previous) this.previous.close();
    this.watch = this.previous = this.stage = this.regeneration = null;
  }

  showRunWorld(watch) {
    const real = watch.real ? "position reported by the robot" : "";
    const title = watch.info.world_at ? watch.info.world_at.title : real;
    this.side.show(watch, watch.scene, title, goalsOf(watch.store ? watch.store.plan : null));
  }

  changed(watch, what) {
    if (watch !== this.watch || !this.stage) return;
    this.stage.update(what);
    if (what === "time" && !watch.attached) this.address.writeSoon();
    this.name();
    if (what === "trouble") this.trouble(watch.trouble);
    if (what === "status" && !watch.running) {
      this.refreshSoon();
      this.regeneration?.look();
    }
    if (this.shown === "run") this.drawSide();
    this.animate();
  }

  // The tab of the browser says how the run stands, and so do screen readers.
  name() {
    const { watch } = this;
    const words = watch ? `Run ${watch.info.run}: ${statusWord(watch.state)}` : "";
    document.title = words ? `${words} – gpsfsm` : "gpsfsm";
    if (this.said.textContent !== words) this.said.textContent = words;
  }

  // On a small screen the stage may lie far below what was clicked.
  bringIntoView() {
    const { list } = this.stageTabs;
    if (list.getBoundingClientRect().top > innerHeight / 2) list.scrollIntoView({ block: "start" });
  }

  edit(watch) {
    const { plan, name, world, seed } = watch.info;
    this.draft.load(plan, name, { world, seed });
    this.left.choose("write");
    this.stageTabs.choose("draft");
    this.draft.editor.focus();
  }

  // -- time and connections -------------------------------------------------------------------

  // Draws what moves, as long as something does.
  animate() {
    if (this.animating || !this.watch || !this.watch.moving) return;
    this.animating = true;
    const before = performance.now();
    setTimeout(
      () =>
        requestAnimationFrame(() => {
          this.animating = false;
          if (this.watch) this.watch.tick(Math.min(MOST_AT_ONCE_MS, performance.now() - before));
          this.animate();
        }),
      prefersLessMotion() ? CALM_FRAME_MS : FRAME_MS,
    );
  }

  // Whatever the queue decides may be a new run.
  async followQueue() {
    const onEvent = () => {
      this.refreshSoon();
      this.operator?.refresh();
      if (this.regeneration) this.regeneration.look();
    };
    try {
      await this.client.follow("/v1/queue/events", { after: "now", signal: new AbortController().signal, onEvent });
    } catch (error) {
      this.trouble(`The page cannot follow the queue: ${error.message}.`);
    }
  }

  // The service is there again.
  back() {
    this.draft.recheck();
    if (this.service.queue) this.runs.refresh();
    if (this.regeneration) this.regeneration.look();
  }
}

// -- keys; those of plans are the keys of a report ----------------------------------------------

const LIVE_PANE_KEYS = [
  [["Ctrl+Enter"], "in the editor: run the plan"],
  [["↑", "↓", "←", "→"], "in the tree: move, open and close; in the automaton: move it"],
  [["Enter"], "open or fold what is selected"],
  [["+", "-"], "in the automaton: zoom"],
];

// -> {dialog}: the overlay that explains the keys, to be put into the page.
export function mountLiveKeys(page) {
  const onStore = (run) => () => page.store() && run(page.store());
  const onRun = (run) => () => page.shown === "run" && page.stage && run(page.stage, page.watch);
  const forward = (direction) => () => {
    if (page.shown === "run" && page.watch) page.watch.step(direction);
    else if (page.draftPlayer()) page.draftPlayer()[direction > 0 ? "step" : "back"]();
  };
  const toggle = () => {
    if (page.shown === "run" && page.watch) page.stage.toggle();
    else if (page.draftPlayer()) page.draftPlayer().toggle();
  };
  const bindings = [
    { key: "e", word: "to the editor", run: () => page.goTo("editor") },
    { key: "r", word: "to the runs", run: () => page.goTo("runs") },
    { key: "/", word: "search", run: () => page.search && page.search.focus() },
    { key: "n", word: "next finding", run: onStore((store) => stepFinding(store, 1)) },
    { key: "p", word: "previous finding", run: onStore((store) => stepFinding(store, -1)) },
    { key: " ", word: "pause or resume the run; play or stop a replay", run: toggle },
    { key: ".", word: "step forward", run: forward(1) },
    { key: ",", word: "step back", run: forward(-1) },
    { key: "l", word: "follow the run live", run: onRun((_, watch) => watch.attach()) },
    { key: "x", word: "make the selected runner fail, if it is running", run: onRun((stage) => stage.failSelected()) },
    { key: "f", word: "show the whole automaton", run: () => page.graph() && page.graph().fit() },
    { key: "1", word: "to the findings", run: () => page.details.choose("findings", true) },
    { key: "2", word: "to the tree", run: () => page.details.choose("tree", true) },
    { key: "3", word: "to the automaton", run: () => page.graph() && page.graph().element.focus() },
    { key: "4", word: "to the text", run: () => page.details.choose("text", true) },
    { key: "Escape", word: "select nothing", run: onStore((store) => store.selectElement(-1)) },
    { key: "t", word: "theme", run: () => page.theme.next() },
    { key: "?", word: "these keys", run: () => dialog.showModal() },
  ];
  const dialog = helpDialog(bindings, LIVE_PANE_KEYS);
  bindKeys(bindings);
  return { dialog };
}

// -- what becomes of a plan that gave up: a model is asked, answers are refused, a new plan arrives.

const ANSWER_POLL_MS = 2000;

function attemptLine(attempt) {
  const findings = attempt.findings || [];
  if (attempt.accepted) return `Answer ${attempt.round}: accepted`;
  const first = findings[0] ? `${findings[0][0]} ${findings[0][1]}` : "it holds no plan";
  const more = findings.length > 1 ? `, and ${findings.length - 1} more` : "";
  return `Answer ${attempt.round}: refused, ${first}${more}`;
}

// Looks until it is decided whether another plan goes on from here. onNext(run) is called with its run,
// if that is to be followed; who looks at a past run stays there.
// -> {look, stop}; `look` looks at once.
export function watchRegeneration({ client, watch, follow, service, tell, onNext }) {
  const shared = { timer: 0, stopped: false, looking: false };

  async function look() {
    clearTimeout(shared.timer);
    if (shared.stopped || shared.looking || watch.running || watch.state !== "GAVE_UP") return;
    shared.looking = true;
    let decided = false;
    try {
      decided = show(await client.get(`/v1/runs/${watch.info.run}?records=1`));
    } catch (error) {
      if (error.name === "AbortError") return;
    } finally {
      shared.looking = false;
    }
    if (!decided && !shared.stopped) shared.timer = setTimeout(look, ANSWER_POLL_MS);
  }

  // Whether nothing more will come.
  function show(run) {
    if (shared.stopped) return true;
    const { regeneration } = run;
    if (run.continued_by_run) {
      const attempts = regeneration ? regeneration.attempts.map(attemptLine) : [];
      tell(`The plan gave up; run ${run.continued_by_run} continues from here.`, attempts);
      watch.info.continued_by_run = run.continued_by_run;
      if (follow) onNext(run.continued_by_run);
      return true;
    }
    if (!regeneration) return !service.regenerates;
    const lines = regeneration.attempts.map(attemptLine);
    if (regeneration.accepted === false) {
      tell(`The plan gave up, and no other plan continues: ${regeneration.message || "no answer was accepted"}.`, lines);
      return true;
    }
    if (regeneration.accepted === null) {
      tell(`The plan gave up. Asking ${regeneration.model} for a plan that continues from here …`, lines);
    } else {
      tell("The plan gave up. A new plan was accepted and starts now …", lines);
    }
    return false;
  }

  look();
  return {
    look,
    stop() {
      shared.stopped = true;
      clearTimeout(shared.timer);
    },
  };
}

const page = new Page(document.getElementById("gpsfsm-live"));
onFailure((text) => page.trouble(`An error in this page: ${text}.`));
page.begin();
