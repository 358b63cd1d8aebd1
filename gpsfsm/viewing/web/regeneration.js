// What becomes of a plan that gave up: a model is asked, answers are refused, a new plan arrives.

const ANSWER_POLL_MS = 2000;

function attemptLine(attempt) {
  const findings = attempt.findings || [];
  if (attempt.accepted) return `Answer ${attempt.round}: accepted`;
  const first = findings[0] ? `${findings[0][0]} ${findings[0][1]}` : "it holds no plan";
  const more = findings.length > 1 ? `, and ${findings.length - 1} more` : "";
  return `Answer ${attempt.round}: refused, ${first}${more}`;
}

// Looks until it is decided whether another plan goes on from here. onNext(run) is told its run, if
// that is to be followed; who looks at a past run stays there.
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
  function show(found) {
    if (shared.stopped) return true;
    const { regeneration } = found;
    if (found.continued_by_run) {
      const attempts = regeneration ? regeneration.attempts.map(attemptLine) : [];
      tell(`The plan gave up; run ${found.continued_by_run} goes on from here.`, attempts);
      watch.info.continued_by_run = found.continued_by_run;
      if (follow) onNext(found.continued_by_run);
      return true;
    }
    if (!regeneration) return !service.regenerates;
    const lines = regeneration.attempts.map(attemptLine);
    if (regeneration.accepted === false) {
      tell(`The plan gave up, and no other goes on: ${regeneration.message || "no answer was accepted"}.`, lines);
      return true;
    }
    if (regeneration.accepted === null) {
      tell(`The plan gave up. ${regeneration.model} is asked how to go on from here …`, lines);
    } else {
      tell("The plan gave up. A new plan is accepted and begins at once …", lines);
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
