// The entry of a report: reads the view document out of the page and shows it.

import { mountCompare } from "./compare.js";
import { clipPath, counted, el, onFailure, pathWords, replaceContent, visibleText } from "./dom.js";
import { filterOf } from "./findings.js";
import { LINK_REFUSED, bindAddress, elementKey, elementOfKey, findingKey, findingOfKey } from "./fragment.js";
import { mountGraph } from "./graph.js";
import { bindKeys, helpDialog } from "./keys.js";
import { planStage } from "./planview.js";
import { mountSearch } from "./search.js";
import { mountSource } from "./source.js";
import { createStore, unpack } from "./state.js";
import { mountSummary, verdictBadge } from "./summary.js";
import { themeButton } from "./theme.js";
import { frequency } from "./words.js";

const MOST_MESSAGES = 5;
const PANE_KEYS = [
  [["↑", "↓", "←", "→"], "in the tree: move, open and close; in the automaton: move it"],
  [["Enter"], "open or fold what is selected"],
  [["+", "-"], "in the automaton: zoom"],
];

function start() {
  const app = document.getElementById("app") || document.body;
  const messages = el("div", { class: "page-messages", role: "alert" });
  const tell = messageTeller(messages);
  onFailure(tell);
  try {
    const viewDocument = unpack(JSON.parse(document.getElementById("gpsfsm-view")?.textContent || ""));
    const page = new ReportPage(app, messages, tell, viewDocument);
    page.open();
    globalThis.gpsfsmPage = page; // for the console, and for measurements
    performance.mark("gpsfsm-open");
  } catch (error) {
    app.append(messages);
    tell(`The report cannot be shown: ${error.message}`);
    console.error(error);
  }
}

function messageTeller(box) {
  return (text) => {
    if (box.children.length >= MOST_MESSAGES) return;
    box.append(el("p", { class: "page-error" }, `An error in this page: ${text}`));
  };
}

class ReportPage {
  /** @type {HTMLElement[]} */
  tabs = [];
  /** @type {ReturnType<typeof mountSearch>} */
  search;
  /** @type {ReturnType<typeof bindAddress>} */
  address;

  constructor(app, messages, tell, viewDocument) {
    this.app = app;
    this.messages = messages;
    this.tell = tell;
    this.viewDocument = viewDocument;
    this.store = createStore(viewDocument);
    this.view = "";
    this.first = "plan"; // the view with which the report opens
    /** @type {Record<string, any>} */
    this.stages = {};
  }

  open() {
    const { plans, diff } = this.viewDocument;
    this.theme = themeButton();
    this.bindings = this.keys();
    this.help = helpDialog(this.bindings, PANE_KEYS);
    this.notes = el("div", { class: "notes", hidden: true });
    this.stage = el("main", { class: "stage" });
    this.app.append(this.header(), this.messages, this.notes, this.stage, this.help);
    this.store.subscribe(["plan"], () => this.describe());
    bindKeys(this.bindings);
    this.describe();
    this.first = diff ? "compare" : plans.length > 1 ? "summary" : "plan";
    this.address = bindAddress({
      names: ["view", "plan", "finding", "element", "play", "step"],
      state: () => this.shown(this.store.state.finding),
      show: (values) => this.showLinked(values),
      refuse: () => this.refuse(),
    });
    this.store.link = (number) => this.address.link({ ...this.shown(number), element: undefined });
    this.address.open();
    this.store.subscribe(["plan"], () => this.address.write(true));
    this.store.subscribe(["finding"], (state) => this.address.write(state.finding >= 0));
    this.store.subscribe(["frame", "play", "element"], () => this.address.writeSoon());
  }

  // -- its address

  // What is shown, as an address has it, with one of the findings.
  shown(number) {
    const { store, view } = this;
    const { player, opening } = this.stages[view]?.made || {};
    if (view !== "plan") {
      const number = player?.progress.number;
      return { view: view === this.first ? undefined : view, step: number === opening ? undefined : number };
    }
    const { play } = store.state;
    const isOfTask = store.state.playOrigin?.kind === "task";
    const isPlayed = play && (isOfTask || store.plan.plays[store.plan.findings[number]?.play] === play);
    // A finding has chosen its element already, and a play goes from one to the next.
    const isOwn = play || store.plan.findings[number]?.element === store.state.element;
    return {
      plan: this.first === "plan" ? undefined : store.state.plan + 1,
      finding: findingKey(store.plan, number),
      element: isOwn ? undefined : elementKey(store.plan, store.state.element),
      play: isPlayed && isOfTask ? "task" : undefined,
      step: isPlayed ? player.progress.number : undefined,
    };
  }

