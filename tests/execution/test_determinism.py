"""The same plan and seed: the same events, byte by byte."""

from __future__ import annotations

import ast
import json
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.records import Kind
from gpsfsm.execution.runner import Runner
from tests.execution.support import Listing, compiled_of, drive
from tests.oracle import par_all, par_any, plan, rec, seq

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext

REPO = Path(__file__).parents[2]
PLANS = (
    plan("A", rec("B"), par_all("C x=1", seq("A", "B x=2"), "D"), rec(par_any("C", "D", "E"))),
    plan(par_any(*(f"R{number} x={number}" for number in range(30))), "A", rec("B", "C")),
    plan(par_all(*(par_any("A", "B", rec("C")) for _ in range(8))), rec("D", "E")),
)


def exported(sink: Listing) -> bytes:
    """A run as bytes: every input with all that follows, in order, fields in order."""
    return "\n".join(
        json.dumps([at_us, happened.kind, happened.number, happened.message, records])
        for at_us, happened, records in sink.rows
    ).encode()


def everything() -> Iterator[bytes]:
    for whole in PLANS:
        for seed in range(5):
            sink, driver = drive(compiled_of(whole), seed=seed, timeout_s=4.9)
            yield exported(sink)
            yield json.dumps(driver.logs).encode()


def test_a_hundred_runs() -> None:
    for whole in PLANS:
        first, *others = {exported(drive(compiled_of(whole), seed=7)[0]) for _ in range(100)}
        assert others == []
        assert b"SUCCEEDED" in first


def test_another_seed_is_another_run() -> None:
    runs = {exported(drive(compiled_of(PLANS[1]), seed=seed)[0]) for seed in range(20)}
    assert len(runs) == 20


def test_processes_and_hash_seeds() -> None:
    script = (
        "import sys; from tests.execution.test_determinism import everything;"
        "sys.stdout.buffer.write(b'\\n'.join(everything()))"
    )
    runs = {
        subprocess.run(
            [sys.executable, "-c", script],
            cwd=REPO,
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(REPO)},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("0", "4242")  # and here another one
    }
    assert runs == {b"\n".join(everything())}


class Shuffled(Runner):
    """Hands over the same outputs, each time in another order."""

    def __init__(self, order: list[str]) -> None:
        self.order = order

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        await context.sleep(1)
        return {name: len(name) for name in self.order}


def test_the_order_in_which_outputs_are_named_is_no_matter() -> None:
    names = [f"{'x' * length}" for length in range(1, 8)]
    compiled = compiled_of(plan("A x=1 y=2", "B xx=7", rec("C")))
    luck = random.Random(1)  # noqa: S311
    first: list[Any] = []
    for _ in range(20):
        order = luck.sample(names, len(names))
        sink, _ = drive(compiled, lambda interface, provider, order=order: Shuffled(order))
        first = first or sink.rows
        assert sink.rows == first
    (value,) = [r.data for r in sink.records if r.kind is Kind.TRIGGERED and r.node == 2]
    assert value == {"xx": 2, **{name: len(name) for name in names}}


# -- the code itself --------------------------------------------------------------------------

PURE = ("kernel", "pruning", "records")
FORBIDDEN = {"time", "random", "asyncio", "threading", "os", "uuid", "secrets", "datetime"}


def tree_of(module: str) -> ast.Module:
    return ast.parse((REPO / "gpsfsm" / "execution" / f"{module}.py").read_text())


def imported(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            names.add(node.module.split(".")[0])
    return names


def is_set(node: ast.expr | None, sets: set[str]) -> bool:
    """Whether an expression is a set, as far as one can see."""
    if isinstance(node, ast.Set | ast.SetComp):
        return True
    if isinstance(node, ast.Call):
        return ast.unparse(node.func) in ("set", "frozenset")
    if isinstance(node, ast.BinOp):
        return is_set(node.left, sets) or is_set(node.right, sets)
    return node is not None and ast.unparse(node) in sets


def iterated_sets(tree: ast.Module) -> list[str]:
    """Where the code depends on the order of a set."""
    sets: set[str] = set()
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.AnnAssign)
            and "set[" in ast.unparse(node.annotation).split("[")[0] + "["
        ):
            sets.add(ast.unparse(node.target))
        elif isinstance(node, ast.Assign) and is_set(node.value, sets):
            sets |= {ast.unparse(target) for target in node.targets}
    loops: list[ast.expr] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.For | ast.comprehension):
            loops.append(node.iter)
        elif isinstance(node, ast.Starred):
            loops.append(node.value)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ORDERING:
            loops += node.args
        elif isinstance(node, ast.Call) and not node.args and ".pop" in ast.unparse(node.func):
            assert isinstance(node.func, ast.Attribute)
            loops.append(node.func.value)
    return [ast.unparse(node) for node in loops if is_set(node, sets)]


ORDERING = ("list", "tuple", "iter", "enumerate", "zip", "map", "filter", "dict.fromkeys", "deque")


@pytest.mark.parametrize("module", PURE)
def test_the_kernel_knows_no_clock_and_no_luck(module: str) -> None:
    assert not imported(tree_of(module)) & FORBIDDEN


@pytest.mark.parametrize("module", [*PURE, "host", "virtual", "explore", "runner"])
def test_no_order_of_a_set_matters(module: str) -> None:
    assert iterated_sets(tree_of(module)) == []


@pytest.mark.parametrize(
    "text",
    [
        "for x in {1, 2}: pass",
        "known: set[int] = set()\nlist(known)",
        "self.known = set(a)\n[x for x in self.known]",
        "known = {x for x in a}\nknown.pop()",
        "known = set()\nf(*known)",
        "for x in set(a) - b: pass",
    ],
)
def test_the_test_above_can_fail(text: str) -> None:
    assert iterated_sets(ast.parse(text))
    assert "time" in imported(ast.parse("import time.sleep"))
