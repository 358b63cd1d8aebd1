"""The package as it is laid out and imported."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import gpsfsm
from gpsfsm.checking import CheckOptions

REPO = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((REPO / "pyproject.toml").read_text())
PRODUCT = ("gpsfsm", "analysis", "grammars", "runners")
MAX_LINES = 600
MAX_FUNCTION_LINES = 50
MOST_MODULES = 140
MOST_PATTERNS = 20


def test_the_packages_listed_are_those_of_the_tree() -> None:
    roots = {"gpsfsm": "gpsfsm"} | {
        f"gpsfsm.{name}": name for name in ("analysis", "grammars", "runners")
    }
    actual = set()
    for package, folder in roots.items():
        for file in (REPO / folder).rglob("__init__.py"):
            if not any(part.is_symlink() for part in file.parents if part.is_relative_to(REPO)):
                inner = file.parent.relative_to(REPO / folder).parts
                actual.add(".".join([package, *inner]))
    assert set(PYPROJECT["tool"]["setuptools"]["packages"]) == actual


def test_every_data_file_is_packaged() -> None:
    data = PYPROJECT["tool"]["setuptools"]["package-data"]
    places = PYPROJECT["tool"]["setuptools"]["package-dir"]
    packaged = set()
    for package, patterns in data.items():
        folder = places.get(package, package.replace(".", "/"))
        for pattern in patterns:
            packaged |= {file.resolve() for file in (REPO / folder).glob(pattern)}
    present = {
        file.resolve()
        for folder in PRODUCT
        for file in (REPO / folder).rglob("*")
        if file.is_file() and file.suffix not in (".py", ".pyc")
    }
    assert packaged == present


def test_the_public_names() -> None:
    assert gpsfsm.__all__ == sorted(gpsfsm.__all__)
    assert len(gpsfsm.__all__) <= 125  # docs/adr/0008-public-surface.md
    for name in gpsfsm.__all__:
        assert getattr(gpsfsm, name) is not None
    assert dir(gpsfsm) == gpsfsm.__all__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = gpsfsm.nothing


@pytest.mark.parametrize("folder", ["analysis", "grammars", "runners"])
def test_the_folders_cannot_be_imported_by_their_own_name(folder: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import {folder}"],
        cwd=REPO,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert f"import gpsfsm.{folder}, not {folder}" in done.stderr


def output_of(code: str) -> list[str]:
    """The lines that a process prints which runs this and then prints its modules."""
    script = f"{code}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=REPO, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def loaded_by(code: str) -> set[str]:
    return set(output_of(code)[-1].split())


def test_importing_gpsfsm_loads_nothing_heavy() -> None:
    heavy = {"z3", "networkx", "lxml", "lark", "pydantic", "yaml", "httpx", "click"}
    assert not heavy & loaded_by("import gpsfsm")


def test_of_what_is_heavy_a_check_loads_the_graph_library_only() -> None:
    code = "import gpsfsm\ngpsfsm.check('<Plan/>')"
    heavy = {"networkx", "httpx", "lark", "pydantic", "yaml"}
    assert heavy & loaded_by(code) == {"networkx"}  # the automaton is its graph: ADR 0009


START = """
import re, sys
compiled = 0
build = re._compiler.compile

def count(*arguments):
    global compiled
    frame = sys._getframe(1)
    while frame.f_globals["__name__"].partition(".")[0] == "re":
        frame = frame.f_back
    compiled += frame.f_globals["__name__"].startswith("gpsfsm")
    return build(*arguments)

re._compiler.compile = count
from gpsfsm.cli import main
assert main(["check", "--isolated", "corpus/plans/tour_guide.xml"]) == 1
print(compiled)
"""


STANDARD_DATACLASS = re.compile(r"^from dataclasses import .*\bdataclass\b", re.MULTILINE)


def source_of(module: str) -> str:
    return inspect.getsource(importlib.import_module(module))


def test_a_check_starts_with_few_modules_and_patterns() -> None:
    """What a cold check costs besides its libraries, counted: times depend on the machine."""
    lines = output_of(START)
    own = {name for name in lines[-1].split() if name.startswith("gpsfsm")}
    assert len(own) <= MOST_MODULES
    assert int(lines[-2]) <= MOST_PATTERNS
    # those that only other options, other engines and other texts need
    idle = (
        "workers.engines",
        "checking.parallel",
        "model.engine",
        "compile.trees",
        "fixing",
        "tasks",
    )
    assert not own & {f"gpsfsm.{name}" for name in idle}
    assert not {name for name in own if "rules.gp7" in name}
    assert not {name for name in own if STANDARD_DATACLASS.search(source_of(name))}


def check_of(runners: int, options: str = "") -> str:
    plan = '<Runner interface="demo/Go" provider="demo/Go"/>' * runners
    return f"import gpsfsm\nassert gpsfsm.check('<Plan>{plan}</Plan>'{options}).plans[0].facts"


def test_a_check_that_proves_nothing_loads_no_solver() -> None:
    assert "z3" in loaded_by(check_of(201))
    assert "z3" not in loaded_by(check_of(201, ", solver='structural'"))


DESCRIBED = """
<Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner"
    x="1.0" y="2.0"/>
