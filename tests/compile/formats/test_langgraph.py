"""LangGraph: a drawing says what may follow, and not all of it."""

from __future__ import annotations

import json
import random
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm.compile.formats.langgraph import read
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.model.report import Frequency, Precision
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import batches
from tests.compile.formats.against_runs import compared
from tests.compile.formats.langgraph_programs import (
    Supersteps,
    TooManyError,
    drawing,
    random_program,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.report import PlanReport

CASES = Path(__file__).parent / "cases"


def drawn(*edges: str, **metadata: dict[str, Any]) -> str:
    """The drawing of edges such as ``a>b``, or ``a?b`` for conditional ones."""
    rows = []
    for each in edges:
        sign = "?" if "?" in each else ">"
        source, _, target = each.partition(sign)
        row: dict[str, Any] = {"source": source, "target": target}
        rows.append(row | ({"conditional": True} if sign == "?" else {}))
    names = dict.fromkeys(
        ("__start__", *(row[end] for row in rows for end in ("source", "target")))
    )
    names |= dict.fromkeys(metadata)
    nodes = [{"id": name, **metadata.get(name, {})} for name in names]
    return json.dumps({"nodes": nodes, "edges": rows}, indent=1)


def checked(text: str) -> PlanReport:
    (report,) = gpsfsm.check(text).plans
    return report


def rules(report: PlanReport) -> set[str]:
    return {each.rule for each in report.findings}


def inexact(report: PlanReport) -> list[str]:
    return sorted(each.construct for each in report.approximations if each.cause is Cause.DRAWING)


def test_a_graph_ends_when_no_node_follows_and_not_at_the_first_end() -> None:
    report = checked((CASES / "langgraph_fanout.json").read_text())
    assert not {"GP311", "GP301", "GP306"} & rules(report)
    assert report.facts is not None
    assert report.facts.orphans == ()
    assert report.facts.stuck is Frequency.NEVER
    assert report.facts.precision["completes"] is Precision.MAY


def test_a_node_may_follow_though_no_edge_to_it_is_drawn() -> None:
    report = checked((CASES / "langgraph_untyped_route.json").read_text())
    assert report.facts is not None
    assert report.facts.unreachable == ()
    assert not {"GP301", "GP304"} & rules(report)
    assert "act" in inexact(report)
    assert "GP816" in rules(report)


def test_only_a_plain_edge_that_belongs_to_no_join_is_exact() -> None:
    loop = ("__start__>agent", "agent?tools", "agent?__end__", "tools>agent")
    assert inexact(checked(drawn(*loop))) == ["__start__", "agent"]
    join = ("__start__>a", "a>c", "b>c", "c>__end__")  # may be add_edge(["a", "b"], "c")
    assert inexact(checked(drawn(*join))) == ["__start__", "a", "b", "c"]


def test_a_failure_on_the_drawn_way_is_proved_and_an_end_is_not() -> None:
    report = checked(drawn("__start__>a", "a>b", "b>__end__"))
    assert report.facts is not None
    assert report.facts.precision["gives_up"] is Precision.CAN
    assert report.facts.precision["completes"] is Precision.MAY
    assert report.facts.fewest_failures_to_give_up == 1


def test_drawings_of_old_versions_may_lack_the_end() -> None:
    report = checked(drawn("__start__>a", "a>b"))
    assert report.facts is not None
    assert report.facts.completes is Frequency.SOMETIMES


def test_what_nodes_say_besides_is_reported() -> None:
    metadata = {"a": {"metadata": {"defer": True, "__interrupt": "before", "team": 3}}}
    report = checked(drawn("__start__>a", "a>b", "b>__end__", **metadata))
    said = {each.construct: (each.reading, each.cause) for each in report.approximations}
    assert said["metadata 'defer'"] == (Reading.OVER, Cause.ORDER)
    assert said["metadata '__interrupt'"] == (Reading.DEFAULTED, Cause.RESUMED)
    assert "recursion_limit" not in said
    assert said["metadata 'team'"] == (Reading.SKIPPED, Cause.NO_MEANING)


def test_a_drawn_loop_is_said_to_have_no_limit() -> None:
    report = checked(drawn("__start__>b", "b>a", "a?b", "a?__end__"))
    (limit,) = (each for each in report.approximations if each.construct == "recursion_limit")
    assert (limit.reading, limit.cause) == (Reading.DEFAULTED, Cause.NO_LIMIT)
    assert limit.location.element == "/machine/a"
    assert "GP119" in rules(report)


def test_names_that_gpsfsm_adds_may_be_taken() -> None:
    edges = ("__start__>give_up", "give_up>another node follows", "another node follows>__end__")
    report = checked(drawn(*edges))
    assert report.facts is not None
    assert report.facts.unreachable == ()
    assert report.facts.gives_up is Frequency.SOMETIMES


def test_graphs_of_many_nodes_are_decided() -> None:
    names = [f"n{number}" for number in range(15)]  # 20 reach more than 50,000 configurations
    edges = [f"{a}?{b}" for a in names for b in names[:3]]
    assert checked(drawn("__start__>n0", *edges)).facts is not None


def test_a_join_with_a_node_that_nothing_is_drawn_to_may_be_one_edge() -> None:
    """``add_edge(["a", "z"], "d")``, drawn where something else leads to d: nothing leads to z."""
    edges = ("__start__>a", "a>d", "d>a")
    assert inexact(checked(drawn(*edges))) == ["__start__"]
    report = checked(drawn(*edges, z={}))
    assert inexact(report) == ["__start__", "a", "d", "z"]
    assert report.facts is not None
    assert report.facts.machine is not None
    assert report.facts.precision["endless"] is Precision.MAY


def test_an_edge_out_of_a_subgraph_may_stand_for_a_condition() -> None:
    edges = ("__start__>a", "a>i:x", "i:x>i:y", "i:y>b", "b>a")
    assert inexact(checked(drawn(*edges))) == ["__start__", "a", "i:x", "i:y"]


def test_nothing_runs_at_the_start_of_a_subgraph() -> None:
    """It is drawn where an edge leads back to the first node of the subgraph."""
    report = checked(drawn("__start__>i:__start__", "i:__start__>i:x", "i:x?i:x", "i:x>i:__end__"))
    (described,) = (each.message for each in report.findings if each.rule == "GP210")
    assert "'i:x'" in described
    assert "__'" not in described


# -- against an interpreter of supersteps ----------------------------------------------------------


def judged(seed: int) -> Iterator[str]:
    """What is said of a drawing holds for the program that was drawn; labels for a campaign."""
    chance = random.Random(seed)  # noqa: S311
    program = random_program(chance)
    old = chance.random() < 0.3
    text = drawing(program, old=old, inlined=not old)
    machine, problems = read(text, "g.json", DEFAULT_LIMITS)
    if machine is None:
        yield f"refused: {problems[0].message}"
        return
    yield "drawn by 0.2" if old else "drawn by 0.6 or later"
    try:
        graph = Supersteps(program).graph()
    except TooManyError:
        yield "too many positions"
        return
    yield from compared(machine, graph, graph, chance)


def described(seed: int) -> str:
    """The case of a seed, to be read."""
    program = random_program(random.Random(seed))  # noqa: S311
    return f"{seed}: {program}"


@pytest.mark.parametrize("batch", batches(4))
def test_random_graphs_do_what_langgraph_does(batch: int) -> None:
    labels: Counter[str] = Counter()
    for seed in range(40 * batch, 40 * batch + 40):
        try:
            labels.update(judged(seed))
        except AssertionError as error:
            raise AssertionError(f"{error}\n{described(seed)}") from error
    assert labels["compared"] >= 20
