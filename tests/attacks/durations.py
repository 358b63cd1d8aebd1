"""Runs that break what check says of time: of the end, of how long it takes, of orphans.

Plans over small libraries, with durations of 0, bounds that are parameters, values that arrive and
runners that do not start. Runs are played as ``fuzz`` plays them and as ``run --simulate`` does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.errors import UsageError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.fuzzing.runs import Moments, Run, play
from gpsfsm.fuzzing.subject import draw, subject_of
from gpsfsm.model.report import Frequency
from gpsfsm.simulation.makers import drawn_maker
from tests.campaigns.base import Pair
from tests.oracle import to_xml
from tests.strategies_capabilities import libraries, plans_over, races, to_library
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn, SearchStrategy

    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.report import Facts
    from tests.oracle import P
    from tests.oracle.capabilities import Described

_FAULTS = ((), ("no-start",), ("hang",), ("no-start", "hang"))
_TICK_S = 1e-6
"""Runs count in microseconds: a duration differs by less than one of them from what is declared."""


class Case(NamedTuple):
    """A plan, what is known about its runners, what may go wrong, and a seed for the runs."""

    whole: P
    library: tuple[Described, ...]
    faults: tuple[str, ...]
    seed: int


@st.composite
def _cases(draw: DrawFn) -> Case:
    if draw(st.booleans()):
        whole, library = draw(races())
    else:
        kinds = {"values": draw(st.booleans()), "outcomes": draw(st.booleans())}
        library = draw(libraries(clocks=True, **kinds))
        whole = draw(plans_over(library, max_runners=6))
    return Case(whole, library, draw(st.sampled_from(_FAULTS)), draw(st.integers(0, 9_999)))


def cases() -> SearchStrategy[Case]:
    """Plans with durations."""
    return _cases()


def judge(case: Case) -> Iterator[str]:
    """Every run ends as check says it may, when it may, and leaves no orphans but the told ones."""
    plan, library = plan_of(case.whole), to_library(case.library)
    try:
        # without a limit, which would end what hangs
        faults = ("failed", *case.faults)
        subject = subject_of(plan, faults=faults, limit_s=None, library=library)
    except UsageError:  # an instance of which no outcome is left
        yield "no scenario"
        return
    constraints = constraints_of(plan, faults=case.faults, bindings=subject.compiled.bindings)
    facts = decide(subject.compiled, constraints, AnalysisOptions(faults=case.faults)).facts()
    assert facts is not None, "fuzz plays a plan of which check knows no scenario"
    for index in range(12):
        played = play(subject, draw(subject, case.seed, index), seed=case.seed)
        yield from _compared(played, facts, "fuzz")
    if "no-start" not in case.faults:  # which would chain the units
        for seed in range(6):
            yield from _compared(_simulated(subject, case.seed + seed), facts, "run")


def _simulated(subject: Subject, seed: int) -> Run:
    """A run with runners whose outcomes are drawn."""
    kernel = Kernel(subject.compiled)
    sink = Moments(kernel)
    make = drawn_maker(subject.library, failure=0.4)
    VirtualDriver(kernel, sink, make, seed=seed).run()
    return Run(subject, subject.plain, tuple(sink.moments), kernel.status, sink.decided)


def _compared(run: Run, facts: Facts, by: str) -> Iterator[str]:
    ends = {"COMPLETED": facts.completes, "GAVE_UP": facts.gives_up, "STUCK": facts.stuck}
    end = run.status.value
    assert ends[end] is not Frequency.NEVER, f"{by}: {end}, which check says never happens"
    for other, how in ends.items():
        assert other == end or how is not Frequency.ALWAYS, f"{by}: {end}, not always {other}"
    yield f"{by} {end}"
    if end == "STUCK":
        return
    if facts.makespan is not None:
        most, inexact = facts.makespan.max, _TICK_S * len(run.plan.runners)
        assert run.at_s >= facts.makespan.min - inexact, f"{by}: over after {run.at_s} s"
        assert most is None or run.at_s <= most + inexact, f"{by}: over after {run.at_s} s"
        yield f"{by} in time"
    if end == "COMPLETED":
        left = {run.plan.path(run.runner(number)) for number in run.active_at_end}
        assert left <= set(facts.orphans), f"{by}: {left} are left, not {facts.orphans}"
        yield f"{by} with orphans" if left else f"{by} without orphans"


PAIR = Pair(
    name="durations",
    about="runs in virtual time against what check says of their end, their time and orphans",
    cases=cases,
    judge=judge,
    text=lambda case: f"<!-- {case.faults} {case.seed} {case.library} -->\n{to_xml(case.whole)}",
    full=4_000,
    few=30,
    attack=True,
)
