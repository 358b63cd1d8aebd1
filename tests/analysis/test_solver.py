"""z3 as it is used here: known answers in both directions, limits, and what it must not do."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from corpus.generate import chain, fanout
from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.encode import conjunction, disjunction, negation, symbols_of
from gpsfsm.analysis.solver import InconclusiveError, Solver
from gpsfsm.compile import compile_plan
from tests.support import decided, plan_of

VARIANTS = {
    # who can fail in the block, and so what its join comes to
    "unsafe": ("sometimes", "give_up"),
    "needle": ("sometimes", "give_up"),
    "safe": ("sometimes", None),
}


@pytest.mark.parametrize("solver", ["structural", "z3"])
@pytest.mark.parametrize("size", [3, 30])
@pytest.mark.parametrize("variant", VARIANTS)
def test_known_answers_of_fanout(variant: str, size: int, solver: str) -> None:
    """A safe block waits for no unit once its recoveries cannot fail; the others do."""
    plan = fanout(size, variant)
    assumptions = ["never fails: SpeechRunner"]
    facts = decided(plan, solver=solver, assumptions=assumptions).facts()
    assert facts is not None
    gives_up, effect = VARIANTS[variant]
    assert facts.gives_up == gives_up  # the first and the last runner are unguarded
    assert [join_deadlock.effect for join_deadlock in facts.join_deadlocks] == (
        [effect] if effect else []
    )
    assert facts.unreachable == ()


@pytest.mark.parametrize("solver", ["structural", "z3"])
@pytest.mark.parametrize("size", [1, 40])
def test_known_answers_of_chain(size: int, solver: str) -> None:
    facts = decided(chain(size), solver=solver).facts()
    assert facts is not None
    assert facts.completes == facts.gives_up == "sometimes"
    assert facts.fewest_failures_to_give_up == 2
    assert len(facts.dangling) == size
    assert facts.unreachable == facts.orphans == facts.join_deadlocks == ()


@pytest.mark.parametrize("solver", ["structural", "z3"])
def test_known_answers_of_a_chain_that_cannot_fail(solver: str) -> None:
    every = ["never fails: *"]
    facts = decided(chain(5), solver=solver, assumptions=every).facts()
    assert facts is not None
    assert (facts.completes, facts.gives_up) == ("always", "never")
    assert facts.fewest_failures_to_give_up is None
    assert len(facts.unreachable) == 5  # no recovery is ever needed


def solver_of(text: str, rlimit: int = 1_000_000) -> Solver:
    plan = plan_of(text)
    return Solver(compile_plan(plan), constraints_of(plan), rlimit=rlimit)


def test_a_limit_is_unknown_and_never_no() -> None:
    solver = solver_of(chain(30), rlimit=1)
    term = solver.encoding.triggered(solver.automaton.give_up)
    assert solver.ask([term]) == [None]
    with pytest.raises(InconclusiveError):
        solver.decide([term])


def test_the_limit_is_per_question() -> None:
    solver = solver_of(chain(30), rlimit=200_000)
    for node in solver.automaton.runners:
        assert solver.ask([solver.encoding.triggered(node.index)]) == [True]


def test_answers_do_not_depend_on_what_was_asked_before() -> None:
    terms = ["s0", "(not s0)", "(and s0 (not s0))", "true", "false"]
    solver = solver_of(chain(3))
    assert solver.ask(terms) == [True, True, False, True, False]
    assert solver.ask(list(reversed(terms))) == [False, True, False, True, True]
    assert solver.contradictory() is False


def test_terms_are_simplified_where_they_are_built() -> None:
    assert conjunction(["true", "s1"]) == "s1"
    assert conjunction(["false", "s1"]) == "false"
    assert conjunction([]) == "true"
    assert disjunction(["s1", "s2"]) == "(or s1 s2)"
    assert disjunction(["true", "s2"]) == "true"
    assert negation("true") == "false"
    assert symbols_of("(and s1 (or t7_2 s1) ((_ at-most 2) q3))") == ["s1", "t7_2", "q3"]


PRESS_WHILE_READING = """
import os, signal, threading, gpsfsm
gpsfsm.check('<Plan><Runner interface="demo/Go" provider="demo/Go"/></Plan>', solver="z3")
ours, theirs = os.pipe()
reader = threading.main_thread().ident
threading.Timer(0.5, signal.pthread_kill, (reader, signal.SIGINT)).start()
last = threading.Timer(20, os.write, (theirs, b"x"))  # or it would never end
last.start()
try:
    os.read(ours, 1)
    print("went on reading")
except KeyboardInterrupt:
    print("interrupted", last.is_alive())
last.cancel()
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="needs signals")
def test_ctrl_c_ends_a_read_after_a_question() -> None:
    """z3 may change how signals are handled; then a read went on, whatever was pressed.

    In a process of its own, since other tests use z3 in other ways.
    """
    done = subprocess.run(
        [sys.executable, "-c", PRESS_WHILE_READING], capture_output=True, text=True, check=True
    )
    assert done.stdout == "interrupted True\n"
