// What an operator of a robot needs at any time: a button that stops everything, and whether plans may
// begin. It is there only where real runners act.

import { el, replaceContent, visibleText } from "./dom.js";

const LOOK_MS = 2000;
const LONGEST_STOP_MS = 15000;

// mountOperator(head, {client, onTrouble}) -> {refresh}; the button goes into the head of the page, what
// it says below that.
export function mountOperator(head, { client, onTrouble }) {
  const button = el(
    "button",
    { class: "stop-button", type: "button", title: "Cancel all goals of the robot and the running plan, and hold the queue", onclick: stop },
    "STOP",
  );
  const banner = el("div", { class: "held-banner", role: "alert", hidden: true });
  head.append(button);
  head.after(banner);
  const shared = { drawn: "", trouble: "", stopping: false, looking: false, again: false };

  // It runs by itself: whatever else the page waits for does not hold it up.
  async function stop() {
    shared.stopping = true;
    shared.trouble = "";
    button.textContent = "STOPPING";
    try {
      await client.post("/v1/stop", undefined, { signal: AbortSignal.timeout(LONGEST_STOP_MS) });
    } catch (error) {
      shared.trouble = `The stop is not confirmed: ${error.message}. Use the robot's own emergency stop.`;
    } finally {
      shared.stopping = false;
      button.textContent = "STOP";
    }
    shared.drawn = "";
    draw({ held: shared.trouble ? "a stop was requested" : "", waiting: 0, stopper: "off" });
    await refresh();
  }

  // Only the reason that the operator has read: another stop may have come since.
  async function release(held) {
    try {
      const answer = await client.post("/v1/queue/release", { held });
      shared.trouble = "";
      if (answer.held) onTrouble("The queue is still held, for a new reason. Read it, then release again.");
    } catch (error) {
      onTrouble(`The queue is not released: ${error.message}.`);
    }
    await refresh();
  }

  function draw({ held, waiting, stopper }) {
    const missing = stopper === "down" ? "The process that stops the robot is not running. " : "";
    const key = [held, waiting, stopper, shared.trouble].join("\n");
    if (key === shared.drawn) return;
    shared.drawn = key;
    banner.hidden = !(held || missing || shared.trouble);
    const plans = waiting === 0 ? "none is waiting" : waiting === 1 ? "1 is waiting" : `${waiting} are waiting`;
    const parts = [];
    if (shared.trouble) parts.push(el("strong", { class: "held-trouble" }, visibleText(shared.trouble)));
    if (missing) parts.push(el("strong", { class: "held-trouble" }, missing));
    if (held) {
      parts.push(
        el("span", {}, el("strong", {}, "The queue is held: "), `${visibleText(held)}. No plan starts until you release it; ${plans}.`),
        el("button", { class: "button release-button", type: "button", onclick: () => release(held) }, "Release the queue"),
      );
    }
    replaceContent(banner, parts);
  }

  async function refresh() {
    if (shared.looking) {
      shared.again = true;
      return;
    }
    shared.looking = true;
    try {
      draw(await client.get("/v1/queue"));
    } catch {
      // the page says that the service cannot be reached; what was held stays so
    } finally {
      shared.looking = false;
    }
    if (shared.again) {
      shared.again = false;
      await refresh();
    }
  }

  setInterval(refresh, LOOK_MS);
  refresh();
  return { refresh };
}
