"""``gpsfsm generate`` against a server with the recorded answers of three models."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.api import check
from gpsfsm.running.answer_judge import PlanJudge
from tests.cli.support import run
from tests.generation.fake_server import FakeServer, recorded_answers
from tests.generation.providers.asking import KEY

if TYPE_CHECKING:
    from pathlib import Path

ATTEMPTS = 3
CHOICES = [
    ("gpt", "zeroshot", 3),
    ("gpt", "oneshot", 5),
    ("codellama", "zeroshot", 4),
    ("codellama", "oneshot", 1),
    ("llamachat", "zeroshot", 2),
]


def recorded(folder: Path, model: str, prompt: str, task: int) -> list[str]:
    with (folder / "responses.jsonl").open(encoding="utf-8") as lines:
        return [
            line["response"]
            for line in map(json.loads, lines)
            if (line["system"], line["model"], line["prompt"], line["task"])
            == ("fabric", model, prompt, task)
        ]


@pytest.mark.parametrize("provider", ["openai-compatible", "ollama"])
@pytest.mark.parametrize("choice", CHOICES)
def test_recorded_answers(
    provider: str, choice: tuple[str, str, int], shared_corpus: Path, tmp_path: Path
) -> None:
    model, prompt, task = choice
    (tmp_path / "gpsfsm.toml").write_text("[model]\nmax-wait = 0\n")
    folder = shared_corpus / "experiment1"
    answers = recorded(folder, model, prompt, task)[:ATTEMPTS]
    accepted = [PlanJudge()(answer).accepted for answer in answers]
    needed = accepted.index(True) + 1 if any(accepted) else ATTEMPTS
    file = folder / "tasks" / f"task{task}.txt"
    source = recorded_answers(
        folder / "responses.jsonl", system="fabric", model=model, prompt=prompt
    )
    with FakeServer(source, faults=["429:0", "503", "cut"], key=KEY) as server:
        done = run(
            *("generate", "--task-file", file, "--model", f"{provider}:tiny"),
            *("--base-url", server.url, "--no-constrain", "--attempts", str(ATTEMPTS)),
            cwd=tmp_path,
            env={"GPSFSM_API_KEY": KEY},
        )
        received = server.received
    assert done.returncode == (0 if any(accepted) else 1), done.stderr.decode()
    if any(accepted):
        assert check(done.stdout).ok
    else:
        assert done.stdout == b""
    assert len(received) == 3 + needed
    for each in received:
        turns = [message["role"] for message in each.body["messages"]]
        assert turns in (["system", "user"], ["system", "user", "assistant", "user"])
    (session,) = json.loads(run("attempts", "--format", "json", cwd=tmp_path).stdout)["sessions"]
    kept = [each["answer"] for each in session["attempts"]]
    assert [text.strip() for text in kept] == [text.strip() for text in answers[:needed]]
    everything = [done.stderr, *(path.read_bytes() for path in tmp_path.iterdir())]
    assert not any(KEY.encode() in content for content in everything)


WAIT = "generic_capabilities/WaitRunner"
TREE = '{"plan": [{"interface": "%s", "parameters": {"seconds": %d}}]}'


@pytest.mark.parametrize("heeds", [True, False])
def test_a_model_that_can_write_json_only_is_not_asked_for_xml(heeds: bool, tmp_path: Path) -> None:
    answers = [TREE % (WAIT, -2), TREE % (WAIT, 2)]
    if not heeds:
        answers = [f'<Plan><Runner interface="{WAIT}" provider="{WAIT}" seconds="2"/></Plan>']
    with FakeServer(answers, heeds=["format"] if heeds else []) as server:
        done = run(
            *("generate", "wait", "--model", "ollama:tiny", "--base-url", server.url),
            cwd=tmp_path,
        )
        plan_requests = server.plan_requests
    assert done.returncode == 0, done.stderr.decode()
    assert f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="2"/>'.encode() in done.stdout
    assert len(plan_requests) == (2 if heeds else 1)
    for each in plan_requests:
        last = each.body["messages"][-1]["content"]
        assert ("\n\nWrite the plan as JSON instead of XML: " in last) is heeds
    if heeds:  # a value out of range is told as for any other plan
        assert "GP206" in plan_requests[1].body["messages"][-1]["content"]
