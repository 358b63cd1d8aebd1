"""The mission of docs/rival.md: its files, its formulas, and SPIN's answers about its models."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET  # our own text, so no defence is needed

import pytest

from benchmarks import rival
from benchmarks.other_tools.promela_tree import ltl_of, model_of
from benchmarks.other_tools.tools import read_pan_formula

if TYPE_CHECKING:
    from pathlib import Path

here = pytest.mark.skipif(
    not (shutil.which("spin") and shutil.which("gcc")), reason="SPIN or gcc is not installed"
)

HOLDS = {  # worked out by hand: what is true of runs of each model
    "neither": {"home", "once", "picture", "row"},
    "Parallel": {"home", "once", "soil", "row"},
    "failures": {"picture", "row"},
    "both": {"soil", "row"},
}


def test_the_example_is_the_mission_of_one_row() -> None:
    assert rival.TREE.read_text(encoding="utf-8") == rival.mission(1)
    assert rival.TASK.read_text(encoding="utf-8") == rival.task(1)


@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("failures", [True, False])
def test_gpsfsm_decides_by_hand(tmp_path: Path, rows: int, failures: bool) -> None:
    """With one row and with several: an action that nobody matches would make a demand vacuous."""
    tree, task = tmp_path / "tree.xml", tmp_path / "task.yaml"
    tree.write_text(rival.mission(rows), encoding="utf-8")
    task.write_text(rival.task(rows), encoding="utf-8")
    holds = rival.by_gpsfsm(tree, task, failures=failures).holds
    assert {key for key, it in holds.items() if it} == HOLDS["both" if failures else "Parallel"]


@here
@pytest.mark.parametrize("kind", HOLDS)
def test_spin_decides_by_hand(tmp_path: Path, kind: str) -> None:
    holds = rival.by_spin(rival.models(1)[kind], tmp_path, 1).holds
    assert {key for key, it in holds.items() if it} == HOLDS[kind]


HALTED = """<BehaviorTree><Fallback>
<Parallel success_count="-1" failure_count="1">
<Sequence><A name="a" action_name="a"/><B name="b" action_name="b"/></Sequence>
<C name="c" action_name="c"/>
</Parallel>
<D name="d" action_name="d"/>
</Fallback></BehaviorTree>"""


@here
def test_what_a_parallel_halts_does_not_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As BehaviorTree.CPP does; and b may start before d, so that the model is not idle."""
    demands = {"halted": "G (start(d) -> G !start(b))", "apart": "!(F start(b) & F start(d))"}
    monkeypatch.setattr(rival, "DEMANDS", demands)
    root = ET.fromstring(HALTED)  # noqa: S314
    text = model_of(root, demands, failures=True, parallel=True)
    assert rival.by_spin(text, tmp_path, 1).holds == {"halted": True, "apart": False}


def test_formulas_are_written_for_spin() -> None:
    assert ltl_of("G (start(a) -> F fails(b))") == "[] ((ev == s_a) -> <> (ev == n_b))"
    assert ltl_of("!start(a) W succeeds(F)") == "!(ev == s_a) W (ev == y_F)"
    assert ltl_of("start(a) & start(b) | start(c)").count("&&") == 1


@pytest.mark.parametrize("formula", ["X start(a)", "F completes", "F start(*)", "WX start(a)"])
def test_formulas_without_a_counterpart_are_refused(formula: str) -> None:
    with pytest.raises(ValueError, match="without X"):
        ltl_of(formula)


@pytest.mark.parametrize(
    "body",
    [
        '<Inverter><A name="a"/></Inverter>',
        '<Sequence><A name="a"/><A name="a"/></Sequence>',
        '<Parallel success_count="3"><A name="a"/><B name="b"/></Parallel>',
        '<Parallel failure_count="2"><A name="a"/><B name="b"/></Parallel>',
    ],
)
def test_what_the_models_cannot_say_is_refused(body: str) -> None:
    root = ET.fromstring(f"<BehaviorTree>{body}</BehaviorTree>")  # noqa: S314
    with pytest.raises(ValueError, match=r"not translated|are called"):
        model_of(root, {}, failures=True, parallel=True)


@pytest.mark.parametrize(
    ("output", "broken"),
    [
        ("errors: 0", False),
        ("pan:1: acceptance cycle (at depth 4)\nSearch not completed\nerrors: 1", True),
        ("pan:1: assertion violated !(x)\nerrors: 1", True),
        ("", None),
        ("pan:1: VECTORSZ is too small, edit pan.h\nerrors: 1", None),
        ("error: max search depth too small\nerrors: 0", None),
        ("Warning: Search not completed\nerrors: 0", None),
        ("pan:1: invalid end state (at depth 2)\nerrors: 1", None),
    ],
)
def test_an_abort_is_no_verdict(output: str, broken: bool | None) -> None:
    assert read_pan_formula(output)[0] is broken
