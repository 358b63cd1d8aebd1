"""Plants mutants in a copy of the repository and runs tests, each in a process of its own.

The processes are forked from one that has loaded what takes long to load, but nothing of gpsfsm.
"""

from __future__ import annotations

import importlib
import os
import resource
import shutil
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from tests.mutants.operators import planted
from tests.mutants.suites import suites_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.mutants.operators import Mutant

__all__ = ["KILLED", "SURVIVED", "TIMED_OUT", "Judge", "copied", "run_tests"]

ROOT = Path(__file__).resolve().parents[2]
KILLED, SURVIVED, TIMED_OUT = "killed", "survived", "timed out"
_LEFT_OUT = ("benchmarks", "build", "dist", "node_modules")
_HEAVY = ("jsonschema", "lxml.etree", "networkx", "pydantic", "pytest", "yaml", "z3")


def copied(folder: Path) -> Path:
    """A copy of the repository in which modules of analysis/ are compiled anew each time."""

    def left_out(place: str, names: list[str]) -> set[str]:
        top = Path(place) == ROOT
        in_analysis = "__pycache__" in names and Path(place).is_relative_to(ROOT / "analysis")
        hidden = {name for name in names if top and (name.startswith(".") or name in _LEFT_OUT)}
        return hidden | ({"__pycache__"} if in_analysis else set())

    target = folder / "copy"
    shutil.copytree(ROOT, target, symlinks=True, ignore=left_out)
    (target / "benchmarks").symlink_to(ROOT / "benchmarks")
    return target


class Judge:
    """Judges mutants in one copy; knows how long each set of tests takes without a mutant."""

    def __init__(self, copy: Path) -> None:
        self._copy = copy
        self._took_s: dict[tuple[str, ...], float | None] = {}

    def judge(self, mutant: Mutant, code: str = "") -> str:
        """What becomes of a mutant; ``code``: the rule whose finding it harms."""
        file = self._copy / mutant.file
        source = file.read_text(encoding="utf-8")
        failed = SURVIVED
        for tests in suites_of(mutant.file, code):
            took_s = self._baseline(tests)
            if took_s is None:
                continue
            try:
                file.write_text(planted(source, mutant), encoding="utf-8")
                failed, _ = run_tests(self._copy, tests, limit_s=max(20, 4 * int(took_s) + 1))
            finally:
                file.write_text(source, encoding="utf-8")
            if failed != SURVIVED:
                break
        return failed

    def _baseline(self, tests: tuple[str, ...]) -> float | None:
        """The processor time of the tests; None if they fail without any mutant."""
        if tests not in self._took_s:
            failed, seconds = run_tests(self._copy, tests, limit_s=600)
            if failed != SURVIVED:
                print(f"left out, for they fail without a mutant: {' '.join(tests)}", flush=True)
            self._took_s[tests] = seconds if failed == SURVIVED else None
            print(f"without a mutant {seconds:.0f} s of processor time: {tests[0]}", flush=True)
        return self._took_s[tests]


def run_tests(copy: Path, words: Sequence[str], *, limit_s: int) -> tuple[str, float]:
    """Run pytest on the copy: what came of it, and the seconds of processor time.

    The limit is one of processor time, which does not depend on what else the machine does.
    """
    for name in _HEAVY:
        importlib.import_module(name)
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
        _child(copy, words)
    _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    # 5: no test was selected; a process over its limit is killed by SIGKILL or SIGXCPU
    result = SURVIVED if code in (0, 5) else TIMED_OUT if code < 0 else KILLED
    return result, usage.ru_utime + usage.ru_stime


def _child(copy: Path, words: Sequence[str]) -> None:
    """The life of a child: it never comes back."""
    code = 3
    try:
        os.setsid()
        os.chdir(copy)
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        sys.dont_write_bytecode = True
        os.environ |= {"PYTHONDONTWRITEBYTECODE": "1", "HYPOTHESIS_PROFILE": "fixed"}
        os.environ["CASES"] = "all"
        for name in [name for name in sys.modules if name.split(".")[0] in ("gpsfsm", "tests")]:
            del sys.modules[name]
        sys.path[:] = [str(copy), *(each for each in sys.path if each not in ("", str(ROOT)))]
        importlib.invalidate_caches()
        import pytest

        options = ("-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--rootdir", str(copy))
        code = int(pytest.main([*options, *words]))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