  // Shows what a link says; false if something of it is not in the report.
  showLinked({ view = "", plan = "", finding = "", element = "", play = "", step = "" }) {
    const { store } = this;
    const number = Number(plan || store.state.plan + 1) - 1;
    const { plans, diff } = this.viewDocument;
    const isPlan = plan || finding || element || play || view === "plan";
    const wanted = isPlan ? "plan" : view || this.first;
    const there = { plan: Boolean(plans[number]), summary: plans.length > 1, compare: Boolean(diff) };
    if (!there[wanted]) {
      this.show(this.view || this.first);
      return false;
    }
    if (number !== store.state.plan) store.showPlan(number);
    this.show(wanted);
    const { player, opening } = this.stages[wanted].made;
    if (wanted !== "plan") {
      if (player) player.seekStep(step ? Number(step) : opening);
      return Boolean(player) || !step;
    }
    const isThere = this.showFinding(finding, play, step, player);
    return this.showElement(element, finding) && isThere;
  }

  showElement(key, finding) {
    const { store } = this;
    const index = key ? elementOfKey(store.plan, key) : -1;
    if (index >= 0 || !finding) store.selectElement(index, "link");
    return !key || index >= 0;
  }

  showFinding(key, play, step, player) {
    const { store } = this;
    const index = key ? findingOfKey(store.plan, key) : -1;
    if (index >= 0) {
      const filter = filterOf(store.plan.findings[index]);
      if (!store.state.severities[filter]) store.set({ severities: { ...store.state.severities, [filter]: true } });
    }
    if (index !== store.state.finding) store.selectFinding(index);
    const played = play ? store.plan.task?.play : store.plan.findings[index]?.play;
    const scenario = step && player ? store.plan.plays[played] || null : null;
    if (scenario !== store.state.play) {
      store.openPlay(scenario, play ? { kind: "task", index: 0 } : { kind: "finding", index });
    }
    if (scenario) {
      player.pause();
      player.seekStep(Number(step));
    }
    return (!key || index >= 0) && (scenario ? Number(step) <= player.progress.of : !step && !play);
  }

  refuse() {
    const close = () => notice.remove();
    const notice = el(
      "p",
      { class: "page-notice", role: "status" },
      LINK_REFUSED,
      el("button", { type: "button", class: "plain", onclick: close }, "Close"),
    );
    this.app.querySelector(".page-notice")?.remove();
    this.messages.after(notice);
  }

  // -- the head

  header() {
    const { plans, diff } = this.viewDocument;
    this.chooser = plans.length > 1 ? this.planChooser() : null;
    this.name = el("span", { class: "plan-name" });
    this.verdict = el("span", { class: "of-plan" });
    this.facts = el("span", { class: "top-facts of-plan" });
    const views = [["plan", "One plan"]];
    if (plans.length > 1) views.unshift(["summary", plans.length > 2 ? `All ${plans.length} plans` : "Both plans"]);
    if (diff) views.unshift(["compare", "Compare"]);
    this.tabs = views.map(([view, word]) =>
      el("button", { type: "button", dataset: { view }, onclick: () => this.show(view) }, word),
    );
    const searchBox = el("div", { class: "search-place of-plan" });
    const head = el(
      "header",
      { class: "top" },
      el("h1", { class: "brand" }, "gpsfsm"),
      views.length > 1 ? el("nav", { class: "views", "aria-label": "Views" }, this.tabs) : null,
      this.chooser || this.name, this.verdict, this.facts, searchBox,
      el(
        "div",
        { class: "tools" },
        this.theme,
        el(
          "button",
          { type: "button", class: "tool", title: "Keys (?)", "aria-label": "Keys (?)", onclick: () => this.help.showModal() },
          "?",
        ),
      ),
    );
    this.search = mountSearch(searchBox, this.store);
    return head;
  }

  planChooser() {
    const options = this.viewDocument.plans.map((plan, number) =>
      el("option", { value: number, title: visibleText(plan.name) }, clipPath(visibleText(plan.name), 44)),
    );
    const chooser = el("select", { class: "plan-chooser of-plan", "aria-label": "Plan" }, options);
    chooser.addEventListener("change", () => this.openPlan(Number(chooser.value)));
    return chooser;
  }

  describe() {
    const { plan } = this.store;
    if (this.chooser) this.chooser.value = String(this.store.state.plan);
    replaceContent(this.name, pathWords(plan.name));
    this.name.title = visibleText(plan.name);
    replaceContent(this.verdict, verdictBadge(plan.verdict));
    this.facts.textContent = factsLine(plan);
    this.facts.title = this.facts.textContent;
    replaceContent(this.notes, plan.notes.map((note) => el("p", {}, visibleText(note))));
    this.notes.hidden = !plan.notes.length;
  }

