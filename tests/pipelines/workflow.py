"""A small runner of GitHub workflows: enough of it to run our action and our jobs as they stand.

Conditions and expressions are names, texts, ``==``, ``!=``, ``&&`` and ``||``; whatever else stands
there is a mistake. Actions of others are written down, not run.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tests.pipelines.support import Place

__all__ = ["Ran", "run_action", "run_job"]

_EXPRESSION = re.compile(r"\$\{\{ *(.*?) *\}\}")
_NAME = re.compile(r"[a-z_][\w-]*(\.[\w-]+)+")


@dataclass
class Ran:
    """What a run of an action or of a job has done."""

    failed: bool = False
    code: int = 0
    outputs: dict[str, str] = field(default_factory=dict)
    used: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    log: str = ""
    summary: str = ""


def run_action(file: Path, place: Place, inputs: Mapping[str, object]) -> Ran:
    """Run a composite action with these inputs, as ``with:`` gives them."""
    action = yaml.safe_load(file.read_text(encoding="utf-8"))
    assert set(inputs) <= set(action["inputs"]), "the action has no such input"
    names = {"github.action_path": str(file.parent)}
    for name, about in action["inputs"].items():
        assert name in inputs or not about.get("required"), f"the input {name} is required"
        value = inputs.get(name, about.get("default", ""))
        names[f"inputs.{name}"] = str(value).lower() if isinstance(value, bool) else str(value)
    ran = _run_steps(action["runs"]["steps"], place, names, {})
    ran.outputs = {
        name: _filled(about["value"], names) for name, about in action["outputs"].items()
    }
    return ran


def run_job(
    job: Mapping[str, Any], place: Place, names: Mapping[str, str], env: Mapping[str, str]
) -> Ran:
    """Run a job of a workflow: ``names`` are those of expressions, ``env`` that of the runner."""
    return _run_steps(job["steps"], place, dict(names), env)


def _run_steps(
    steps: list[dict[str, Any]], place: Place, names: dict[str, str], env: Mapping[str, str]
) -> Ran:
    ran = Ran()
    for step in steps:
        if ran.failed or not _holds(step.get("if", "true"), names):
            continue
        if "uses" in step:
            options = {key: _filled(value, names) for key, value in step.get("with", {}).items()}
            ran.used.append((step["uses"], options))
        else:
            _run_step(step, place, names, env, ran)
    return ran


def _run_step(
    step: dict[str, Any],
    place: Place,
    names: dict[str, str],
    machine: Mapping[str, str],
    ran: Ran,
) -> None:
    assert step["shell"] == "bash"
    assert not _EXPRESSION.search(step["run"]), "an input would be a part of the script"
    number = len(list(place.programs.glob("output*")))
    output, summary = (place.programs / f"{each}{number}" for each in ("output", "summary"))
    output.touch()
    env = {key: _filled(value, names) for key, value in step.get("env", {}).items()}
    env |= {**machine, "GITHUB_OUTPUT": str(output), "GITHUB_STEP_SUMMARY": str(summary)}
    done = place.bash(step["run"], env)
    ran.log += done.stdout + done.stderr
    ran.code, ran.failed = done.returncode, done.returncode != 0
    if summary.exists():
        ran.summary += summary.read_text(encoding="utf-8")
    for line in output.read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition("=")
        names[f"steps.{step['id']}.outputs.{name}"] = value


def _filled(text: object, names: Mapping[str, str]) -> str:
    return _EXPRESSION.sub(lambda actual: _value(actual[1], names), str(text))


def _holds(condition: object, names: Mapping[str, str]) -> bool:
    return any(
        all(_compared(part, names) for part in either.split("&&"))
        for either in str(condition).split("||")
    )


def _compared(text: str, names: Mapping[str, str]) -> bool:
    for sign, equal in (("==", True), ("!=", False)):
        if sign in text:
            left, right = text.split(sign)
            return (_value(left, names) == _value(right, names)) is equal
    return _value(text, names) not in ("", "false")


def _value(text: str, names: Mapping[str, str]) -> str:
    text = text.strip()
    if text.startswith("'"):
        assert text.endswith("'")
        return text[1:-1]
    if text in ("true", "false"):
        return text
    assert _NAME.fullmatch(text), f"this runner does not know {text}"
    assert text in names or text.startswith("steps."), f"there is no {text}"
    return names.get(text, "")
