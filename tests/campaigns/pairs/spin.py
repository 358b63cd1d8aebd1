"""Random plans in SPIN: a model written from the plan's tree, a verifier compiled for each.

An abort of the verifier is never an answer. Both answers to each question are compared, so a
verifier that said always the same would be caught.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

from tests import oracle
from tests.campaigns.base import Pair, UnknownError
from tests.campaigns.promela import Model, model_of
from tests.strategies import plans
from tests.support import decided, facts_as_dict

if TYPE_CHECKING:
    from collections.abc import Iterator

TIMEOUT_S = 120
_GCC = ("gcc", "-O0", "-w", "-DNOREDUCE", "-DVECTORSZ=4096", "-o", "pan", "pan.c")
# -c0: look for all violations; -E: what waits at the end is asked for by assertions
_PAN = ("./pan", "-c0", "-E", "-m100000", "-w18")
_VIOLATED = re.compile(r"assertion violated .*\((\d{4})==\1\)")
_CYCLE = re.compile(r"^pan:\d+: acceptance cycle", re.MULTILINE)
ENDLESS = ("endless", "")
_DONE = re.compile(r"errors: (\d+)")
_ABORTS = (
    "VECTORSZ",
    "too many",
    "max search depth too small",
    "out of memory",
    "reached -DMEMLIM bound",
    "aborting",
    "Search not completed",
    "transition failed",
)


def missing() -> str:
    """What is needed and not installed."""
    gone = [name for name in ("spin", "gcc") if shutil.which(name) is None]
    return f"{' and '.join(gone)} not installed" if gone else ""


def read(output: str, model: Model, *, cycles: bool = False) -> dict[tuple[str, str], bool]:
    """The verifier's answers; raises UnknownError where it gave none.

    ``cycles``: also whether some run goes on for ever.
    """
    for line in output.splitlines():
        if any(word in line for word in _ABORTS):
            raise UnknownError(line.strip())
    done = _DONE.search(output)
    if done is None:
        raise UnknownError("no result")
    violated = {int(each[1]) - 1000 for each in _VIOLATED.finditer(output)}
    endless = {ENDLESS: bool(_CYCLE.search(output))} if cycles else {}
    if (bool(violated) or any(endless.values())) != (int(done[1]) > 0):
        raise UnknownError("errors that are none of the assertions")
    said = {question: number in violated for number, question in enumerate(model.questions)}
    return said | endless


def verified(model: Model, *, cycles: bool = False) -> dict[tuple[str, str], bool]:
    """What SPIN says to every question of a model; ``cycles``: and about runs for ever."""
    safety, accepting = ((), ("-a",)) if cycles else (("-DSAFETY",), ())
    commands = (("spin", "-a", "model.pml"), (*_GCC, *safety), (*_PAN, *accepting))
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "model.pml").write_text(model.text, encoding="utf-8")
        for command in commands:
            try:
                done = subprocess.run(
                    command,
                    cwd=folder,
                    capture_output=True,
                    text=True,
                    timeout=TIMEOUT_S,
                    check=False,
                )
            except subprocess.TimeoutExpired:
                raise UnknownError(f"{command[0]} takes more than {TIMEOUT_S} s") from None
            if done.returncode < 0 or (done.returncode and command[0] != "./pan"):
                raise UnknownError(f"{command[0]}: {(done.stdout + done.stderr)[-500:]}")
    return read(done.stdout + done.stderr, model, cycles=cycles)


def expected(facts: dict[str, Any], question: tuple[str, str]) -> bool:
    """What the facts of a report say to a question."""
    kind, path = question
    if kind in ("completes", "gives_up", "stuck"):
        return bool(facts[kind] != "never")
    if kind.startswith("not "):
        return bool(facts[kind.removeprefix("not ")] != "always")
    if kind == "reached":
        return path not in facts["unreachable"]
    if kind == "orphan":
        return path in facts["orphans"]
    if kind == "waits":
        return any(each["control"] == path for each in facts["join_deadlocks"])
    assert kind == "both"
    return False


def judge(case: tuple[oracle.P, bool]) -> Iterator[str]:
    """All of SPIN's answers against the facts of both deciders."""
    whole, hang = case
    model = model_of(whole, hang=hang)
    proof = verified(model)
    models = frozenset({"hang"} if hang else ())
    for solver in ("auto", "z3"):
        facts = facts_as_dict(decided(whole, faults=models, solver=solver).facts())
        assert facts is not None
        wanted = {question: expected(facts, question) for question in proof}
        assert proof == wanted, f"SPIN differs from {solver}"
    for (kind, _), answer in proof.items():
        yield f"{kind}: {'yes' if answer else 'no'}"


PAIR = Pair(
    name="spin",
    about="random plans: SPIN on a model written from the tree, against z3 and the structural pass",
    cases=lambda: st.tuples(plans(min_runners=1, max_runners=6), st.booleans()),
    judge=judge,
    text=lambda case: f"<!-- hang: {case[1]} -->\n{oracle.to_xml(case[0])}",
    full=1_000,
    batch=20,
    missing=missing,
    few=2,
)
