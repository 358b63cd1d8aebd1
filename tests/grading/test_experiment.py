"""Recorded experiments: both layouts, and what is said about mistakes."""

from __future__ import annotations

import json
import os
import statistics
from collections import defaultdict
from pathlib import Path

import pytest

from gpsfsm.errors import InputError
from gpsfsm.grading.experiment import Cell, Key, mark_corrupted, read_experiment
from gpsfsm.grading.grader import Grade
from gpsfsm.grading.tables import combined, moments_of, pooled_deviation

SAMPLE = Path("experiments/sample")
TIMES = "timing_data/iteration_times_all.csv"


def put(root: Path, *names: str, text: str = "<Plan/>") -> None:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def keys(root: Path) -> list[tuple[str, ...]]:
    experiment = read_experiment(str(root))
    return [(*map(str, one.key.cell), str(one.key.iteration)) for one in experiment]


def test_both_layouts_of_the_sample_hold_the_same_answers() -> None:
    flat = read_experiment(str(SAMPLE / "flat"))
    published = read_experiment(str(SAMPLE / "published"))
    inside = read_experiment(str(SAMPLE / "published/Experiment_1"))
    assert [one.key for one in flat] == [one.key for one in published]
    assert published == inside
    assert [one.seconds for one in flat] == [one.seconds for one in published]
    for one, other in zip(flat, published, strict=True):
        assert (one.path is None) == (other.path is None)
        if one.path and other.path:
            assert Path(one.path).read_bytes() == Path(other.path).read_bytes()
    assert [one.key for one in flat if one.path is None] == [
        Key(Cell("fabric", "large-base", "zeroshot", 3), 2)
    ]
    assert {one.human for one in published} == {None}


def test_labels_of_one_layout_fit_the_other() -> None:
    flat = read_experiment(str(SAMPLE / "flat"))
    other = read_experiment(str(SAMPLE / "published"), str(SAMPLE / "flat/labels.csv"))
    assert [one.human for one in flat] == [one.human for one in other]
    assert [one.human for one in flat].count(Grade.SUCCESS) == 5


def test_what_is_an_answer(tmp_path: Path) -> None:
    put(tmp_path, "Fabric/m/zero/task1/1.xml", "Fabric/m/zero/task1/010.xml")
    put(tmp_path, "Fabric/m/zero/generative_2/3.xml", "Other/openai-x/p/task_3/1.xml")
    put(tmp_path, "Fabric/m/zero/task1/notes.xml", "Fabric/m/zero/task1/1.txt")
    put(tmp_path, "Fabric/m/zero/about/1.xml", "Fabric/1.xml", ".git/m/zero/task1/1.xml")
    (tmp_path / "Fabric/m/zero/task1/5.xml").mkdir()
    os.mkfifo(tmp_path / "Fabric/m/zero/task1/6.xml")
    assert keys(tmp_path) == [
        ("fabric", "m", "zero", "1", "1"),
        ("fabric", "m", "zero", "1", "10"),
        ("fabric", "m", "zero", "2", "3"),
        ("other", "x", "p", "3", "1"),
    ]


def test_beside_outputs_nothing_counts(tmp_path: Path) -> None:
    put(tmp_path, "Fabric/outputs/m/zero/task1/1.xml", "Fabric/runnable/zero/task1/2.xml")
    put(
        tmp_path,
        f"Fabric/{TIMES}",
        text="Task,Model,Version,Prompt,Itr1,Itr12\ngenerative_1,m,n/a,zero,2,3.5\n",
    )
    experiment = read_experiment(str(tmp_path))
    assert [
        (one.key.iteration, one.key.cell.prompt, one.seconds, one.path is None)
        for one in experiment
    ] == [
        (1, "zero", None, False),
        (1, "zeroshot", 2.0, True),
        (12, "zeroshot", 3.5, True),
    ]


