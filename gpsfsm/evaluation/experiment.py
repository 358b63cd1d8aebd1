"""Recorded experiments: which answers there are, what people said of them, what they took.

Two layouts are recognised, that of the paper's public repository and a flat one
(docs/experiments.md). Nothing else in the folder is looked at, and no answer is read here.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError
from gpsfsm.evaluation.keys import Cell, Key, model_name
from gpsfsm.evaluation.labels import load_labels
from gpsfsm.evaluation.timings import published_times, recorded_times

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.evaluation.labels import Label
    from gpsfsm.grading import Grade

__all__ = ["PUBLISHED", "Answer", "read_experiment"]

PUBLISHED = "Experiment_1"
"""The folder of the public repository that holds the experiment."""

_OUTPUTS = "outputs"
_LABELS = "labels.csv"
_OPENAI = "openai-"
_TASK = re.compile(r"(?:task|generative)_?([1-9][0-9]{0,3})")
_ANSWER = re.compile(r"0*([1-9][0-9]{0,5})\.xml")


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer of a model. ``path`` is None if there is no file: no plan was found in it."""

    key: Key
    path: str | None
    human: Grade | None
    seconds: float | None


def read_experiment(root: str, labels: str | None = None) -> list[Answer]:
    """The answers of an experiment, in the order of their keys.

    An answer is there if it has a file or a time. ``labels`` names another file of labels than the
    one in the folder. Raises InputError if the folder holds no experiment, or for a file with times
    or labels that is wrong.
    """
    base = _base(root)
    files = _files(base)
    if not files:
        shapes = f"MODEL/PROMPT/task1/1.xml, or {_OUTPUTS}/MODEL/PROMPT/generative_1/1.xml, below"
        raise InputError(f"{root}: there is no experiment in it: it needs {shapes} a system folder")
    times = dict(recorded_times(base))
    for system in sorted({key.cell.system for key in files}):
        times.update(published_times(base, system))
    known = _labels(base, labels)
    found = []
    for key in sorted({*files, *times}):
        label = known.get(key)
        human, seconds = (None, None) if label is None else (label.human, label.seconds)
        found.append(Answer(key, files.get(key), human, times.get(key, seconds)))
    return found


def _base(root: str) -> str:
    published = os.path.join(root, PUBLISHED)  # noqa: PTH118  (keeps a leading ./)
    return published if os.path.isdir(published) else root  # noqa: PTH112


def _files(base: str) -> dict[Key, str]:
    """The path of every answer. Raises InputError for two files of one answer."""
    found: dict[Key, str] = {}
    for cell, folder in _cells(base):
        for name in _names(folder):
            path, number = os.path.join(folder, name), _ANSWER.fullmatch(name)  # noqa: PTH118
            if number is None or not os.path.isfile(path):  # noqa: PTH113  (a pipe never ends)
                continue
            key = Key(cell, int(number[1]))
            if key in found:
                raise InputError(f"{path}: this is the same answer as {found[key]}")
            found[key] = path
    return found


def _cells(base: str) -> Iterator[tuple[Cell, str]]:
    """The folders that hold answers."""
    for system, top in _folders(base):
        outputs = dict(_folders(top)).get(_OUTPUTS, top)
        for model, of_model in _folders(outputs):
            for prompt, of_prompt in _folders(of_model):
                for task, folder in _folders(of_prompt):
                    number = _TASK.fullmatch(task)
                    if number is not None:
                        name = model.removeprefix(_OPENAI)
                        yield Cell(system.lower(), name, prompt, int(number[1])), folder


def _folders(path: str) -> list[tuple[str, str]]:
    inside = ((name, os.path.join(path, name)) for name in _names(path))  # noqa: PTH118
    return [(name, one) for name, one in inside if name[0] != "." and os.path.isdir(one)]  # noqa: PTH112


def _names(path: str) -> list[str]:
    try:
        return sorted(os.listdir(path))  # noqa: PTH208
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _labels(base: str, file: str | None) -> Mapping[Key, Label]:
    """Labels by the answer that their cells name: system, model, version, prompt and so on."""
    place = os.path.join(base, _LABELS)  # noqa: PTH118
    if file is None and not os.path.isfile(place):  # noqa: PTH113
        return {}
    file = file or place
    loaded = load_labels(file)
    for name in ("system", "model", "prompt", "task", "iteration"):
        if name not in loaded.columns:
            raise InputError(f"{file}:1: the column '{name}' is missing")
    found: dict[Key, Label] = {}
    for label in loaded.by_path.values():
        key = _labelled(label, f"{file}:{label.line}")
        if key in found:
            raise InputError(f"{file}:{label.line}: line {found[key].line} is of the same answer")
        found[key] = label
    return found


def _labelled(label: Label, place: str) -> Key:
    cells = label.cells
    try:
        task, iteration = int(cells["task"]), int(cells["iteration"])
    except ValueError as error:
        raise InputError(f"{place}: 'task' and 'iteration' must be numbers") from error
    model = model_name(cells["model"], cells.get("version", ""))
    return Key(Cell(cells["system"].lower(), model, cells["prompt"], task), iteration)
