"""Recorded experiments: the answers there are, what people said of them, how long they took.

Two layouts of folders are recognised, that of the paper's public repository and a flat one
(docs/experiments.md): nothing else in the folder is looked at, and no answer is read here. The
third is a file of JSON lines, which holds the answers as the models wrote them.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.checking.inputs import find_inputs, holds_lines
from gpsfsm.errors import InputError
from gpsfsm.files import read_whole
from gpsfsm.grading.labels import load_labels, read_rows, seconds_of
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from gpsfsm.checking.inputs import Input
    from gpsfsm.grading.grader import Grade
    from gpsfsm.grading.labels import Label

PUBLISHED = "Experiment_1"
"""The folder of the public repository that holds the experiment."""

_OUTPUTS = "outputs"
_LABELS = "labels.csv"
_CORRUPTED = "corrupted"
_OPENAI = "openai-"
_TASK = re.compile(r"(?:task|generative)_?([1-9][0-9]{0,3})")
_ANSWER = re.compile(r"0*([1-9][0-9]{0,5})\.xml")


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer of a model. ``path`` is None if there is no file: no plan was found in it.

    ``line`` is the answer if it is a line of a file. A ``corrupted`` one is counted apart.
    """

    key: Key
    path: str | None
    human: Grade | None
    seconds: float | None
    line: Input | None = None
    corrupted: bool = False


def read_experiment(root: str, labels: str | None = None, field: str | None = None) -> list[Answer]:
    """The answers of an experiment, in the order of their keys.

    An answer is there if it has a file or a time. ``labels`` names another file of labels than the
    one in the folder. ``root`` may be a file of JSON lines, with the answers in this field. Raises
    InputError if there is no experiment, or for a file with times or labels that is wrong, and
    UsageError for a field where there are no JSON lines.
    """
    if field is not None or holds_lines(root, field):
        return sorted(_of_lines(root, labels, field), key=attrgetter("key"))
    base = _base(root)
    files = _files(base)
    if not files:
        shapes = f"MODEL/PROMPT/task1/1.xml, or {_OUTPUTS}/MODEL/PROMPT/generative_1/1.xml, below"
        raise InputError(f"{root}: there is no experiment in it: it needs {shapes} a system folder")
    times = dict(recorded_times(base))
    for system in sorted({key.cell.system for key in files}):
        times.update(published_times(base, system))
    labelled = _labels(base, labels)
    answers = []
    for key in sorted({*files, *times}):
        label = labelled.get(key)
        human, seconds = (None, None) if label is None else (label.human, label.seconds)
        corrupted = _is_corrupted(label)
        answers.append(
            Answer(key, files.get(key), human, times.get(key, seconds), corrupted=corrupted)
        )
    return answers


def _of_lines(file: str, labels: str | None, field: str | None) -> Iterator[Answer]:
    """The answers in JSON lines; each line says which answer it is, as in ``responses.jsonl``."""
    labelled = {} if labels is None else _labels("", labels)
    places: dict[Key, str] = {}
    for line in find_inputs([file], field):
        place = line.path
        if place == line.answers:  # said of the file, not of a line
            raise InputError(f"{place}: {line.problem}")
        key, seconds = _recorded(line.line, place)
        if key in places:
            raise InputError(f"{place}: this is the same answer as {places[key]}")
        places[key] = place
        label = labelled.get(key)
        if label is None:
            yield Answer(key, place, None, seconds, line)
        else:
            corrupted = _is_corrupted(label)
            yield Answer(key, place, label.human, seconds or label.seconds, line, corrupted)


def _joined(*parts: str) -> str:
    """A path as the user has begun it: pathlib would drop a leading ``./``."""
    return os.path.join(*parts)  # noqa: PTH118


def _is_file(path: str) -> bool:
    """True for a regular file, and not for a pipe, which may never end."""
    return os.path.isfile(path)  # noqa: PTH113


def _is_folder(path: str) -> bool:
    return os.path.isdir(path)  # noqa: PTH112


def _base(root: str) -> str:
    published = _joined(root, PUBLISHED)
    return published if _is_folder(published) else root


