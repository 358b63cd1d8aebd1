"""SPIN's answers about plans that are worked out by hand, in both directions, and its aborts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.analysis.machines.random_machines import machine
from tests.campaigns.base import UnknownError
from tests.campaigns.pairs.spin import missing, read, verified
from tests.campaigns.promela import model_of
from tests.campaigns.promela_machines import machine_model
from tests.oracle import par_all, par_any, plan, rec, seq

if TYPE_CHECKING:
    from tests.oracle import P

here = pytest.mark.skipif(bool(missing()), reason=missing() or "-")

R1, C1 = "/Plan/Runner[1]", "/Plan/Control[1]"


def yes(whole: P, *, hang: bool = False) -> set[str]:
    """The questions that SPIN answers with yes, but for who is triggered."""
    proof = verified(model_of(whole, hang=hang))
    return {f"{kind} {path}".strip() for (kind, path), it in proof.items() if it}


@here
def test_one_runner() -> None:
    one = {"completes", "gives_up", "not completes", "not gives_up", "not stuck", f"reached {R1}"}
    assert yes(plan("A")) == one
    assert yes(plan("A"), hang=True) == one | {"stuck"}


@here
def test_no_runner() -> None:
    assert yes(plan()) == {"completes", "not gives_up", "not stuck"}


@here
def test_a_dead_recovery_and_a_join_that_waits() -> None:
    answers = yes(plan(rec("Dead"), par_all("A", "B"), rec("Help")))
    both = [f"/Plan/Control[2]/Runner[{n}]" for n in (1, 2)]
    help_ = "/Plan/Control[3]/Runner[1]"
    ends = {"completes", "gives_up", "not completes", "not gives_up", "not stuck"}
    reached = {f"reached {path}" for path in (*both, help_)}
    # Help begins when one of the two fails; the other may still be active when the plan completes
    assert answers == ends | reached | {"waits /Plan/Control[2]", *(f"orphan {p}" for p in both)}


@here
def test_an_orphan_at_the_instant_of_the_beginning() -> None:
    answers = yes(plan(par_any(seq(), seq("Y", "Z"))))
    y, z = (f"{C1}/Control[2]/Runner[{n}]" for n in (1, 2))
    always = {"completes", "not gives_up", "not stuck"}
    assert answers == always | {f"reached {y}", f"orphan {y}", f"reached {z}"}


MODEL = model_of(plan("A"))


@pytest.mark.parametrize(
    "output",
    [
        "",
        "pan:1: VECTORSZ is too small, edit pan.h\nerrors: 1",
        "error: max search depth too small\nerrors: 0",
        "pan: out of memory\nerrors: 0",
        "Warning: Search not completed\nerrors: 0",
        "pan:1: invalid end state (at depth 2)\nerrors: 1",
    ],
)
def test_an_abort_is_no_answer(output: str) -> None:
    with pytest.raises(UnknownError):
        read(output, MODEL)


def test_what_is_printed_is_read() -> None:
    violated = "pan:1: assertion violated  !((r0_ok&&(1000==1000))) (at depth 2)\nerrors: 1"
    assert [question for question, it in read(violated, MODEL).items() if it] == [("completes", "")]
    assert not any(read("errors: 0", MODEL).values())


def of_machine(*lines: str, hang: bool = False, **needs: int) -> set[str]:
    """The positive answers about a machine, named."""
    graph = machine(*lines, **needs)
    names = [name for name, kind in graph.nodes(data="kind") if kind == "runner"]
    outcomes = frozenset({"SUCCEEDED", "FAILED"} | ({"HANG"} if hang else set()))
    proof = verified(machine_model(graph, dict.fromkeys(names, outcomes)), cycles=True)
    return {f"{kind} {name}".strip() for (kind, name), answer in proof.items() if answer}


@here
def test_a_machine_with_a_loop() -> None:
    holding = of_machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end", "b SUCCEEDED end")
    assert holding == {"completes", "endless", "reached a"}


@here
def test_a_machine_in_which_somebody_has_to_end() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "b SUCCEEDED b", "b FAILED b")
    stops = ("a SUCCEEDED stop b", "a FAILED stop b", "a SUCCEEDED end", "a FAILED end")
    assert of_machine(*lines, *stops) == {"completes", "reached a", "reached b"}
    again = of_machine(*lines, *stops, "b SUCCEEDED stop a", "b SUCCEEDED a")
    assert again == {"completes", "endless", "reached a", "reached b"}
    assert {"stuck", "endless"} <= of_machine(*lines, *stops, hang=True)


@here
def test_joins_and_orphans_of_a_machine() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j")
    holding = of_machine(*lines, "j SUCCEEDED end", "a FAILED end", j=2)
    assert holding == {
        *("completes", "stuck", "reached a", "reached b", "orphan b", "waits stuck j"),
    }
