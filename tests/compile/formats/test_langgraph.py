"""LangGraph: a drawing says what may follow, and not all of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gpsfsm
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.model.report import Frequency, Precision

if TYPE_CHECKING:
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