def _files(base: str) -> dict[Key, str]:
    """The path of every answer. Raises InputError for two files of one answer."""
    files: dict[Key, str] = {}
    for cell, folder in _cells(base):
        for name in _names(folder):
            path, number = _joined(folder, name), _ANSWER.fullmatch(name)
            if number is None or not _is_file(path):
                continue
            key = Key(cell, int(number[1]))
            if key in files:
                raise InputError(f"{path}: this is the same answer as {files[key]}")
            files[key] = path
    return files


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
    inside = ((name, _joined(path, name)) for name in _names(path))
    return [(name, one) for name, one in inside if name[0] != "." and _is_folder(one)]


def _names(path: str) -> list[str]:
    try:
        return sorted(each.name for each in Path(path).iterdir())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _labels(base: str, file: str | None) -> Mapping[Key, Label]:
    """Labels by the answer that their cells name: system, model, version, prompt and so on."""
    place = _joined(base, _LABELS)
    if file is None and not _is_file(place):
        return {}
    file = file or place
    loaded = load_labels(file)
    for name in ("system", "model", "prompt", "task", "iteration"):
        if name not in loaded.columns:
            raise InputError(f"{file}:1: the column '{name}' is missing")
    by_key: dict[Key, Label] = {}
    for label in loaded.by_path.values():
        _yes_or_no(label, f"{file}:{label.line}")
        key = _labelled(label, f"{file}:{label.line}")
        if key in by_key:
            raise InputError(f"{file}:{label.line}: line {by_key[key].line} is of the same answer")
        by_key[key] = label
    return by_key


def _labelled(label: Label, place: str) -> Key:
    cells = label.cells
    try:
        task, iteration = int(cells["task"]), int(cells["iteration"])
    except ValueError as error:
        raise InputError(f"{place}: 'task' and 'iteration' must be numbers") from error
    model = model_name(cells["model"], cells.get("version", ""))
    return Key(Cell(cells["system"].lower(), model, cells["prompt"], task), iteration)


def _yes_or_no(label: Label, place: str) -> None:
    """Raise InputError for a cell of the column ``corrupted`` that says neither."""
    cell = label.cells.get(_CORRUPTED, "").strip().lower()
    if cell not in ("yes", "no", ""):
        message = f"'{clip(cell, 40)}' in the column 'corrupted' is neither yes nor no"
        raise InputError(f"{place}: {message}; write yes, no or nothing")


def _is_corrupted(label: Label | None) -> bool:
    return label is not None and label.cells.get(_CORRUPTED, "").strip().lower() == "yes"


def mark_corrupted(answers: Iterable[Answer], file: str) -> tuple[list[Answer], list[str]]:
    """Mark the answers that a file lists as corrupted; the second list is of lines without one.

    Each line of the file, which is CSV, names some answers: with ``system``, ``model`` and
    ``prompt``, and perhaps ``version``, ``task`` and ``iteration``. An empty cell or a missing
    column stands for any value; without a ``version``, ``model`` is the whole name of the model.
    Raises InputError with the line that is wrong.
    """
    columns, rows = read_rows(file)
    for name in _TEXTS:
        if name not in columns:
            raise InputError(f"{file}:1: the column '{name}' is missing")
    patterns = {line: _pattern(cells, f"{file}:{line}") for line, cells in rows}
    marked, unused = [], set(patterns)
    for answer in answers:
        key = (*answer.key.cell, answer.key.iteration)
        lines = {
            line
            for line, pattern in patterns.items()
            if all(part in (None, own) for part, own in zip(pattern, key, strict=True))
        }
        unused -= lines
        marked.append(replace(answer, corrupted=answer.corrupted or bool(lines)))
    return marked, [f"{file}:{line}" for line in sorted(unused)]


def _pattern(cells: Mapping[str, str], place: str) -> tuple[str | int | None, ...]:
    """System, model, prompt, task and iteration as a line names them; None: any of them."""
    texts = {name: cells.get(name, "").strip() for name in (*_TEXTS, *_NUMBERS, "version")}
    model = texts["model"] and model_name(texts["model"], texts["version"])
    parts = [texts["system"].lower() or None, model or None, texts["prompt"] or None]
    if not any((*parts, *(texts[name] for name in _NUMBERS))):
        raise InputError(f"{place}: this line names no answer in particular")
    if texts["version"] and not model:
        raise InputError(f"{place}: there is a version without a model")
    try:
        numbers = [int(texts[name]) if texts[name] else None for name in _NUMBERS]
    except ValueError as error:
        raise InputError(f"{place}: 'task' and 'iteration' must be numbers") from error
    return (*parts, *numbers)