  // -- the views

  show(view) {
    if (this.view === view) return;
    this.view = view;
    for (const tab of this.tabs) tab.setAttribute("aria-pressed", String(tab.dataset.view === view));
    this.app.dataset.view = view;
    for (const [name, stage] of Object.entries(this.stages)) stage.box.hidden = name !== view;
    if (!this.stages[view]) this.stages[view] = this.makeStage(view);
    this.stages[view].redraw();
    this.address.write(true);
  }

  makeStage(view) {
    const box = el("div", { class: `stage stage-${view}` });
    this.stage.append(box);
    const make = {
      plan: () => planStage(box, this.store, this.tell),
      summary: () =>
        mountSummary(box, this.viewDocument, {
          onOpen: (number) => this.openPlan(number),
          current: () => this.store.state.plan,
        }),
      compare: () =>
        mountCompare(box, this.viewDocument, {
          mountPlan: (container, store) =>
            store.plan.automaton ? mountGraph(container, store) : mountSource(container, store),
          onOpen: (number) => this.openPlan(number),
        }),
    };
    try {
      const made = make[view]();
      if (view === "compare") made.player.subscribe(() => this.address.writeSoon());
      return { box, made, redraw: () => made.redraw && made.redraw() };
    } catch (error) {
      this.tell(`${view}: ${error.message}`);
      console.error(error);
      return { box, made: {}, redraw: () => {} };
    }
  }

  openPlan(number) {
    if (number !== this.store.state.plan) this.store.showPlan(number);
    this.show("plan");
  }

  // -- keys

  keys() {
    const plan = (run) => () => {
      this.show("plan");
      run(this.stages.plan.made);
    };
    const playing = (run) => () => {
      const { made } = this.stages[this.view];
      if (made && made.player) run(made.player);
    };
    const { plans } = this.viewDocument;
    const several = plans.length > 1;
    return [
      { key: "/", word: "search", run: plan(() => this.search.focus()) },
      { key: "n", word: "next finding", run: plan((made) => made.stepFinding(1)) },
      { key: "p", word: "previous finding", run: plan((made) => made.stepFinding(-1)) },
      { key: "o", word: "play the selected finding's scenario", run: plan((made) => made.openPlay()) },
      { key: " ", word: "play or pause", run: playing((player) => player.toggle()) },
      { key: ".", word: "step forward", run: playing((player) => player.step()) },
      { key: ",", word: "step back", run: playing((player) => player.back()) },
      { key: "f", word: "show the whole automaton", run: plan((made) => made.graph.fit()) },
      { key: "s", word: "show the selection in the automaton", run: plan((made) => made.graph.showSelection()) },
      { key: "1", word: "to the findings", run: plan((made) => made.focus("findings")) },
      { key: "2", word: "to the tree", run: plan((made) => made.focus("tree")) },
      { key: "3", word: "to the automaton", run: plan((made) => made.focus("graph")) },
      { key: "4", word: "to the text", run: plan((made) => made.focus("source")) },
      several && { key: "]", word: "next plan", run: () => this.stepPlan(1) },
      several && { key: "[", word: "previous plan", run: () => this.stepPlan(-1) },
      { key: "Escape", word: "select nothing", run: () => this.store.selectElement(-1) },
      { key: "t", word: "theme", run: () => this.theme.next() },
      { key: "?", word: "these keys", run: () => this.help.showModal() },
    ].filter(Boolean);
  }

  stepPlan(by) {
    const { length } = this.viewDocument.plans;
    this.openPlan((this.store.state.plan + by + length) % length);
  }
}

// -- what the analyses found out about a plan, in one line ---------------------------------------

const ENDS_SAID = [
  ["completes", "completes"],
  ["gives_up", "gives up"],
  ["stuck", "gets stuck"],
];

// factsLine(plan) -> "12 runners · completes: sometimes · gives up: sometimes · gets stuck: never"
export function factsLine(plan) {
  const { facts, automaton } = plan;
  const runners = facts
    ? facts.runners
    : plan.elements.filter((element) => element.kind === "runner").length;
  const words = [counted(runners, "runner")];
  if (facts) {
    for (const [name, word] of ENDS_SAID) if (facts[name]) words.push(`${word}: ${frequency(facts, name)}`);
  }
  if (plan.engine && plan.engine !== "paper") words.push(`engine ${plan.engine}`);
  if (!automaton && !facts) words.push("not analysed");
  return words.join(" · ");
}

start();
