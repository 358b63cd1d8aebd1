// The plan that is being written: the editor, what the check says while one types, how a
// task becomes a plan, and how the plan is run.

import { ServiceError } from "./client.js";
import { counted, debounce, el, replaceContent, sign, visibleText } from "./dom.js";
import { packText } from "./draftlink.js";
import { createEditor } from "./editor.js";
import { copyButton } from "./saving.js";
import { unpack } from "./state.js";

const QUIET_MS = 350;
const KEPT = "gpsfsm-draft";
const LONGEST_KEPT = 200000;

export const RUN_SPEEDS = [
  ["0.25", "¼ of real time"],
  ["0.5", "½ of real time"],
  ["1", "real time"],
  ["2", "2 × real time"],
  ["5", "5 × real time"],
  ["20", "20 × real time"],
  ["0", "without waiting"],
];

const EXAMPLE = `<Plan name="to_the_kitchen">
  <Runner interface="nav2_capabilities/WaypointRunner"
          provider="nav2_capabilities/WaypointRunner" x="2.0" y="1.0"/>
  <Control type="recovery">
    <Runner interface="perception_capabilities/SpeechRunner"
            provider="perception_capabilities/SpeechRunner" text="I cannot get there."/>
  </Control>
  <Control type="parallel_all" name="arrive">
    <Runner interface="perception_capabilities/SpeechRunner"
            provider="perception_capabilities/SpeechRunner" text="Here I am. What is your name?"/>
    <Runner interface="perception_capabilities/ImageAnalysisRunner"
            provider="perception_capabilities/ImageAnalysisRunner" prompt="What do you see?"/>
  </Control>
</Plan>
`;

export function speedChoice(label, chosen, onchange) {
  const isListed = RUN_SPEEDS.some(([value]) => Number(value) === chosen);
  const rows = isListed ? RUN_SPEEDS : [...RUN_SPEEDS, [String(chosen), `${chosen} × real time`]];
  const options = rows.map(([value, words]) => el("option", { value, selected: Number(value) === chosen }, words));
  return el("select", { "aria-label": label, title: label, onchange }, options);
}

