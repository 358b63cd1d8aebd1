"""Ported plans against brute force: by the paper they do the same, on the engine what it says."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.capabilities.library import EMPTY
from gpsfsm.porting import Ported, port
from gpsfsm.porting.forms import form_of
from gpsfsm.syntax import parse
from tests.engines.plans import plans as texts
from tests.equivalence.brute import Observed, distance
from tests.oracle import P, R, to_xml
from tests.oracle.model import C, place
from tests.porting.brute import abstract, unfaithful
from tests.strategies import plans

both = pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])


def ported(text: str, engine: str, *, unsafe: bool = False) -> Ported:
    return port(text, engine, capabilities=EMPTY, unsafe=unsafe)


@both
@given(whole=plans(max_runners=5))
def test_ported_plans(engine: str, whole: P) -> None:
    port_result = ported(to_xml(whole), engine)
    assert (port_result.text is None) == bool(port_result.losses)
    if port_result.text is None:
        assert not port_result.changed
        return
    assert distance(whole, abstract(port_result.text)) is None
    assert unfaithful(port_result.text, engine) is None
    assert port_result.changed == (port_result.text != port_result.original)


@both
@given(whole=plans(max_runners=4), unsafe=st.booleans())
def test_twice_is_once(engine: str, whole: P, unsafe: bool) -> None:
    first = ported(to_xml(whole), engine, unsafe=unsafe).text
    if first is None:
        return
    again = ported(first, engine)
    assert again.text == first
    assert not again.changed
    assert not again.losses


@both
@given(text=texts(most=4))
def test_a_plan_that_is_right_stays_and_no_other_does(engine: str, text: str) -> None:
    """Also: what cannot be ported is nothing that the engine would do anyway.

    That an engine dies when the plan has completed is not seen by who watches until then.
    """
    port_result = ported(text, engine)
    if unfaithful(text, engine) is not None:
        assert port_result.text != text
    elif port_result.text != text:
        assert port_result.text is None
        assert engine == "fabric-v1" or "OccupancyGrid" in text
        assert "parallel_any" in text


# ---- the unsafe reading ------------------------------------------------------------------------


def with_numbers(whole: P) -> P:
    """The same plan in which every runner is another one, known by its number."""
    count = iter(range(1000))

    def numbered(node: C | R) -> C | R:
        if isinstance(node, R):
            return R(f"a/Go n={next(count)}")
        return C(node.type, tuple(map(numbered, node.children)))

    children = [placed.node for placed in place(whole).children]
    return P(tuple(numbered(node) for node in children if not isinstance(node, P)))


def maximal(seen: Observed, outcomes: tuple[bool, ...]) -> tuple[frozenset[int], str]:
    """All that is ever triggered in a scenario, and the end."""
    history: frozenset[tuple[int, bool]] = frozenset()
    while True:
        triggered, end = seen.seen(history)
        after = frozenset((number, outcomes[number]) for number in triggered)
        if after == history:
            return triggered, end
        history = after


def behind_what_goes_on(inner: C) -> P:
    """A recovery of a row whose first step alone can fail."""
    row = C("sequential", (R("a/Go"), inner))
    return P((row, C("recovery", (R("a/Go"),))))


AT_ONCE = C("parallel_any", (R("a/Go"), C("sequential", ())))


@both
@given(whole=plans(max_runners=4))
@example(whole=behind_what_goes_on(AT_ONCE))
@example(whole=behind_what_goes_on(C("sequential", (R("a/Go"), C("recovery", (AT_ONCE,))))))
def test_the_unsafe_reading_does_nothing_that_the_plan_does_not(engine: str, whole: P) -> None:
    whole = with_numbers(whole)
    port_result = ported(to_xml(whole), engine, unsafe=True)
    assert port_result.text is not None
    assert unfaithful(port_result.text, engine) is None
    assert bool(port_result.losses) == (port_result.change is not None)
    other = abstract(port_result.text)
    here, there = Observed(whole), Observed(other)
    names = [placed.node.action for placed in place(whole).walk() if isinstance(placed.node, R)]
    others = [placed.node.action for placed in place(other).walk() if isinstance(placed.node, R)]
    number = [names.index(name) for name in others]
    for outcomes in product((True, False), repeat=len(names)):
        meant, end = maximal(here, outcomes)
        done, how = maximal(there, tuple(outcomes[each] for each in number))
        assert {number[each] for each in done} <= meant
        assert how != "completed" or end == "completed"
    if port_result.change is not None:
        apart = distance(whole, other)
        assert apart is not None
        assert port_result.change.difference is not None
        assert len(port_result.change.difference.steps) == apart


def test_nothing_follows_where_steps_are_left_out() -> None:
    """Else the last runner would start although the alternative might have succeeded."""
    runners = [f'<Runner interface="a/{name}" provider="a/{name}"/>' for name in "ABCDE"]
    first, second, third, fourth, last = runners
    row = f'<Control type="sequential">{third}{fourth}</Control>'
    text = (
        f'<Plan>{first}<Control type="parallel_any">{second}{row}</Control>'
        f'<Control type="recovery">{last}</Control></Plan>'
    )
    port_result = ported(text, "fabric-v2", unsafe=True)
    assert port_result.text == f"<Plan>{first}{second}</Plan>"
    assert [loss.instead.partition(",")[0].partition(";")[0] for loss in port_result.losses] == [
        "the steps run in sequence",
        "it is removed as well",
    ]


def test_deep_nesting_needs_no_stack() -> None:
    depth = 150
    opening, closing = '<Control type="parallel_all">' * depth, "</Control>" * depth
    text = f'<Plan>{opening}<Runner interface="a/A" provider="a/A"/>{closing}</Plan>'
    assert ported(text, "fabric-v2").text == '<Plan><Runner interface="a/A" provider="a/A"/></Plan>'


def test_forms_of_deep_plans() -> None:
    depth = 190
    opening, closing = '<Control type="sequential">' * depth, "</Control>" * depth
    runner = '<Runner interface="a/A" provider="a/A"/>'
    plan = parse(f"<Plan>{opening}{runner * 3}{closing}</Plan>").plan
    assert plan is not None
    form, _ = form_of(plan)
    assert [step.runners for step in form.steps] == [[191], [192], [193]]
    assert form.fails
