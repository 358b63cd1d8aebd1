"""Cases: failing scenarios in files that people can read, to be played again later."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError, system_reason
from gpsfsm.files import read
from gpsfsm.fuzzing.runs import scenario_of
from gpsfsm.fuzzing.subject import FAULTS, LONGEST_MS, Act, Fate, TimedScenario, in_ms
from gpsfsm.model.labels import action
from gpsfsm.report.json import scenario_as_data
from gpsfsm.streams import write_bytes
from gpsfsm.strict_json import json_defect, strict_loads

if TYPE_CHECKING:
    from gpsfsm.fuzzing.campaign import Failure
    from gpsfsm.fuzzing.subject import Subject

_VERSION = 1
_MAX_BYTES = 1 << 24
_MAX_CASES = 10_000


@dataclass(frozen=True, slots=True)
class Case:
    """A case as it was read: what is not in ``acts`` (by element path and visit) is plain.

    ``file`` is its own file; ``plan`` is the text of the plan that it was found in.
    """

    file: str
    broken: str
    plan_file: str
    plan: str
    faults: tuple[str, ...]
    limit_s: float | None
    seed: int
    acts: tuple[tuple[str, int, Act], ...]


def case_text(failure: Failure, source: str, *, seed: int = 0) -> str:
    """A case as the content of a file; ``source`` is the text of the plan."""
    run, subject = failure.run, failure.run.subject
    data = {
        "gpsfsm_case": _VERSION,
        "property": failure.broken.name,
        "message": failure.breach.message,
        "plan_file": run.plan.file,
        "faults": list(subject.faults),
        "time_limit_s": None if subject.limit_ms is None else subject.limit_ms / 1_000,
        "seed": seed,
        "acts": [
            {
                "element": run.plan.path(runner),
                **({"visit": visit} if subject.is_machine else {}),
                "line": runner.line,
                "runner": action(runner),
                "fate": act.fate.value,
                "duration_ms": act.duration_ms,
            }
            for (visit, runner), act, plain in zip(
                product(range(1, subject.visits + 1), run.plan.runners),
                run.scenario.acts,
                subject.plain.acts,
                strict=True,
            )
            if act != plain
        ],
        "scenario": scenario_as_data(scenario_of(run)),
        "plan": source.splitlines(keepends=True),
    }
    return json.dumps(data, ensure_ascii=True, indent=2) + "\n"


def case_name(failure: Failure, text: str) -> str:
    """The name of its file: the property, and a digest of the content."""
    word = "".join(each if each.isalnum() else "-" for each in failure.broken.name)[-40:]
    return f"{word.strip('-') or 'case'}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"


def keep_case(failure: Failure, source: str, folder: str, *, seed: int = 0) -> Path:
    """Write a case into a folder, which is made if need be; the path. Raises GpsfsmError."""
    text = case_text(failure, source, seed=seed)
    path = Path(folder) / case_name(failure, text)
    write_bytes(text.encode(), str(path), parents=True, within=folder)
    return path


def cases_in(folder: str) -> list[Case]:
    """The cases of a folder, in the order of their names; none if there is no such folder.

    Raises InputError for what is no case.
    """
    try:
        files = sorted(Path(folder).glob("*.json"))
        if Path(folder).exists() and not Path(folder).is_dir():
            raise InputError(f"{folder}: is not a folder")
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: cannot be read: {system_reason(error)}") from error
    if len(files) > _MAX_CASES:
        raise InputError(f"{folder}: contains more than {_MAX_CASES:,} cases; remove some")
    return [read_case(str(file)) for file in files]


def read_case(file: str) -> Case:
    """Read a case. Raises InputError, which says what is wrong with the file."""
    try:
        content = read(file, _MAX_BYTES)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    if len(content) > _MAX_BYTES:
        raise InputError(f"{file}: is larger than {_MAX_BYTES} bytes")
    try:
        data = strict_loads(content)
    except (ValueError, RecursionError) as error:
        raise InputError(json_defect(file, error)) from error
    try:
        return _case(file, data)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        message = f"{type(error).__name__}: {error}"[:200]
        raise InputError(f"{file}: is not a case of 'gpsfsm fuzz' ({message})") from error


def _case(file: str, data: dict[str, Any]) -> Case:
    if data["gpsfsm_case"] != _VERSION:
        raise ValueError(f"gpsfsm_case must be {_VERSION}")
    limit_s = data["time_limit_s"]
    if limit_s is not None and not (
        isinstance(limit_s, int | float) and 0 < limit_s <= LONGEST_MS / 1_000
    ):
        raise ValueError("time_limit_s must be a positive number or null")
    if not isinstance(data["seed"], int) or isinstance(data["seed"], bool):
        raise TypeError("seed must be an integer")
    return Case(
        file=file,
        broken=_text(data["property"]),
        plan_file=_text(data["plan_file"]),
        plan="".join(map(_text, data["plan"])),
        faults=tuple(word for word in FAULTS if word in map(_text, data["faults"])),
        limit_s=limit_s,
        seed=data["seed"],
        acts=tuple((_text(act["element"]), _visit(act), _act(act)) for act in data["acts"]),
    )


def _act(data: dict[str, Any]) -> Act:
    duration_ms = data["duration_ms"]
    if isinstance(duration_ms, bool) or not isinstance(duration_ms, int | float):
        raise TypeError("duration_ms must be a number")
    if not 0.001 <= duration_ms <= LONGEST_MS:
        raise ValueError(f"duration_ms must be from 0.001 to {LONGEST_MS}")
    return Act(Fate(data["fate"]), in_ms(round(duration_ms * 1_000)))


def _visit(data: dict[str, Any]) -> int:
    visit = data.get("visit", 1)
    if isinstance(visit, bool) or not isinstance(visit, int) or visit < 1:
        raise TypeError("visit must be a number from 1")
    return visit


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{str(value)[:40]} is not a text")
    return value


def scenario_in(case: Case, subject: Subject) -> TimedScenario | None:
    """The case as a scenario of a plan.

    None if the plan lacks one of its instances, or if that cannot do what the case says.
    """
    numbers = {subject.plan.path(runner): n for n, runner in enumerate(subject.plan.runners)}
    acts = list(subject.plain.acts)
    for element, visit, act in case.acts:
        number = numbers.get(element)
        if number is None or visit > subject.visits or act.fate not in subject.fates[number]:
            return None
        acts[number + len(numbers) * (visit - 1)] = act
    return TimedScenario(tuple(acts))