// hooks: onDocument(document), onCaretLine(line), onQueued(planAnswer), onWorld(name), onTrouble(text),
//   link(code): the address that opens a text, which draftlink.js has packed
export function mountDraft(container, { client, service, hooks }) {
  /** @type {{number: number, checking: AbortController | null, asking: AbortController | null, before: string, checked: any, code: string}} */
  const shared = { number: 0, checking: null, asking: null, before: "", checked: null, code: "" };
  const status = el("p", { class: "draft-status", role: "status" });
  const name = el("input", {
    class: "draft-name",
    type: "text",
    value: "plan.xml",
    maxlength: 200,
    spellcheck: "false",
    "aria-label": "Name of the plan",
  });
  const file = el("input", { type: "file", accept: ".xml,.json,.txt,text/xml,text/plain,application/json", hidden: true });
  const refusal = el("div", { class: "draft-refusal", role: "alert", hidden: true });
  const sheet = el("div", { class: "draft-sheet" });
  const task = taskPart();
  const start = startPart();
  const openButton = el("button", { class: "button", type: "button", onclick: () => file.click() }, "Open…");
  const example = el("button", { class: "button", type: "button", onclick: showExample }, "Example");
  const link = copyButton("Copy link", "Copy link: it opens this text", () => hooks.link(shared.code));
  link.hidden = true;
  container.append(
    task.row,
    el("div", { class: "draft-tools" }, name, openButton, example, file),
    sheet,
    refusal,
    el("div", { class: "draft-foot" }, el("div", { class: "draft-said" }, status, link), start.row),
  );
  const editor = createEditor(sheet, {
    onInput: edited,
    onCaretLine: hooks.onCaretLine,
    onFile: (dropped) => {
      name.value = nameOf(dropped);
    },
    onTrouble: hooks.onTrouble,
  });
  const checkSoon = debounce(check, QUIET_MS);
  const keepSoon = debounce(() => keepText(editor.text()), QUIET_MS);
  addEventListener("pagehide", () => keepText(editor.text()));

  file.addEventListener("change", () => {
    editor.takeFile(file.files[0]);
    file.value = "";
  });
  editor.area.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
      event.preventDefault();
      run();
    }
  });

  function say(text, kind = "") {
    status.className = `draft-status ${kind}`;
    status.textContent = text;
  }

  function refuse(title, lines = []) {
    refusal.hidden = !title;
    if (!title) return;
    const list = lines.length ? el("ul", {}, lines.slice(0, 20).map((line) => el("li", {}, visibleText(line)))) : null;
    replaceContent(refusal, el("strong", {}, visibleText(title)), list);
  }

  function edited() {
    refuse("");
    keepSoon();
    shared.number += 1;
    shared.code = "";
    link.hidden = true;
    if (shared.checking) shared.checking.abort();
    if (!editor.text().trim()) {
      editor.setMarks([]);
      say("Nothing to check yet.");
      hooks.onDocument(null);
      return;
    }
    say("Checking …", "busy");
    checkSoon();
  }

  async function check() {
    const number = shared.number;
    const plan = editor.text();
    if (!plan.trim()) return;
    if (shared.checking) shared.checking.abort();
    const controller = new AbortController();
    shared.checking = controller;
    try {
      const body = { plan, name: nameOf(name.value) || "plan.xml" };
      const code = packText(plan).catch(() => ""); // an old browser packs nothing
      const view = unpack(await client.post("/v1/view", body, { signal: controller.signal }));
      const packed = await code;
      if (number !== shared.number) return;
      shared.code = packed;
      link.hidden = !packed;
      checked(view);
    } catch (error) {
      if (error.name === "AbortError" || number !== shared.number) return;
      notChecked(error, number);
    }
  }

  function checked(view) {
    shared.checked = view;
    const [plan] = view.plans;
    editor.setMarks(plan.findings.filter((each) => !each.suppressed && each.line > 0));
    const count = (severity) => plan.findings.filter((each) => !each.suppressed && each.severity === severity).length;
    const [errors, warnings] = [count("error"), count("warning")];
    const also = warnings ? `, ${counted(warnings, "warning")}` : "";
    if (errors) say(`✗ ${counted(errors, "error")}${also}`, "bad");
    else if (plan.verdict === "accepted") say(`✓ accepted${also}`, "good");
    else say("✗ undecided", "bad");
    hooks.onDocument(view);
  }

  function notChecked(error, number) {
    const waits = error instanceof ServiceError && (error.status === 429 || error.status === 503);
    if (waits) {
      say("The service is busy; trying again …", "busy");
      setTimeout(() => number === shared.number && check(), (error.retryAfter || 1) * 1000);
      return;
    }
    say(`Not checked: ${error.message}.`, "bad");
  }

  // -- from a task to a plan ------------------------------------------------------------------

  function taskPart() {
    const text = el("textarea", {
      class: "draft-task",
      rows: 2,
      maxlength: 100000,
      "aria-label": "Task",
      placeholder: service.model
        ? "Describe a task, and the model writes the plan."
        : "No language model: start the service with --model.",
      disabled: !service.model,
    });
    const button = el("button", { class: "button", type: "button", disabled: !service.model }, "Write a plan");
    const row = el("div", { class: "draft-task-row" }, text, button);
    button.addEventListener("click", () => (shared.asking ? shared.asking.abort() : generate()));
    return { row, text, button };
  }

  async function generate() {
    const wanted = task.text.value.trim();
    if (!wanted) {
      task.text.focus();
      return;
    }
    const controller = new AbortController();
    shared.asking = controller;
    const since = Date.now();
    task.button.textContent = "Stop writing";
    const tell = () => say(`${service.model} is writing: ${Math.round((Date.now() - since) / 1000)} s`, "busy");
    const clock = setInterval(tell, 1000);
    tell();
    try {
      const answer = await client.post("/v1/generate", { task: wanted }, { signal: controller.signal });
      generated(answer);
    } catch (error) {
      if (error.name === "AbortError") say("Stopped: no plan was written.");
      else refuse(`No plan was written: ${error.message}`);
      if (error.name !== "AbortError") say("");
    } finally {
      clearInterval(clock);
      shared.asking = null;
      task.button.textContent = "Write a plan";
    }
  }

  function generated(answer) {
    const attempts = `${answer.attempts} ${answer.attempts === 1 ? "answer" : "answers"}`;
    if (!answer.accepted) {
      say("");
      refuse(`No plan was accepted after ${attempts}.`, answer.reasoning ? [answer.reasoning] : []);
      return;
    }
    name.value = "generated.xml";
    replace(answer.plan);
  }

  // The text that was there is not lost.
  function replace(text) {
    shared.before = editor.text();
    editor.setText(text);
    edited();
    if (shared.before.trim() && shared.before !== text) offerBack();
  }

  function offerBack() {
    const back = el("button", { class: "button", type: "button" }, "Restore my text");
    back.addEventListener("click", () => {
      editor.setText(shared.before);
      edited();
    });
    refusal.hidden = false;
    replaceContent(refusal, "The new plan replaced your text. ", back);
  }

  function showExample() {
    replace(EXAMPLE);
  }

  // -- from a plan to a run -------------------------------------------------------------------

  function startPart() {
    const chosen = service.worlds.find((each) => each.default) || service.worlds[0];
    const options = service.worlds.map((each) => el("option", { value: each.world, selected: each === chosen }, each.title));
    const world = el("select", { "aria-label": "World", title: "World" }, options);
    world.addEventListener("change", () => hooks.onWorld(world.value));
    const seed = el("input", {
      class: "draft-seed",
      type: "number",
      value: 0,
      min: 0,
      max: 2147483647,
      step: 1,
      "aria-label": "Random seed",
      title: "Random seed: the same seed gives the same outcomes",
    });
    const speed = speedChoice("Speed of the run", service.speed || 1);
    world.hidden = speed.hidden = service.real; // the world is the real one
    const held = el("input", { type: "checkbox" });
    const words = service.real ? "Run for real" : "Run";
    const title = service.real ? "Run this plan on the robot (Ctrl+Enter)" : "Run this plan (Ctrl+Enter)";
    const button = el("button", { class: "button primary", type: "button", title }, [sign("play"), words]);
    button.addEventListener("click", run);
    if (!service.queue) {
      button.disabled = true;
      button.title = "This service runs no plans: start it with --journal";
    }
    const row = el(
      "div",
      { class: "draft-start" },
      world,
      el("label", { class: "draft-label" }, "seed", seed),
      speed,
      el("label", { class: "draft-label" }, held, "start paused"),
      button,
    );
    return { row, world, seed, speed, held, button };
  }

  async function run() {
    if (start.button.disabled) return;
    refuse("");
    if (!editor.text().trim()) {
      refuse("There is no plan to run.");
      return;
    }
    start.button.disabled = true;
    const speed = Number(start.speed.value);
    const simulated = service.real ? {} : { speed: speed || null, world: start.world.value };
    const seed = Math.max(0, Math.round(Number(start.seed.value)) || 0);
    const wanted = {
      plan: editor.text(),
      name: nameOf(name.value) || "plan.xml",
      start: { ...simulated, paused: start.held.checked, seed },
    };
    try {
      hooks.onQueued(await client.post("/v1/plans", wanted));
    } catch (error) {
      refuse(`The plan was not started: ${error.message}`, (error.problem && error.problem.rejected_list) || []);
    } finally {
      start.button.disabled = false;
    }
  }

  const kept = keptText();
  if (kept) {
    editor.setText(kept);
    edited();
  } else {
    say("Nothing to check yet.");
  }

  return {
    editor,
    run,
    replace,
    code: () => shared.code,
    world: () => start.world.value,
    // Checks again, since an answer may have been lost.
    recheck() {
      if (editor.text().trim()) check();
    },
    /** @param {string} text @param {string} label @param {{world?: string, seed?: number}} run */
    load(text, label, { world, seed } = {}) {
      editor.setText(text);
      name.value = nameOf(label);
      if (world && [...start.world.options].some((each) => each.value === world)) start.world.value = world;
      if (seed !== undefined) start.seed.value = seed;
      edited();
    },
  };
}

// A name as the service takes it.
function nameOf(text) {
  return text.replace(/[\u0000-\u001f\u007f]/gu, " ").slice(0, 200);
}

// A page that is loaded again, or a tab that crashed, has the text as it was.
function keepText(text) {
  try {
    if (text.length <= LONGEST_KEPT) sessionStorage.setItem(KEPT, text);
  } catch {
    // a browser that keeps nothing
  }
}

function keptText() {
  try {
    return sessionStorage.getItem(KEPT) || "";
  } catch {
    return "";
  }
}
