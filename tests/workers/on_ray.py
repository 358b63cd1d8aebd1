"""Checks plans on a Ray cluster, and waits in between until a machine of it has been lost.

After the first chunk no plan is done before that has happened, so both machines have one in hand.
Standard output is the report; standard error says "kill" after some results, and in the end how
many chunks were lost with a machine, what became of an item that ends its process, the grades, and
what a campaign finds here and there.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.api import check_options
from gpsfsm.checking.inputs import find_inputs
from gpsfsm.checking.parallel import CheckItem, CheckWork, items_of
from gpsfsm.fuzzing import run_campaign, subject_of
from gpsfsm.fuzzing.properties import default_properties
from gpsfsm.grading.grader import grade_inputs
from gpsfsm.model.report import Report
from gpsfsm.report import render
from gpsfsm.tasks.load import load_task
from gpsfsm.workers import Lost, map_items
from gpsfsm.workers.builtin.ray import RayCluster
from tests.workers.works import Double

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.report import PlanReport

RESULTS_BEFORE = 8
CHUNK = 11
"""82 inputs for two cores."""
LOST = Path("lost").absolute()
TIMEOUT_S = 120


@dataclass(frozen=True)
class Waiting:
    """Checks a plan; all but those of the first chunk wait for the file ``lost``."""

    check: CheckWork
    lost: Path

    def __call__(self, item: CheckItem) -> PlanReport:
        import ray

        if int(Path(item[0]).stem[1:]) >= CHUNK:
            node = ray.get_runtime_context().get_node_id()
            self.lost.with_name(f"at-{node}").touch()
            await_that(self.lost.exists)
        return self.check(item)


def await_that(holds: Any) -> None:
    until = time.monotonic() + TIMEOUT_S
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.02)


class Watched(RayCluster):
    """Counts what is lost with a machine, and how many chunks are under way."""

    lost = 0

    def map(self, work: Any, source: Any) -> Iterator[tuple[Any, Any]]:
        for chunk, results in super().map(work, source):
            self.lost += isinstance(results, Lost) and results.with_node
            yield chunk, results


def main() -> None:
    options = check_options()
    inputs = list(find_inputs(["plans", "missing.xml"]))
    engine = Watched("ray", len(inputs))
    engine._ray.init(logging_level="ERROR", log_to_driver=False)  # once for all that follows
    reports = []
    texts = items_of(inputs, options.limits)
    for report in map_items(engine, Waiting(CheckWork(options), LOST), texts, lost=lambda *_: None):
        reports.append(report)
        if len(reports) == RESULTS_BEFORE:
            assert engine.chunk_size == CHUNK
            await_that(lambda: len(list(Path().glob("at-*"))) == 2)
            print("kill", file=sys.stderr, flush=True)
            sys.stdin.readline()
            LOST.touch()
    sys.stdout.write(render(Report(tuple(reports)), "json"))
    task = load_task("task.yaml")
    grades = [one.grade.value for one in grade_inputs(inputs[:-1], task, options, jobs="ray")]
    items = [*range(12), "die", *range(12)]
    doubled = list(map_items(RayCluster("ray", 25), Double(), items, lost=lambda _, how: how))
    campaigns = [fuzzed(jobs) for jobs in (1, "ray")]
    print(json.dumps([engine.lost, doubled, grades, campaigns]), file=sys.stderr)


def fuzzed(jobs: int | str) -> list[tuple[str, str, list[int]]]:
    """What a campaign finds: the property, the breach, and who fails in the plainest run."""
    go = "".join(f'<Runner interface="a/{name}" provider="a/{name}"/>' for name in "ABC")
    subject = subject_of(f'<Plan><Control type="parallel_any">{go}</Control></Plan>')
    campaign = run_campaign(subject, default_properties(), runs=200, jobs=jobs)
    assert campaign.runs == 200
    return [
        (failure.broken.name, failure.breach.message, list(failure.run.scenario.faults))
        for failure in campaign.failures
    ]


if __name__ == "__main__":
    main()
