"""Random plans: whatever happens, it can be shown, and nothing that is shown is made up."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Record
from gpsfsm.execution.runner import RunContext, Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.watch.live import State, Tree
from gpsfsm.watch.moments import Moment, Tally, moments
from gpsfsm.watch.record_text import Words
from gpsfsm.watch.svg import timeline, to_svg
from tests.strategies import plans
from tests.support import plan_of
from tests.watch.support import Nowhere

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from tests.oracle import P


class Chance(Runner):
    async def run(self, _: Mapping[str, RunValue], context: RunContext) -> None:
        await context.sleep(context.random.uniform(0.0, 3.0))
        if context.random.random() < 0.4:
            raise RunnerError("no luck")


@given(plans(), st.integers(0, 5), st.one_of(st.none(), st.integers(0, 4_000_000)))
def test_what_is_shown_is_what_was_recorded(plan: P, seed: int, cancel_us: int | None) -> None:
    kernel = Kernel(compile_plan(plan_of(plan)))
    words, tree, tally = Words(kernel.automaton, kernel.runners), Tree(kernel.automaton), Tally()
    seen: list[Moment] = []

    def watch(at_us: int, happened: Input, records: Sequence[Record]) -> None:
        seen.extend(moments(at_us, happened, records))
        tree.add(at_us, records)
        tally.add(at_us, records)

    driver = VirtualDriver(kernel, Nowhere(), lambda *_: Chance(), seed=seed)
    driver.watchers.append(watch)
    if cancel_us is not None:
        driver.at(cancel_us, lambda: driver.cancel("enough"))
    driver.run()

    count = {kind: sum(moment.record.kind is kind for moment in seen) for kind in Kind}
    assert tally.status is kernel.status
    assert (tally.started, tally.succeeded) == (count[Kind.STARTED], count[Kind.SUCCEEDED])
    assert tally.failed == count[Kind.FAILED]
    assert tally.started == tally.succeeded + tally.failed + tally.stopped

    states = [line.state for line in tree.lines(driver.now_us())]
    assert len(states) == len(kernel.automaton.plan.elements)
    assert states.count(State.SUCCEEDED) == tally.succeeded
    assert states.count(State.FAILED) == tally.failed
    assert State.ACTIVE not in states

    rows = timeline(seen, words)
    bars = [lane.bar for lane in rows.lanes if lane.bar is not None]
    assert len(bars) == count[Kind.TRIGGERED]
    assert all(0 <= bar.triggered_us <= (bar.ended_us or 0) <= rows.end_us for bar in bars)
    assert [lane.element for lane in rows.lanes] == sorted(lane.element for lane in rows.lanes)
    for row, lane in enumerate(rows.lanes):
        if lane.cause is not None and lane.bar is not None:
            cause = rows.lanes[lane.cause].bar
            assert cause is not None
            assert lane.cause != row
            assert cause.ended_us == lane.bar.triggered_us
    assert etree.fromstring(to_svg(rows, "x").encode()) is not None
