"""Rewards: the scale, the shapes that trainers load, and answers that try to break them."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import os
import pickle
import sys
import threading
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.grading import rewards as module
from gpsfsm.grading.rewards import (
    Rewards,
    Scale,
    openrlhf_reward_func,
    reward,
    rewards,
    verl_compute_scores,
)
from gpsfsm.tasks.load import read_task
from tests.cases import many
from tests.oracle import plan, rec, to_xml

if TYPE_CHECKING:
    from collections.abc import Callable

TASK = "interface: GoRunner\nplaces: {A: {x: 1}, B: {x: 2}}\nsteps: [{do: A, else: B}]\n"
A, B = "demo/GoRunner x=1", "demo/GoRunner x=2"
RIGHT = to_xml(plan(A, rec(B)))
WRONG = to_xml(plan(B))
UNCLOSED = RIGHT.replace("</Plan>", "")
SCALE = [
    (RIGHT, 1.0),
    (f"Here it is:\n```xml\n{RIGHT}```\nGood luck!", 1.0),
    (UNCLOSED, 0.6),
    (WRONG, 0.2),
    (WRONG.replace("</Plan>", ""), 0.0),
    ("<Plan/>", 0.0),
    ("I cannot do that.", 0.0),
    ("", 0.0),
]


def test_the_scale() -> None:
    assert rewards([answer for answer, _ in SCALE], TASK) == [value for _, value in SCALE]
    assert reward(RIGHT, TASK) == 1.0
    scale = Scale(success=5.0, mended=2.0, readable=-1.0, nothing=-2.0)
    with Rewards(scale=scale) as scorer:
        scores = scorer.batch([RIGHT, UNCLOSED, WRONG, "", None], TASK)
    assert [each.value for each in scores] == [5.0, 2.0, -1.0, -2.0, -2.0]
    assert [each.grade for each in scores] == ["success", "partial", "partial", "failed", "failed"]
    assert scores[0].reason == "the task is fulfilled"


def test_shaping_tells_plans_apart_that_do_not_fulfil_the_task() -> None:
    """One error: 0.2 + 0.3 / 2; the scale without shaping stays for all others."""
    worse = to_xml(plan(rec("demo/GoRunner x=3"), B))  # a recovery that guards nothing besides
    few, many, right, mended = rewards([WRONG, worse, RIGHT, UNCLOSED], TASK, shaping=True)
    assert 0.2 < many < few < mended == 0.6
    assert right == 1.0
    excused = WRONG.replace("<Plan>", "<Plan><!-- gpsfsm: ignore-file -->")
    assert reward(excused, TASK, shaping=True) <= few


HOSTILE = [
    "<" * 2_000_000,
    "<Control>" * 100_000,
    "<Plan>" + '<Control type="sequential">' * 5_000 + RIGHT[len("<Plan>") :],
    RIGHT.replace("</Plan>", RIGHT * 2_000 + "</Plan>"),
    "\ud800" + WRONG[:20],
    "\0",
    '<!DOCTYPE a [<!ENTITY b "c">]><Plan>&b;</Plan>',
    "<Plan>" + "&#x41;" * 10_000,
    None,
    b"bytes",
    7,
]


def test_hostile_answers_get_nothing() -> None:
    with Rewards(jobs=2, timeout_s=20.0) as scorer:
        scores = scorer.batch([*HOSTILE, RIGHT], TASK)
    assert [each.value for each in scores] == [0.0] * len(HOSTILE) + [1.0]


@settings(max_examples=many(30))
@given(st.text(max_size=200), st.integers(0, len(RIGHT)))
def test_no_answer_breaks_it(text: str, place: int) -> None:
    assert 0.0 <= reward(RIGHT[:place] + text + RIGHT[place:], TASK) <= 1.0
    assert 0.0 <= reward(text, TASK, shaping=True) <= 1.0


def test_an_answer_that_takes_too_long_is_ended() -> None:
    slow = to_xml(plan(*(f"demo/GoRunner x={number}" for number in range(3, 2_000))))
    with Rewards(timeout_s=0.0005) as scorer:
        (actual,) = scorer.batch([slow], TASK)
    assert (actual.value, actual.grade) == (0.0, "undecided")
    assert actual.reason == "the process that graded it was ended: it took more than 0.0005 s"


def test_what_a_task_may_be(tmp_path: Path) -> None:
    file = tmp_path / "task.yaml"
    file.write_text(TASK, encoding="utf-8")
    as_dict: dict[str, Any] = {
        "interface": "GoRunner",
        "places": {"A": {"x": 1}, "B": {"x": 2}},
        "steps": [{"do": "A", "else": "B"}],
    }
    tasks = [str(file), file, TASK, json.dumps(as_dict), as_dict, read_task(TASK.encode())]
    assert rewards([RIGHT] * 6, tasks) == [1.0] * 6
    file.write_text(TASK.replace("do: A, else: B", "do: B"), encoding="utf-8")
    os.utime(file, ns=(1, 1))
    assert reward(WRONG, file) == 1.0


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ("", "a task is empty: does the data have a column of tasks"),
        ("no_such_file.yaml", r"'no_such_file.yaml' cannot be read: No such file or directory$"),
        ("a\0b", "cannot be read"),
        ("steps:\n", "the task asks for nothing"),
        ({"steps": {1, 2}}, "not a valid task"),
        ({"steps": [{"do": None}]}, "has no 'do'"),
        (7, "not int"),
        ([TASK, TASK], "1 answers, but 2 tasks"),
    ],
)
def test_tasks_that_make_no_sense(task: Any, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        rewards([RIGHT], task)


class Column:
    """An array as pandas makes them of the lists in a Parquet file."""

    def __init__(self, *items: object) -> None:
        self.tolist = lambda: list(items)


def test_tasks_of_parquet_files() -> None:
    """A row has all keys that some row of the file has, with None for what it lacks."""
    steps = [{"do": "A", "else": "B", "times": None}]
    places = {"A": {"x": 1.0, "y": None}, "B": {"x": 2.0, "y": None}, "C": None}
    for listed in (steps, tuple(steps), Column(*steps)):
        task = {"interface": "GoRunner", "places": places, "steps": listed, "not_answers": None}
        assert rewards([RIGHT, WRONG], task) == [1.0, 0.2]


def loaded(file: Path, name: str) -> Callable[..., Any]:
    """A function of a file, loaded as trainers do: the module is known by no name."""
    spec = importlib.util.spec_from_file_location("reward_func", file)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    function: Callable[..., Any] = getattr(made, name)
    return function


EXAMPLES = Path("docs/examples")


def test_verl() -> None:
    """As verl 0.9.1 calls it: arguments by name, from threads, with settings beside them."""
    compute_score = loaded(EXAMPLES / "verl_reward.py", "compute_score")
    extra_info: dict[str, Any] = {"split": "train", "num_turns": None, "rollout_reward_scores": {}}
    row = {"data_source": "robot", "ground_truth": TASK, "extra_info": extra_info}
    of_a_model = {"reward_router_address": "127.0.0.1:80", "reward_model_tokenizer": None}

    async def managed() -> list[float]:
        calls = (
            asyncio.to_thread(compute_score, solution_str=answer, **row, **of_a_model)
            for answer, _ in SCALE
        )
        return list(await asyncio.gather(*calls))

    assert asyncio.run(managed()) == [value for _, value in SCALE]
    assert compute_score(solution_str=WRONG, **row, shaping=True) > 0.2


def test_verl_in_processes_and_on_files() -> None:
    """Its manager prime pickles the function and calls it by position, as its main_eval does."""
    compute_score = loaded(EXAMPLES / "verl_reward.py", "compute_score")
    made = partial(compute_score, "robot", RIGHT, TASK, {})
    theirs = pickle.loads(pickle.dumps(made))  # noqa: S301  (ours)
    assert theirs() == 1.0
    assert type(theirs()) is float
    assert compute_score("robot", WRONG, TASK) == 0.2


def test_verl_in_batches() -> None:
    """As its manager batch calls it; the sources are an array."""
    scores = verl_compute_scores(
        data_sources=Column("robot", "robot"),  # type: ignore[arg-type]
        solution_strs=[RIGHT, UNCLOSED],
        ground_truths=[TASK, TASK],
        extra_infos=Column({}, {}),
    )
    assert scores == [1.0, 0.6]
    with pytest.raises(UsageError, match="2 answers, but 1 tasks"):
        verl_compute_scores(["robot"] * 2, [RIGHT] * 2, [TASK])


def test_openrlhf() -> None:
    """As OpenRLHF 0.8 calls it: several queries, with the tokens that end an answer."""
    reward_func = loaded(EXAMPLES / "openrlhf_reward.py", "reward_func")
    prompt = f"Drive to A. An example:\n{RIGHT}\nAssistant: "
    answers = [f"{RIGHT}</s>", f"{WRONG}<|im_end|>\n<|endoftext|>", "I cannot. <pad><pad>"]
    queries = [f"<s>{prompt}{answer}" for answer in answers]
    scores = reward_func(queries, [prompt] * 3, [TASK] * 3, extra=1)
    assert {key: list(scores[key]) for key in ("rewards", "scores")} == {
        "rewards": pytest.approx([1.0, 0.2, 0.0]),
        "scores": pytest.approx([1.0, 0.2, 0.0]),
    }
    assert list(scores["extra_logs"]["success"]) == [1.0, 0.0, 0.0]
    with pytest.raises(UsageError, match="query 0 does not hold its prompt"):
        openrlhf_reward_func([RIGHT], ["another prompt"], [TASK])


def test_openrlhf_one_by_one() -> None:
    """As OpenRLHF 0.11.2 calls it: each query from a thread; the tokenizer moved its spaces."""
    reward_func = loaded(EXAMPLES / "openrlhf_reward.py", "reward_func")
    prompt = f"<s>[INST] Drive to A. An example:\n{RIGHT}\n[/INST]"
    query = prompt.replace("<s>", "<s> ")

    async def fetched() -> list[dict[str, Any]]:
        calls = (
            asyncio.to_thread(reward_func, [query + answer], [prompt], [TASK])
            for answer, _ in SCALE
        )
        return list(await asyncio.gather(*calls))

    actual = [float(each["rewards"][0]) for each in asyncio.run(fetched())]
    assert actual == pytest.approx([value for _, value in SCALE])


def test_tensors_where_torch_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    torch = SimpleNamespace(float="float", tensor=lambda values, dtype: (dtype, values))
    monkeypatch.setitem(sys.modules, "torch", torch)
    scores = openrlhf_reward_func(["p" + RIGHT], ["p"], [TASK])
    assert scores["rewards"] == ("float", [1.0])
    monkeypatch.setitem(sys.modules, "torch", None)
    assert openrlhf_reward_func(["p" + RIGHT], ["p"], [TASK])["rewards"] == [1.0]


def test_several_threads_at_once() -> None:
    actual: list[float] = []
    threads = [
        threading.Thread(target=lambda: actual.extend(rewards([RIGHT, WRONG], TASK)))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert actual == [1.0, 0.2] * 4


def test_after_a_fork_it_has_processes_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    with Rewards() as scorer:
        scorer.batch([RIGHT], TASK)
        theirs = scorer._engine
        real = os.getpid()
        monkeypatch.setattr(module.os, "getpid", lambda: real + 1)
        assert scorer.batch([WRONG], TASK)[0].value == 0.2
        assert scorer._engine is not theirs
        assert theirs is not None
        theirs.end()
