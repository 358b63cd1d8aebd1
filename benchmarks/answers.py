"""How many recorded answers of language models are accepted: at once, and after repairs?

The answers are those of a published experiment, in which three models were asked five tasks with
two prompts, ten times each. Right is a plan whose automaton is that of a plan for the same task
that people called a success. Nothing here depends on the machine.
"""

from __future__ import annotations

import csv
import json
import os
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import ROOT, table
from gpsfsm.analysis.rules import all_rules
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import compile_plan
from gpsfsm.fixing import fix_text
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Verdict
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.model.report import PlanReport

CORPUS = Path(os.environ.get("GPSFSM_CORPUS", ROOT.parent / "shared/corpus")) / "experiment1"
SYSTEM = "fabric"
MODELS = {"gpt-4o": "GPT-4o", "CodeLlama": "CodeLlama 7B", "Llama-2": "Llama 2 7B Chat"}
PROMPTS = {"zeroshot": "rules only", "oneshot": "rules and an example"}


STAGES = ("at once", "after safe fixes", "after unsafe fixes too")


@dataclass(frozen=True)
class Judged:
    """What becomes of an answer: the plan of each stage if it is accepted, else None.

    ``bare``: the answer is an accepted plan and nothing else. ``left`` are the rules of the errors
    after safe fixes.
    """

    empty: bool
    bare: bool
    plans: tuple[str | None, ...]
    left: tuple[str, ...]


@dataclass
class Tally:
    """Answers of a model to a prompt; ``accepted`` and ``right`` by stage."""

    answers: int = 0
    empty: int = 0
    bare: int = 0
    accepted: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    left: Counter[tuple[str, ...]] = field(default_factory=Counter)

    def add(self, judged: Judged, wanted: set[object]) -> None:
        self.answers += 1
        self.empty += judged.empty
        self.bare += judged.bare
        for stage, plan in zip(STAGES, judged.plans, strict=True):
            self.accepted[stage] += plan is not None
            self.right[stage] += plan is not None and meaning(plan) in wanted
        if judged.plans[1] is None:
            self.left[judged.left] += 1

    def cells(self) -> Iterator[str]:
        yield from map(str, (self.answers, self.empty, self.bare))
        yield from (f"{self.accepted[stage]} ({self.right[stage]})" for stage in STAGES)


def answers() -> Iterator[dict[str, Any]]:
    """The recorded answers to prompts that ask for a plan."""
    with (CORPUS / "responses.jsonl").open(encoding="utf-8") as file:
        yield from (row for row in map(json.loads, file) if row["system"] == SYSTEM)


def successes() -> dict[str, set[object]]:
    """By task: what the plans mean that people called a success."""
    outcomes: dict[str, set[object]] = defaultdict(set)
    with (CORPUS / "labels.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            plan = CORPUS / row["path"]
            if row["human"] == "S" and row["system"] == SYSTEM and plan.exists():
                outcomes[row["task"]].add(meaning(plan.read_text(encoding="utf-8")))
    for outcome in outcomes.values():
        outcome.discard(None)
    return outcomes


def meaning(text: str) -> tuple[object, ...] | None:
    """The automaton with the parameters of its runners; None if the text is no plan."""
    plan = parse(text, from_response=True).plan
    if plan is None:
        return None
    automaton = compile_plan(plan).automaton
    names = ((runner.interface.rpartition("/")[2], runner.action[1:]) for runner in plan.runners)
    nodes = ((node.kind.value, node.need) for node in automaton.nodes)
    return tuple(names), tuple(nodes), tuple(automaton.edges)


@cache
def judge(answer: str) -> Judged:
    options = CheckOptions(from_response=True, trees=False)
    safe, unsafe = fix_text(answer, options), fix_text(answer, options, unsafe=True)
    once = check_text(answer, "<answer>", options)
    stages = ((once, answer), (safe.report, safe.text), (unsafe.report, unsafe.text))
    return Judged(
        empty=not answer.strip(),
        bare=_passes(check_text(answer, "<answer>", CheckOptions(trees=False))),
        plans=tuple(text if _passes(report) else None for report, text in stages),
        left=() if not answer.strip() else _errors(safe.report),
    )


def _passes(report: PlanReport) -> bool:
    return report.verdict is Verdict.ACCEPTED


def _errors(report: PlanReport) -> tuple[str, ...]:
    wrong = {each.rule for each in report.findings if each.severity is Severity.ERROR}
    return tuple(sorted(wrong))


def tally(
    lines: Iterable[Mapping[str, Any]], right: Mapping[str, set[object]]
) -> dict[tuple[str, str], Tally]:
    """Count by model and prompt; ``right`` are the meanings that are, by task."""
    tallies: dict[tuple[str, str], Tally] = {}
    for line in lines:
        name = next(MODELS[part] for part in MODELS if part in line["api_model"])
        counted = tallies.setdefault((name, PROMPTS[line["prompt"]]), Tally())
        counted.add(judge(line["response"]), right.get(str(line["task"]), set()))
    return {key: tallies[key] for key in sorted(tallies)}


def total(tallies: Iterable[Tally]) -> Tally:
    whole = Tally()
    for each in tallies:
        whole.answers += each.answers
        whole.empty += each.empty
        whole.bare += each.bare
        whole.accepted += each.accepted
        whole.right += each.right
        whole.left += each.left
    return whole


def accepted_table(tallies: Mapping[tuple[str, str], Tally]) -> str:
    rows = [[f"{model}, {prompt}", *each.cells()] for (model, prompt), each in tallies.items()]
    head = ["model, prompt", "answers", "empty", "nothing but a good plan"]
    head += [f"accepted {stage} (right)" for stage in STAGES]
    return table(head, [*rows, ["all", *total(tallies.values()).cells()]])


def rejected_table(tallies: Mapping[tuple[str, str], Tally]) -> str:
    names = {rule.code: rule.name for rule in all_rules()}
    models = list(dict.fromkeys(model for model, _ in tallies))
    reasons: dict[tuple[str, ...], Counter[str]] = {}
    for (model, _), each in tallies.items():
        for rules, number in each.left.items():
            reasons.setdefault(rules, Counter())[model] += number
    ordered = sorted(reasons, key=lambda rules: (-reasons[rules].total(), rules))
    rows = [
        [_named(rules, names), *(str(reasons[rules][model]) for model in models)]
        for rules in ordered
    ]
    totals = [str(sum(reasons[rules][model] for rules in ordered)) for model in models]
    return table(["rejected after safe fixes, because of", *models], [*rows, ["all", *totals]])


def _named(rules: Sequence[str], names: Mapping[str, str]) -> str:
    links = (f"[{rule}](rules/{rule}.md) {names[rule]}" for rule in rules)
    return " and ".join(links) or "the answer is empty"


def main() -> int:
    if not CORPUS.is_dir():
        print(f"the recorded answers are not here: {CORPUS} (GPSFSM_CORPUS)", file=sys.stderr)
        return 2
    counts = tally(answers(), successes())
    print(accepted_table(counts))
    print()
    print(rejected_table(counts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