class Cell(NamedTuple):
    """The cell of the table in which answers are put together; keys are ordered by it."""

    system: str
    model: str
    prompt: str
    task: int


class Key(NamedTuple):
    """The key of the answer."""

    cell: Cell
    iteration: int


def model_name(model: str, version: str) -> str:
    """One name for a model and its version, as the folders of answers have it."""
    return f"{model}-{version}" if version not in ("", "n/a") else model


Time = tuple[Key, float]
"""An answer, and its seconds."""

_RESPONSES = "responses.jsonl"
_PUBLISHED = ("timing_data", "iteration_times_all.csv")
_MAX_RESPONSES = 256 << 20
_PROMPTS = {"zero": "zeroshot", "one": "oneshot"}
_TASK_CELL = re.compile(r"generative_([1-9][0-9]{0,3})")
_ITERATION = re.compile(r"Itr([1-9][0-9]{0,5})")
_TEXTS = ("system", "model", "prompt")
_NUMBERS = ("task", "iteration")


def recorded_times(base: str) -> Iterator[Time]:
    """The times in ``responses.jsonl``, a line of JSON for each answer; nothing without the file.

    Raises InputError with the line that is wrong.
    """
    file = _joined(base, _RESPONSES)
    if not _is_file(file):
        return
    try:
        content = read_whole(file, _MAX_RESPONSES)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    for number, line in enumerate(content.splitlines(), start=1):
        if not line.strip():
            continue
        key, seconds = _recorded(line, f"{file}:{number}")
        if seconds is not None:
            yield key, seconds


def _recorded(line: bytes, place: str) -> tuple[Key, float | None]:
    """The answer that a line is about, and its time if there is one."""
    try:
        record = strict_loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{place}: this is not JSON: {error}") from error
    if not isinstance(record, dict):
        raise InputError(f"{place}: this is not a JSON object")
    for name in _TEXTS:
        if not isinstance(record.get(name), str):
            raise InputError(f"{place}: '{name}' must be text")
    for name in _NUMBERS:
        if type(record.get(name)) is not int:  # True is one, too
            raise InputError(f"{place}: '{name}' must be a whole number")
    seconds = record.get("latency_s")
    measured = None if seconds is None else seconds_of(str(seconds), place)
    model = model_name(record["model"], str(record.get("version") or ""))
    cell = Cell(record["system"].lower(), model, record["prompt"], record["task"])
    return Key(cell, record["iteration"]), measured


def published_times(base: str, system: str) -> Iterator[Time]:
    """The times of one system in the public repository; nothing without the file.

    Raises InputError with the line that is wrong.
    """
    for folder in _names(base):
        file = _joined(base, folder, *_PUBLISHED)
        if folder.lower() == system and _is_file(file):
            yield from _published(file, system)


def _published(file: str, system: str) -> Iterator[Time]:
    columns, rows = read_rows(file)
    for name in ("Task", "Model", "Version", "Prompt"):
        if name not in columns:
            raise InputError(f"{file}:1: the column '{name}' is missing")
    iterations = [(name, match[1]) for name in columns if (match := _ITERATION.fullmatch(name))]
    for line, cells in rows:
        task = _TASK_CELL.fullmatch(cells["Task"].strip())
        if task is None:
            raise InputError(f"{file}:{line}: the task must be generative_1 or the like")
        model = model_name(cells["Model"].strip(), cells["Version"].strip())
        prompt = _PROMPTS.get(cells["Prompt"].strip(), cells["Prompt"].strip())
        cell = Cell(system, model, prompt, int(task[1]))
        for name, number in iterations:
            seconds = seconds_of(cells[name], f"{file}:{line}")
            if seconds is not None:
                yield Key(cell, int(number)), seconds