<Runner interface="perception_capabilities/SpeechRunner"
    provider="perception_capabilities/SpeechRunner" text="Hello."/>
"""
WAIT = """
<Runner interface="generic_capabilities/WaitRunner" provider="generic_capabilities/WaitRunner"
    seconds="{}"/>
"""


def check_described(*, last: str) -> str:
    """Check a plan of more than 200 runners that hold resources; it must have findings."""
    both = f'<Control type="parallel_all">{DESCRIBED}{DESCRIBED}</Control>'
    return f"""
import gpsfsm
(plan,) = gpsfsm.check(
    '''<Plan>{both}{DESCRIBED * 99}{last}</Plan>''', solver='structural'
).plans
assert plan.facts.runners > 200
assert 'GP501' in {{found.rule for found in plan.findings}}
assert not {{'GP210', 'GP903', 'GP904'}} & {{found.rule for found in plan.findings}}
"""


def test_the_structural_pass_asks_a_solver_about_durations_alone() -> None:
    left = f'<Control type="parallel_any">{DESCRIBED}</Control>'
    assert "z3" not in loaded_by(check_described(last=left))
    # durations: a simple run shows that the two meet
    assert "z3" not in loaded_by(check_described(last=WAIT.format(5)))
    # but none shows that what comes after 2 s is active when the plan completes after 1 s
    late = f'<Control type="sequential">{WAIT.format(2)}{DESCRIBED}</Control>'
    last = f'<Control type="parallel_any">{WAIT.format(1)}{late}</Control>'
    assert "z3" in loaded_by(check_described(last=last))


def modules_with_examples() -> list[str]:
    """The modules of the product that have a doctest, by their full names."""
    results = []
    for folder in PRODUCT:
        for file in (REPO / folder).rglob("*.py"):
            path = file.resolve().relative_to(REPO.resolve())
            if ">>> " in file.read_text(encoding="utf-8"):
                parts = [*path.parts[:-1], *([] if path.stem == "__init__" else [path.stem])]
                results.append(".".join(parts if parts[0] == "gpsfsm" else ["gpsfsm", *parts]))
    return sorted(set(results))


@pytest.mark.parametrize("module", modules_with_examples())
def test_examples_in_docstrings(module: str) -> None:
    outcome = doctest.testmod(importlib.import_module(module))
    assert outcome.attempted > 0
    assert outcome.failed == 0


def test_examples_are_found() -> None:
    assert {"gpsfsm", "gpsfsm.api", "gpsfsm.grammars"} <= set(modules_with_examples())


@pytest.mark.parametrize("folder", [*PRODUCT, "corpus", "benchmarks", "docs", "examples", "tests"])
def test_no_module_is_too_long(folder: str) -> None:
    lines = {
        str(file.relative_to(REPO)): len(file.read_text(encoding="utf-8").splitlines())
        for file in (REPO / folder).rglob("*.py")
    }
    assert lines
    assert {name: count for name, count in lines.items() if count > MAX_LINES} == {}


@pytest.mark.parametrize("folder", PRODUCT)
def test_no_function_is_too_long(folder: str) -> None:
    lines = {
        f"{file.relative_to(REPO)}: {node.name}": (node.end_lineno or 0) - node.lineno + 1
        for file in (REPO / folder).rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert {name: count for name, count in lines.items() if count > MAX_FUNCTION_LINES} == {}


def test_help_shows_the_options_of_a_check() -> None:
    """They are listed, not hidden behind ``**options``, with the defaults of the command line."""
    shown = inspect.signature(gpsfsm.check).parameters
    defaults = CheckOptions()
    names = ("rlimit", "total_rlimit", "max_scenarios", "solver", "deadline_s", "energy_limit_j")
    assert {name: shown[name].default for name in names} == {
        name: getattr(defaults.analysis, name) for name in names
    }
    assert shown["builtin_capabilities"].default is True
    assert inspect.Parameter.VAR_KEYWORD not in {each.kind for each in shown.values()}
