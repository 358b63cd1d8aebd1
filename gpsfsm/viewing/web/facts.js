// What the analyses found out about a plan, in one line.

import { counted } from "./dom.js";

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
    for (const [name, word] of ENDS_SAID) if (facts[name]) words.push(`${word}: ${facts[name]}`);
  }
  if (plan.engine && plan.engine !== "paper") words.push(`engine ${plan.engine}`);
  if (!automaton && !facts) words.push("not analysed");
  return words.join(" · ");
}
