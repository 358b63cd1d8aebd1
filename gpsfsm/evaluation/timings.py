"""How long models took in a recorded experiment, in the two forms in which it is written down."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError
from gpsfsm.evaluation.keys import Cell, Key, model_name
from gpsfsm.evaluation.labels import read_rows, seconds_of
from gpsfsm.inputs import read_file
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["Time", "published_times", "recorded_times"]

Time = tuple[Key, float]
"""An answer, and its seconds."""

_RESPONSES = "responses.jsonl"
_PUBLISHED = os.path.join("timing_data", "iteration_times_all.csv")  # noqa: PTH118
_MAX_RESPONSES = 256 << 20
_PROMPTS = {"zero": "zeroshot", "one": "oneshot"}
_TASK = re.compile(r"generative_([1-9][0-9]{0,3})")
_ITERATION = re.compile(r"Itr([1-9][0-9]{0,5})")
_TEXTS = ("system", "model", "prompt")
_NUMBERS = ("task", "iteration")


def recorded_times(base: str) -> Iterator[Time]:
    """The times in ``responses.jsonl``, a line of JSON for each answer; nothing without the file.

    Raises InputError with the line that is wrong.
    """
    file = os.path.join(base, _RESPONSES)  # noqa: PTH118
    if not os.path.isfile(file):  # noqa: PTH113
        return
    try:
        content = read_file(file, _MAX_RESPONSES)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    for number, line in enumerate(content.splitlines(), start=1):
        if not line.strip():
            continue
        try:
            record = strict_loads(line)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{file}:{number}: this is not JSON: {error}") from error
        found = _recorded(record, f"{file}:{number}")
        if found is not None:
            yield found


def _recorded(record: Any, place: str) -> Time | None:
    if not isinstance(record, dict):
        raise InputError(f"{place}: this is not a JSON object")
    for name in _TEXTS:
        if not isinstance(record.get(name), str):
            raise InputError(f"{place}: '{name}' must be text")
    for name in _NUMBERS:
        if not isinstance(record.get(name), int):
            raise InputError(f"{place}: '{name}' must be a whole number")
    seconds = record.get("latency_s")
    found = None if seconds is None else seconds_of(str(seconds), place)
    if found is None:
        return None
    model = model_name(record["model"], str(record.get("version") or ""))
    cell = Cell(record["system"].lower(), model, record["prompt"], record["task"])
    return Key(cell, record["iteration"]), found


def published_times(base: str, system: str) -> Iterator[Time]:
    """The times of one system in the public repository; nothing without the file.

    Raises InputError with the line that is wrong.
    """
    for folder in sorted(os.listdir(base)):  # noqa: PTH208
        file = os.path.join(base, folder, _PUBLISHED)  # noqa: PTH118
        if folder.lower() == system and os.path.isfile(file):  # noqa: PTH113
            yield from _published(file, system)


def _published(file: str, system: str) -> Iterator[Time]:
    columns, rows = read_rows(file)
    for name in ("Task", "Model", "Version", "Prompt"):
        if name not in columns:
            raise InputError(f"{file}:1: the column '{name}' is missing")
    iterations = [(name, found[1]) for name in columns if (found := _ITERATION.fullmatch(name))]
    for line, cells in rows:
        task = _TASK.fullmatch(cells["Task"].strip())
        if task is None:
            raise InputError(f"{file}:{line}: the task must be generative_1 or the like")
        model = model_name(cells["Model"].strip(), cells["Version"].strip())
        prompt = _PROMPTS.get(cells["Prompt"].strip(), cells["Prompt"].strip())
        cell = Cell(system, model, prompt, int(task[1]))
        for name, number in iterations:
            seconds = seconds_of(cells[name], f"{file}:{line}")
            if seconds is not None:
                yield Key(cell, int(number)), seconds
