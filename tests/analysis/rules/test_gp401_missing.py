"""GP401: needs that nothing meets, and why nothing meets them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.model.capability import Input, Output, Parameter, Source, ValueType
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Severity
from tests.analysis.rules.support import (
    control,
    findings,
    library,
    messages,
    places,
    provider,
    runner,
    story,
)

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

TEXT = ValueType.STRING
UP, CONFIGURED = Source.UPSTREAM, Source.CONFIGURATION


def needing(name: str, *sources: Source, **more: Any) -> Any:
    """A provider that needs a text; its plan may write ``text`` and ``words``."""
    return provider(
        name,
        configuration=(Parameter("text", TEXT), Parameter("words", TEXT, **more)),
        inputs=(Input("text", TEXT, required=True, satisfiable_from=sources, fallback="words"),),
    )


LIBRARY = library(
    provider("eye/Look", outputs=(Output("text", TEXT),)),
    provider("eye/Glance", outputs=(Output("text", TEXT, optional=True),)),
    provider("eye/Try", outputs=(Output("seen", TEXT), Output("text", TEXT, event=Event.FAILED))),
    provider("base/Drive"),
    needing("voice/Tell", UP, CONFIGURED),
    needing("voice/Hum", UP, CONFIGURED, default="hm"),
    needing("mind/Keep", UP),
    needing("mind/Plain"),
    needing("mind/Set", CONFIGURED),
    needing("mind/World", Source.EXTERNAL),
    provider(
        "mind/Two",
        configuration=(Parameter("a", required=True, aliases=("first",)),),
        inputs=(
            Input("a", required=True, satisfiable_from=(UP, CONFIGURED)),
            Input("b", required=True, satisfiable_from=(UP,)),
        ),
    ),
)
LOOK, DRIVE, TELL = runner("eye/Look"), runner("base/Drive"), runner("voice/Tell")
GLANCE, TRY, KEEP = runner("eye/Glance"), runner("eye/Try"), runner("mind/Keep")
WRITE = 'write text="…" in the plan, or put a step that outputs it right before this one'
PUT = "put a step that outputs it right before this one, with no control or recovery in between"


def missing(*steps: str, **options: Any) -> list[Finding]:
    return findings("GP401", *steps, library=LIBRARY, **options)


def only(*steps: str, **options: Any) -> Finding:
    (finding,) = missing(*steps, **options)
    return finding


def test_nothing_comes_before_it() -> None:
    assert messages("GP401", TELL, library=LIBRARY) == [
        (
            2,
            "error",
            "Tell at line 2 needs 'text', but no step provides it: there is no step before it",
            WRITE,
        )
    ]
    finding = only(TELL)
    assert (finding.location.column, finding.length, finding.location.element) == (
        1,
        7,
        "/Plan/Runner[1]",
    )
    assert finding.scenario is None


@pytest.mark.parametrize(
    ("steps", "line", "reason", "related"),
    [
        (
            [LOOK, DRIVE, TELL],
            4,
            "Drive at line 3, the step right before it, outputs nothing",
            [2],
        ),
        ([TRY, TELL], 3, "Try at line 2, the step right before it, outputs only 'seen'", []),
        (
            [LOOK, control("recovery", DRIVE), TELL],
            6,
            "no value passes the end of the recovery at line 3",
            [2],
        ),
        (
            [control("parallel_all", LOOK, LOOK), TELL],
            6,
            "no value passes the end of the parallel_all at line 2",
            [3, 4],
        ),
        (
            [control("parallel_any", DRIVE, LOOK), TELL],
            6,
            "no value passes the end of the parallel_any at line 2",
            [4],
        ),
        (
            [runner("mind/Keep", 'text="hello"')],
            2,
            "it takes the value only from the step before it, not from the plan",
            [],
        ),
        ([LOOK, runner("mind/Set")], 3, "only the plan itself can set it", []),
    ],
)
def test_why_nothing_gives_it(steps: list[str], line: int, reason: str, related: list[int]) -> None:
    finding = only(*steps)
    assert finding.location.line == line
    assert finding.message.partition(", but no step provides it: ")[2] == reason
    text = "outputs 'text', but only to its direct successor"
    assert places(finding) == [(number, text) for number in related]


def test_only_the_two_nearest_that_give_it_are_named() -> None:
    assert [line for line, _ in places(only(LOOK, LOOK, DRIVE, LOOK, DRIVE, TELL))] == [3, 5]


def test_a_value_that_comes_only_sometimes() -> None:
    finding = only(GLANCE, TELL)
    assert finding.message == (
        "Tell at line 3 needs 'text', but not every run provides it: Glance at "
        "line 2 outputs it only sometimes"
    )
    assert (finding.severity, finding.hint) == (Severity.ERROR, WRITE)


def test_several_needs_are_one_finding() -> None:
    finding = only(DRIVE, runner("mind/Two"))
    assert finding.message == (
        "Two at line 3 needs 'a' and 'b', but no step provides them: Drive at "
        "line 2, the step right before it, outputs nothing"
    )
    assert finding.hint == (
        "write a=\"…\" in the plan, and put a step that outputs 'b' right before this one"
    )
    finding = only(runner("mind/Two", 'first="1"'))
    assert "needs 'b', but" in finding.message
    assert finding.hint == PUT


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("voice/Tell", WRITE),
        ("mind/Keep", PUT),
        ("mind/Plain", PUT),
        ("mind/Set", 'write text="…" in the plan'),
        ("mind/World", 'write text="…" in the plan'),
    ],
)
def test_what_to_do_depends_on_where_it_may_come_from(name: str, hint: str) -> None:
    assert only(runner(name)).hint == hint
    written = missing(runner(name, 'text="hello"'))
    assert bool(written) == (hint is PUT)
    assert bool(missing(LOOK, runner(name))) == ("put a step" not in hint)


def test_a_failure_hands_over_its_own_outputs() -> None:
    assert missing(TRY, control("recovery", TELL)) == []
    finding = only(LOOK, control("recovery", TELL))
    assert finding.message.endswith(
        "it runs after Look at line 2 has failed, which outputs nothing in that case"
    )
    assert places(finding) == []
    assert story(finding) == ["COMPLETED", "Look at line 2 fails", "Tell at line 4 is running"]


def test_the_chain_of_starts_hands_over_nothing() -> None:
    steps = LOOK, control("parallel_all", TELL, TELL)
    assert missing(*steps) == []
    finding = only(*steps, faults=("no-start",))
    assert finding.location.line == 5
    assert finding.message.endswith(
        "it runs as soon as Tell at line 4 has started, which outputs nothing at that point"
    )


@pytest.mark.parametrize(
    "steps",
    [
        [LOOK, TELL],
        [LOOK, control("parallel_all", TELL)],
        [LOOK, control("parallel_all", TELL, KEEP)],
        [LOOK, control("sequential", control("sequential", TELL))],
        [LOOK, control("recovery"), TELL],
        [runner("voice/Tell", 'text="hello"')],
        [runner("voice/Tell", 'words="hello"')],
        [runner("voice/Hum")],
        [GLANCE, runner("voice/Hum")],
        [runner("lift/Go"), TELL],
        [runner("lift/Go"), KEEP],
        [control("recovery", TELL)],
        [DRIVE, runner("lift/Sing")],
    ],
)
def test_nothing_is_missing(steps: list[str]) -> None:
    assert missing(*steps) == []


def test_what_is_never_triggered_misses_nothing() -> None:
    assert missing(DRIVE, TELL, assumptions=("always fails: line 2",)) == []
    assert missing(DRIVE, control("recovery", TELL), assumptions=("never fails: Drive",)) == []
    assert len(missing(DRIVE, TELL, faults=("hang",))) == 1


@pytest.mark.parametrize("solver", ["z3", "structural"])
def test_whoever_decides(solver: str) -> None:
    steps = LOOK, control("recovery", DRIVE, TELL), GLANCE, TELL
    assert missing(*steps, solver=solver) == missing(*steps)
    assert [finding.location.line for finding in missing(*steps)] == [5, 8]
