"""Random plans on the two engines: z3 against a brute force that plays the connections."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.engines.plans import plans
from tests.engines.test_facts import facts_of, frequency, reading_of
from tests.oracle.engine import Machine, scenarios

if TYPE_CHECKING:
    from collections.abc import Iterator

_ENGINES = ("fabric-v1", "fabric-v2")


def judge(case: tuple[str, str]) -> Iterator[str]:
    """How runs end on an engine, and which instances are never triggered."""
    engine, text = case
    reading = reading_of(text, engine)
    facts = facts_of(reading)
    machine = Machine(reading.connections)
    played = [machine.ends(scenario) for scenario in scenarios(machine)]
    ends = [one for one, _ in played]
    reached = set().union(*(some for _, some in played))
    assert facts.engine is not None
    for end, claimed in (
        ("COMPLETED", facts.completes),
        ("HANG", facts.engine.hangs),
        ("ABORT", facts.engine.aborts),
    ):
        assert claimed is frequency(ends, end), end
        yield f"{end} {claimed}"
    of_element = {
        each.source.element: number
        for number, each in machine.of.items()
        if number in machine.leaves
    }
    numbers = [of_element[element] for element in sorted(of_element)]  # in document order
    lost = tuple(
        reading.plan.path(runner)
        for runner, number in zip(reading.plan.runners, numbers, strict=True)
        if number not in reached
    )
    assert facts.unreachable == lost


PAIR = Pair(
    name="engines",
    about="random plans on the original engines: z3 against a brute force of the connections",
    cases=lambda: st.tuples(st.sampled_from(_ENGINES), plans()),
    judge=judge,
    text=lambda case: f"<!-- {case[0]} -->\n{case[1]}\n",
)
