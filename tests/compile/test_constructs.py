"""What readers declare of constructs, held against what they say of files."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.compile.constructs import DECLARATIONS, TREE
from gpsfsm.compile.formats import format_of, formats
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import EXACT, REFUSED, Approximation, Cause, Construct, Reading
from gpsfsm.model.tree import BUILTINS, NAV2
from tests.cases import many
from tests.compile.test_trees import tree
from tests.oracle import ticks
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Iterator

REPO = Path(__file__).parents[2]
CASES = REPO.parent / "shared" / "cases"
_PLAN = re.compile(r"<Plan\b")


def approximations(text: str, file: str) -> tuple[str, list[Approximation]]:
    """The kind of an input, and what its reader says of it."""
    parsed = read_plan_or_machine(text, file=file)
    of = format_of(parsed.text or "", file)
    kind = of.name if of is not None else "tree" if parsed.trees else "machine"
    return kind, [*parsed.approximations, *getattr(parsed.plan, "approximations", ())]


def inputs() -> Iterator[Path]:
    """All trees and machines of the repository, and the cases beside it."""
    for folder in (REPO / "corpus", REPO / "tests", REPO / "docs" / "examples", CASES):
        for ending in ("xml", "scxml", "json", "graphml", "py"):
            for path in sorted(folder.rglob(f"*.{ending}")):
                own = ending == "py" and path.with_name("__init__.py").exists()  # a test
                if not own and "expected" not in path.name:
                    yield path


def undeclared(kind: str, rows: list[Approximation]) -> list[Approximation]:
    """What no row of the table covers, and what the table says is exact although it is over."""
    table = DECLARATIONS[kind]
    over = {name for each in table if each.reading is Reading.OVER for name in each.names}
    exact = {name for each in table if each.reading == EXACT for name in each.names} - over
    return [
        each
        for each in rows
        if not any(row.covers(each) for row in table)
        or (each.reading is Reading.OVER and each.construct in exact)
    ]


def test_what_readers_say_of_files_is_declared() -> None:
    kinds: set[str] = set()
    for path in inputs():
        text = path.read_text(encoding="utf-8", errors="replace")
        if _PLAN.search(text) or len(text) > 100_000:
            continue
        kind, rows = approximations(text, str(path))
        assert not undeclared(kind, rows), path
        kinds.add(kind)
    assert kinds == DECLARATIONS.keys()


def test_what_is_said_of_random_trees_is_declared() -> None:
    said: set[tuple[str, Cause]] = set()
    for seed in range(many(400)):
        chance = random.Random(seed)  # noqa: S311
        for text in (ticks.random_tree(chance), RandomTree(chance).text):
            kind, rows = approximations(text, "t.xml")
            assert kind == "tree"
            assert not undeclared(kind, rows), text
            said |= {(each.construct, each.cause) for each in rows}
    assert {cause for _, cause in said} >= {Cause.VALUE, Cause.HISTORY, Cause.ORDER, Cause.ROUNDS}


OVER = [
    ("<IfThenElse><A/><B/></IfThenElse>", "IfThenElse", Cause.HISTORY),
    ('<Parallel><A _skipIf="x"/><B/></Parallel>', "Parallel", Cause.VALUE),
    ('<Parallel success_count="{n}"><A/><B/></Parallel>', "Parallel", Cause.UNKNOWN_NODE),
    ('<ParallelAll max_failures="{n}"><A/><B/></ParallelAll>', "ParallelAll", Cause.UNKNOWN_NODE),
    ('<Repeat num_cycles="9"><A/></Repeat>', "Repeat", Cause.ROUNDS),
    ('<RecoveryNode number_of_retries="9"><A/><B/></RecoveryNode>', "RecoveryNode", Cause.ROUNDS),
    ("<ReactiveSequence><A/><B/></ReactiveSequence>", "ReactiveSequence", Cause.HISTORY),
    ("<WhileDoElse><A/><B/></WhileDoElse>", "WhileDoElse", Cause.HISTORY),
    ("<SequenceWithMemory><A/><B/></SequenceWithMemory>", "SequenceWithMemory", Cause.HISTORY),
    ("<RoundRobin><A/><B/></RoundRobin>", "RoundRobin", Cause.VERSION),
    ('<Timeout msec="9"><A/></Timeout>', "Timeout", Cause.CLOCK),
    ("<RunOnce><A/></RunOnce>", "RunOnce", Cause.HISTORY),
    ('<TryCatch catch_on_halt="true"><A/><B/></TryCatch>', "TryCatch", Cause.HISTORY),
    ("<PipelineSequence><A/><B/></PipelineSequence>", "PipelineSequence", Cause.ORDER),
    ("<PathLongerOnApproach><A/></PathLongerOnApproach>", "PathLongerOnApproach", Cause.VALUE),
    ("<ManualSelector><A/><B/></ManualSelector>", "ManualSelector", Cause.VALUE),
    ('<SetBlackboard value="{a}" output_key="b"/>', "SetBlackboard", Cause.THROWS),
    ('<Script code="a = 1"/>', "Script", Cause.THROWS),
    ('<A _onSuccess="a = 1"/>', "_onSuccess", Cause.THROWS),
    ('<A _skipIf="a == 1"/>', "_skipIf", Cause.THROWS),
    ("<Mine><A/></Mine>", "Mine", Cause.UNKNOWN_NODE),
]


@pytest.mark.parametrize(("body", "construct", "cause"), OVER, ids=[each[1] for each in OVER])
def test_what_is_declared_over_is_marked(body: str, construct: str, cause: Cause) -> None:
    once = f"<Sequence>{body}<Timeout msec='1'><A/></Timeout></Sequence>"  # a machine in any case
    again = f'<Repeat num_cycles="-1">{body}</Repeat>'
    rows = [each for text in (once, again) for each in approximations(tree(text), "t.xml")[1]]
    over = {(each.construct, each.cause) for each in rows if each.reading is Reading.OVER}
    assert (construct, cause) in over


EXACT_TREES = [
    "<Sequence><A/><Fallback><B/><C/></Fallback></Sequence>",
    '<Repeat num_cycles="-1"><IfThenElse><B/><C/><D/></IfThenElse></Repeat>',
    '<RetryUntilSuccessful num_attempts="8"><A/></RetryUntilSuccessful>',
    "<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>",
    "<ReactiveSequence><IsBatteryLow/><B/></ReactiveSequence>",
    '<WhileDoElse><Condition ID="A"/><B/><C/></WhileDoElse>',
    "<SequenceWithMemory><A/><B/></SequenceWithMemory>",
    '<RoundRobin wrap_around="true"><A/><B/></RoundRobin>',
    '<RecoveryNode number_of_retries="2"><A/><B/></RecoveryNode>',
    '<Parallel success_count="1" failure_count="1"><A/><B/></Parallel>',
    "<RunOnce><A/></RunOnce>",
    "<SingleTrigger><A/></SingleTrigger>",
    "<TryCatch><A/><B/></TryCatch>",
    '<RateController hz="1"><A/></RateController>',
    '<Sequence><Script code="a := 1"/><A _onSuccess="a := 2"/></Sequence>',
    '<SetBlackboard value="x" output_key="b"/>',
    '<Delay delay_msec="1"><A/></Delay>',
]


@pytest.mark.parametrize("body", EXACT_TREES)
def test_what_is_declared_exact_is_not_marked(body: str) -> None:
    assert approximations(tree(body), "t.xml") == ("tree", [])


def test_every_node_is_declared() -> None:
    names = {name for each in TREE for name in each.names}
    assert names >= BUILTINS.keys() | NAV2.keys()


def test_every_format_that_is_read_is_declared() -> None:
    read = {each.name for each in formats().values() if each.read is not None}
    assert read == DECLARATIONS.keys() - {"tree", "machine"}


def test_causes_are_those_of_approximations() -> None:
    for table in DECLARATIONS.values():
        for each in table:
            assert bool(each.causes) is (each.reading not in (EXACT, REFUSED)), each
            assert each.names or each.about


def test_a_declaration_covers_its_own_names_alone() -> None:
    row = Construct(Reading.OVER, ("Timeout",), "", "", (Cause.CLOCK,))
    place = Location(1, 1)
    assert row.covers(Approximation(Reading.OVER, "Timeout", place, Cause.CLOCK))
    assert not row.covers(Approximation(Reading.OVER, "Timeout", place, Cause.VALUE))
    assert not row.covers(Approximation(Reading.SKIPPED, "Timeout", place, Cause.CLOCK))
    assert not row.covers(Approximation(Reading.OVER, "Delay", place, Cause.CLOCK))
