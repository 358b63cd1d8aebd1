"""Which tests concern a module of analysis/: quick ones first, then the others."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["suites_of"]

_A = "tests/analysis"
_CORPUS = "tests/corpus/test_corpus.py"
_CONTROL = tuple(f"{_A}/test_{name}.py" for name in ("facts", "scenarios", "evaluate", "replays"))
_SOLVER = (f"{_A}/test_solver.py", f"{_A}/test_paths.py")
_TREES = "tests/compile/test_tree_facts.py"
_TIME = (
    f"{_A}/test_time.py",
    f"{_A}/test_time_rules.py",
    f"{_A}/rules/test_gp501_overlaps.py",
    f"{_A}/test_clock_oracle.py",
)
_DESCRIBED = (
    f"{_A}/test_capability_facts.py",
    f"{_A}/test_capability_scenarios.py",
    f"{_A}/test_prompt_oracle.py",
)
_ENGINES = (
    "tests/engines",
    "tests/equivalence/test_engine_difference.py",
    "tests/compile/test_engine_text.py",
)
_FLOW = (f"{_A}/test_flow_prompts.py", f"{_A}/test_placeholders.py")
_PROMPTS = (f"{_A}/rules/test_gp41x_buffers.py", f"{_A}/rules/test_gp41x_answers.py")
_WORDS = (f"{_A}/test_words.py", "tests/checking/test_check.py")

_TASKS = ("tests/tasks/test_stories.py", "tests/tasks/test_deciding.py")
_GRADING = ("tests/grading/test_grader.py", "tests/grading/test_plan_gist.py")
_CHECKING = (
    "tests/checking/test_check.py",
    "tests/cli/test_check.py",
    "tests/cli/test_capabilities_in_check.py",
)
_REST = (*_CONTROL, *_SOLVER, _TREES, f"{_A}/test_time_rules.py", *_ENGINES)

_MACHINES = (
    "tests/analysis/machines",
    "tests/compile/test_machines.py",
    "tests/compile/test_instants.py",
    "tests/checking/test_machine_check.py",
)

_BY_PLACE: tuple[tuple[str, tuple[str, ...]], ...] = (
    (r"machines/|compile/(machine|instants)", _MACHINES),
    (r"(tasks|equivalence|grading)/", (*_TASKS, *_GRADING, "tests/tasks", "tests/equivalence")),
    (
        r"(syntax|compile)/tree(s|_nodes)",
        ("tests/compile/test_trees.py", "tests/syntax/trees", *_TASKS, "tests/porting"),
    ),
    (r"syntax/", ("tests/checking/test_check.py", "tests/syntax")),
    (r"gpsfsm/", (*_CHECKING, *_ENGINES)),
    (r"assumptions/", (f"{_A}/assumptions", *_CONTROL[:1])),
    (r"rules/gp7|on_engine", (*_ENGINES, *_CONTROL[:1])),
    (r"rules/limits", (*_TIME, *_WORDS)),
    (r"rules/gp[68]", (*_GRADING, *_WORDS)),
    (r"rules/(gp[24]|names|missing)", (f"{_A}/rules", *_DESCRIBED)),
    (r"rules/gp5", (f"{_A}/rules", *_TIME)),
    (r"rules/", (f"{_A}/rules", *_WORDS, _CONTROL[1])),
    (r"timing/|decisions/(overlaps|makespan|energy|loading)", (*_TIME, *_DESCRIBED, _TREES)),
    (r"data_flow", (f"{_A}/rules/test_gp40x_values.py", *_FLOW, *_DESCRIBED)),
    (r"analysis/flow|decisions/prompts", (*_FLOW, *_DESCRIBED)),
    (r"causes", (*_CONTROL, *_PROMPTS, *_FLOW, *_DESCRIBED)),
    (r"words", (*_WORDS, f"{_A}/rules")),
    (r"analysis/(claims|context|paths)", (*_PROMPTS, *_REST)),
    (r"", _REST),
)


def suites_of(file: str, code: str = "") -> Iterator[tuple[str, ...]]:
    """The arguments of pytest for each set of tests that concerns a module, the quick one first.

    ``code``: the rule whose finding is harmed.
    """
    rule = re.search(r"gp(\d+)_", file)
    other = f"GP{rule[1]}" if rule else "GP7" if "engine" in file else "GP3 or GP4 or GP5"
    chosen = code or other
    yield (f"{_CORPUS}::test_a_plan_is_judged_as_its_sidecar_says", "-k", chosen)
    yield (f"{_CORPUS}::test_a_plan_is_judged_as_its_sidecar_says",)
    for test in next(tests for place, tests in _BY_PLACE if re.search(place, file)):
        yield (test,)