def record(**changes: object) -> str:
    fields = {"system": "s", "model": "m", "prompt": "p", "task": 1, "iteration": 1, "latency_s": 1}
    return json.dumps({**fields, **changes})


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("responses.jsonl", "{}\n", "responses.jsonl:1: 'system' must be text"),
        ("responses.jsonl", record() + "\n[1]\n", ":2: this is not a JSON object"),
        ("responses.jsonl", record(task="1"), ":1: 'task' must be a whole number"),
        ("responses.jsonl", record(latency_s="soon"), ":1: 'soon' is not a time"),
        ("responses.jsonl", "[" * 100_000, ":1: this is not JSON"),
        (f"Fabric/{TIMES}", "Task,Model\n", ":1: the column 'Version' is missing"),
        (f"Fabric/{TIMES}", "Task,Model,Version,Prompt,Itr1\nx,m,,one,1\n", ":2: the task must be"),
        (f"Fabric/{TIMES}", "Task,Model,Version,Prompt,Itr1\ngenerative_1,m,,one,?!\n", ":2: '?!'"),
        ("labels.csv", "path,human\na,S\n", ":1: the column 'system' is missing"),
        (
            "labels.csv",
            "path,human,system,model,prompt,task,iteration\na,S,s,m,p,one,1\n",
            ":2: 'task' and 'iteration' must be numbers",
        ),
        (
            "labels.csv",
            "path,human,system,model,prompt,task,iteration\na,S,s,m,p,1,1\nb,S,s,m,p,1,01\n",
            ":3: line 2 is of the same answer",
        ),
        ("Fabric/m/zero/task1/01.xml", "<Plan/>", "this is the same answer as"),
        ("Fabric/openai-m/zero/task1/1.xml", "<Plan/>", "this is the same answer as"),
    ],
)
def test_mistakes_are_told(tmp_path: Path, name: str, text: str, message: str) -> None:
    put(tmp_path, "Fabric/m/zero/task1/1.xml")
    put(tmp_path, name, text=text)
    with pytest.raises(InputError) as caught:
        read_experiment(str(tmp_path))
    assert str(caught.value).startswith(str(tmp_path))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.jsonl: holds no answer: it is empty"),
        (record(response="a") + "\n\n", "a.jsonl:2: this is not JSON"),
        (
            record(response="a") + "\n" + record(response="b"),
            "a.jsonl:2: this is the same answer as",
        ),
        ('{"response": "a"}\n', "a.jsonl:1: 'system' must be text"),
        (record(response="a", task=True), "a.jsonl:1: 'task' must be a whole number"),
        (record(response="a", task=None), "a.jsonl:1: 'task' must be a whole number"),
    ],
)
def test_mistakes_in_json_lines_are_told(tmp_path: Path, text: str, message: str) -> None:
    put(tmp_path, "a.jsonl", text=text)
    with pytest.raises(InputError) as caught:
        read_experiment(str(tmp_path / "a.jsonl"))
    assert str(caught.value).startswith(str(tmp_path))
    assert message in str(caught.value)


def test_answers_in_json_lines(tmp_path: Path) -> None:
    """In the order of their keys; a line without an answer is one that cannot be read."""
    put(tmp_path, "a.jsonl", text=f"{record(response='a', iteration=2)}\n{record()}\n")
    one, other = read_experiment(str(tmp_path / "a.jsonl"))
    assert (one.key.iteration, other.key.iteration) == (1, 2)
    assert (one.path, other.path) == (f"{tmp_path}/a.jsonl:2", f"{tmp_path}/a.jsonl:1")
    assert one.line is not None
    assert other.line is not None
    assert one.line.problem.startswith("has no text in any of response, ")
    assert other.line.text == b"a"
    assert one.human is other.human is None
    assert one.seconds == 1.0


def test_where_there_is_no_experiment(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no experiment in it"):
        read_experiment(str(tmp_path))
    with pytest.raises(InputError, match="cannot be read"):
        read_experiment(str(tmp_path / "none"))


def test_moments_of_the_recorded_times(shared_corpus: Path) -> None:
    """Of 60 cells of ten times each, and over the five tasks of each model and prompt."""
    cells: dict[Cell, list[float]] = defaultdict(list)
    for one in read_experiment(str(shared_corpus / "experiment1")):
        assert one.seconds is not None
        cells[one.key.cell].append(one.seconds)
    assert {len(times) for times in cells.values()} == {10}
    moments = {cell: moments_of(times) for cell, times in cells.items()}
    for cell, times in cells.items():
        actual = moments[cell]
        assert actual is not None
        assert actual.mean == pytest.approx(statistics.fmean(times))
        assert actual.deviation == pytest.approx(statistics.stdev(times), abs=1e-9)
    for name in {cell[:3] for cell in cells}:
        groups = [each for cell, each in moments.items() if each and cell[:3] == name]
        times = [time for cell in cells if cell[:3] == name for time in cells[cell]]
        together = combined(groups)
        assert together is not None
        assert together.deviation == pytest.approx(statistics.stdev(times))
        variances = [statistics.variance(cells[cell]) for cell in cells if cell[:3] == name]
        assert pooled_deviation(groups) == pytest.approx(statistics.fmean(variances) ** 0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("system,model\n", ":1: the column 'prompt' is missing"),
        ("system,model,prompt\n,,\n", ":2: this line names no answer in particular"),
        ("system,model,prompt,version\ns,,p,base\n", ":2: there is a version without a model"),
        ("system,model,prompt,task\ns,m,p,1\ns,m,p,two\n", ":3: 'task' and 'iteration' must be"),
    ],
)
def test_a_list_of_corrupted_answers_that_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "corrupted.csv"
    file.write_text(text)
    with pytest.raises(InputError) as raised:
        mark_corrupted([], str(file))
    assert str(raised.value).startswith(f"{file}{message}")


def test_what_is_empty_in_a_list_of_corrupted_answers_may_be_anything(tmp_path: Path) -> None:
    file = tmp_path / "corrupted.csv"
    answers = read_experiment(str(SAMPLE / "flat"))
    for line, wanted in (
        ("fabric,,,", lambda key: key.cell.system == "fabric"),
        (",small,,3", lambda key: (key.cell.model, key.cell.task) == ("small", 3)),
        (",,zeroshot,", lambda key: key.cell.prompt == "zeroshot"),
    ):
        file.write_text(f"system,model,prompt,task\n{line}\n")
        marked, unused = mark_corrupted(answers, str(file))
        assert [one.corrupted for one in marked] == [wanted(one.key) for one in answers]
        assert any(one.corrupted for one in marked)
        assert not all(one.corrupted for one in marked)
        assert unused == []
