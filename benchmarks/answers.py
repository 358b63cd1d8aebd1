"""What fixes make of recorded answers of language models.

``python -m benchmarks.answers`` prints, per model, how many answers of the 300 that were asked for
plans are accepted at once, after safe fixes and after unsafe ones; and why the rest is rejected.

Right is a plan whose automaton is that of a plan for the same task that people called a success.
"""

from __future__ import annotations

import csv
import json
import os
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import ROOT, table
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import compile_plan
from gpsfsm.fixing import fix_text
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Verdict
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Iterator

CORPUS = Path(os.environ.get("GPSFSM_CORPUS", ROOT.parent / "shared/corpus")) / "experiment1"
OPTIONS = CheckOptions(from_response=True)
STAGES = ("at once", "after safe fixes", "after unsafe fixes")


@dataclass
class Counts:
    """The answers of one model."""

    answers: int = 0
    empty: int = 0
    accepted: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    rest: Counter[str] = field(default_factory=Counter)


def answers() -> Iterator[dict[str, Any]]:
    """The recorded answers to prompts that ask for a plan."""
    with (CORPUS / "responses.jsonl").open(encoding="utf-8") as file:
        for line in file:
            row = json.loads(line)
            if row["system"] == "fabric":
                yield row


def meaning(text: str) -> tuple[object, ...] | None:
    """The automaton with the parameters of its runners; None if the text is no plan."""
    plan = parse(text, from_response=True).plan
    if plan is None:
        return None
    automaton = compile_plan(plan).automaton
    names = ((runner.interface.rpartition("/")[2], runner.action[1:]) for runner in plan.runners)
    nodes = ((node.kind.value, node.need) for node in automaton.nodes)
    return tuple(names), tuple(nodes), tuple(automaton.edges)


def successes() -> dict[str, set[object]]:
    """By task: what the plans mean that people called a success."""
    found: dict[str, set[object]] = defaultdict(set)
    with (CORPUS / "labels.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["human"] != "S" or row["system"] != "fabric":
                continue
            plan = CORPUS / row["path"]
            if plan.exists():
                found[row["task"]].add(meaning(plan.read_text(encoding="utf-8")))
    for known in found.values():
        known.discard(None)
    return found


def measure() -> dict[str, Counts]:
    """All counts, by model."""
    right = successes()
    found: dict[str, Counts] = defaultdict(Counts)
    for row in answers():
        counts = found[f"{row['model']} {row['version']}"]
        text, task = row["response"], str(row["task"])
        counts.answers += 1
        counts.empty += not text.strip()
        safe = fix_text(text, OPTIONS)
        unsafe = fix_text(text, OPTIONS, unsafe=True)
        once = check_text(text, "answer", OPTIONS)
        stages = ((once, text), (safe.report, safe.text), (unsafe.report, unsafe.text))
        for stage, (report, plan) in zip(STAGES, stages, strict=True):
            accepted = report.verdict is Verdict.ACCEPT
            counts.accepted[stage] += accepted
            counts.right[stage] += accepted and meaning(plan) in right[task]
        report = unsafe.report
        if report.verdict is not Verdict.ACCEPT:
            errors = {each.rule for each in report.findings if each.severity is Severity.ERROR}
            counts.rest["no text" if not text.strip() else ", ".join(sorted(errors))] += 1
    return found


def rows(found: dict[str, Counts]) -> Iterator[list[str]]:
    """One row per model; in brackets how many of the accepted are right."""
    for model, counts in sorted(found.items()):
        cells = [f"{counts.accepted[each]} ({counts.right[each]})" for each in STAGES]
        rest = "; ".join(f"{rules}: {count}" for rules, count in counts.rest.most_common()) or "-"
        yield [model, str(counts.answers), str(counts.empty), *cells, rest]


def main() -> int:
    if not CORPUS.is_dir():
        print(f"the recorded answers are not here: {CORPUS}", file=sys.stderr)
        return 2
    head = ["model", "answers", "empty", *(f"accepted {each}" for each in STAGES), "rejected for"]
    print(table(head, rows(measure())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
