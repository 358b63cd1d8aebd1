"""Recorded answers: the right one, always the same, or a message."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.generation.language_model import (
    Answer,
    Constraint,
    Finish,
    LanguageModel,
    Message,
    Request,
    Role,
    Usage,
)
from gpsfsm.generation.providers import ModelSettings, find_model
from gpsfsm.generation.providers.builtin.replay import load, recorded
from tests.generation.providers.asking import answer, ask, fails, request

if TYPE_CHECKING:
    from pathlib import Path


def write(folder: Path, *lines: Any) -> str:
    file = folder / "answers.jsonl"
    texts = [line if isinstance(line, str) else json.dumps(line) for line in lines]
    file.write_text("\n".join(texts), encoding="utf-8")
    return str(file)


def replay(source: str, **settings: Any) -> LanguageModel:
    return find_model(f"replay:{source}", ModelSettings(**settings))


def texts(model: LanguageModel, *requests: Request) -> list[str]:
    return [each.text for each in ask(model, *requests)]


class TestOrder:
    def test_in_the_order_of_the_file(self, tmp_path: Path) -> None:
        model = replay(write(tmp_path, {"answer": "a"}, "", {"answer": "b"}))
        assert texts(model, request(), request()) == ["a", "b"]
        error = fails(model)
        assert "the recorded answers to this task are used up, all 2" in str(error)
        assert not error.again

    def test_by_task(self, tmp_path: Path) -> None:
        source = write(
            tmp_path,
            {"task": "go", "answer": "g1"},
            {"task": " stay\n here ", "answer": "s1"},
            {"answer": "other"},
            {"task": "go", "answer": "g2"},
        )
        model = replay(source)
        responses = [request(task=task) for task in ("go", "stay here", "new", " go ")]
        assert texts(model, *responses) == ["g1", "s1", "other", "g2"]
        assert "no answer is recorded" in str(
            fails(replay(f"{source}#task=go"), request(task="new"))
        )
        assert texts(replay(source), *[request()] * 4) == ["g1", "s1", "other", "g2"]

    def test_by_task_and_prompt(self, tmp_path: Path) -> None:
        source = write(
            tmp_path,
            {"task": "go", "prompt_text": "Slowly!", "answer": "slow"},
            {"task": "go", "messages": [{"role": "user", "content": "Fast!"}], "answer": "fast"},
            {"task": "go", "answer": "third"},
        )
        model = replay(source)
        responses = [request(text, task="go") for text in ("Fast!", " Slowly! ", "Well!")]
        assert texts(model, *responses) == ["fast", "slow", "slow"]

    def test_by_number_whatever_was_asked_before(self, tmp_path: Path) -> None:
        source = write(tmp_path, *({"task": "go", "answer": text} for text in "abc"))
        model = replay(source)
        responses = [request(task="go", number=number) for number in (2, 0, 2, 1)]
        assert texts(model, *responses) == ["c", "a", "c", "b"]
        assert "used up" in str(fails(model, request(task="go", number=3)))

    def test_a_recorded_session_is_replayed_also_from_its_middle(self, tmp_path: Path) -> None:
        responses = [request(text, task="go", number=n) for n, text in enumerate(["one", "two"])]
        lines = [
            recorded(each, Answer(text=f"answer {n}", model="m"))
            for n, each in enumerate(responses)
        ]
        source = write(tmp_path, *lines)
        assert texts(replay(source), *responses) == ["answer 0", "answer 1"]
        assert texts(replay(source), responses[1]) == ["answer 1"]

    def test_a_request_without_messages(self, tmp_path: Path) -> None:
        assert texts(replay(write(tmp_path, {"answer": "a"})), Request(())) == ["a"]


class TestLines:
    def test_everything_that_a_line_may_say(self, tmp_path: Path) -> None:
        source = write(
            tmp_path,
            {
                "answer": "<think>hm</think><Plan/>",
                "model": "gpt",
                "finish": "length",
                "latency_s": 1.5,
                "prompt_tokens": 2_000_000,
                "answer_tokens": 1_000_000,
                "constrained": "gbnf",
            },
        )
        reply = answer(replay(source, prompt_price=2.0, answer_price=8.0))
        assert reply == Answer(
            text="<Plan/>",
            model="gpt",
            finish=Finish.LENGTH,
            usage=Usage(2_000_000, 1_000_000),
            latency_s=1.5,
            constrained=Constraint.GBNF,
            raw="<think>hm</think><Plan/>",
            cost=12.0,
        )

    def test_what_is_recorded_is_what_is_replayed(self, tmp_path: Path) -> None:
        first = Answer(
            text='<Plan a="ä\u2028">\n</Plan>',
            model="m",
            finish=Finish.OTHER,
            usage=Usage(1, 2, estimated=True),
            latency_s=0.25,
            constrained=Constraint.LARK,
            raw='<Plan a="ä\u2028">\n</Plan>',
        )
        assert answer(replay(write(tmp_path, recorded(request(), first)))) == first

    def test_recorded_errors(self, tmp_path: Path) -> None:
        source = write(
            tmp_path, {"error": "the server\x1b says 500", "again": True}, {"answer": " "}
        )
        model = replay(source)
        error = fails(model)
        assert str(error) == f"replay:{source}: the server\\x1b says 500"
        assert error.again
        error = fails(model)
        assert (str(error), error.again) == (f"replay:{source}: the answer is empty", True)

    @pytest.mark.parametrize("latency", ["1", None, True, -1, float("inf"), [], 10**400])
    def test_odd_numbers(self, latency: Any, tmp_path: Path) -> None:
        line = {
            "answer": "a",
            "latency_s": latency,
            "prompt_tokens": latency,
            "task": [],
            "model": {},
        }
        reply = answer(replay(write(tmp_path, line)))
        assert reply.latency_s in (0.0, 1.0)
        assert reply.usage == Usage()
        assert reply.model == "replay"

    @pytest.mark.parametrize(
        ("line", "said"),
        [
            ("{", ":1: is not JSON"),
            ("[" * 100_000, ":1: is not JSON"),
            ("9" * 10_000, ":1: is not JSON"),
            ("[]", ":1: is not an object with an answer"),
            ("{}", ":1: has neither an 'answer' nor an 'error', which are texts"),
            ('{"answer": 3}', ":1: has neither an 'answer' nor an 'error', which are texts"),
            ('{"answer": "", "finish": "end"}', ":1: 'end' is none of stop, length, other"),
            ('{"answer": "", "constrained": []}', ":1: '[]' is none of gbnf, lark, json-schema"),
            ("", ": there is no recorded answer in it"),
        ],
    )
    def test_what_is_no_line(self, line: str, said: str, tmp_path: Path) -> None:
        source = write(tmp_path, line)
        with pytest.raises(UsageError) as caught:
            replay(source)
        assert str(caught.value) == f"{source}{said}"

    def test_bytes_that_are_no_text(self, tmp_path: Path) -> None:
        file = tmp_path / "a.jsonl"
        file.write_bytes(b'{"answer": "\xff"}')
        with pytest.raises(UsageError, match=":1: is not JSON"):
            replay(str(file))
        file.write_text('{"answer": "a\\ud800"}')
        assert texts(replay(str(file)), request()) == ["a?"]

    def test_files_that_cannot_be_read(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        for source in (tmp_path / "none.jsonl", tmp_path, pipe, "x" * 300):
            with pytest.raises(UsageError, match=r"is not a file with|cannot be read"):
                replay(str(source))


class TestChoices:
    def test_lines_are_chosen_by_their_fields(self, tmp_path: Path) -> None:
        source = write(
            tmp_path,
            {"model": "a", "n": 1, "answer": "a1"},
            {"model": "b", "n": 1, "answer": "b1"},
            {"model": "b", "n": 2, "answer": "b2"},
        )
        assert texts(replay(f"{source}#model=b"), request(), request()) == ["b1", "b2"]
        assert texts(replay(f"{source}#model=b, n=2"), request()) == ["b2"]

    def test_choices_that_make_no_sense(self, tmp_path: Path) -> None:
        source = write(tmp_path, {"answer": "a"})
        with pytest.raises(UsageError, match="there is no recorded answer"):
            replay(f"{source}#model=b")
        with pytest.raises(UsageError, match="after the #, write choices such as"):
            replay(f"{source}#model")


class TestRealAnswers:
    """The answers of three models to the five tasks, as they were recorded."""

    def test_they_are_found_by_the_words_of_the_task(self, shared_corpus: Path) -> None:
        folder = shared_corpus / "experiment1"
        source = f"{folder}/responses.jsonl#system=fabric,model=gpt,prompt=zeroshot"
        lines = [
            json.loads(line)
            for line in (folder / "responses.jsonl").read_text(encoding="utf-8").splitlines()
        ]
        for number in range(1, 6):
            task = (folder / "tasks" / f"task{number}.txt").read_text(encoding="utf-8")
            expected = [
                line
                for line in lines
                if (line["system"], line["model"], line["prompt"]) == ("fabric", "gpt", "zeroshot")
                and line["task"] == number
            ]
            for name in (task, str(number), f"task{number}"):
                response = ask(replay(source), *[request(task=name)] * 10)
                assert [each.text for each in response] == [each["response"] for each in expected]
                assert [each.latency_s for each in response] == [
                    each["latency_s"] for each in expected
                ]
            assert {each.model for each in response} == {"gpt-4o"}

    def test_the_same_prompt_gets_the_same_answers(self, shared_corpus: Path) -> None:
        file = shared_corpus / "experiment1" / "responses.jsonl"
        records = load(str(file))
        assert len(records) == 600
        line = json.loads(file.read_text(encoding="utf-8").splitlines()[0])
        question = Request((Message(Role.USER, line["prompt_text"]),))
        assert texts(replay(str(file)), question) == [line["response"]]
