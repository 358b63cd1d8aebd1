"""The server of the tests as a process of its own, fed with recorded answers."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import httpx

from tests.generation.fake_server import FakeServer
from tests.generation.providers.asking import KEY, answer, ask, model_at, request

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel

REPO = Path(__file__).parents[2]


def ask_process(*arguments: str, provider: str, tasks: list[str]) -> list[str]:
    """Start the server, ask it for each task, stop it; the answers."""
    command = [sys.executable, "-m", "tests.generation.fake_server", "--key", KEY, *arguments]
    with subprocess.Popen(
        command, cwd=REPO, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdout is not None
        url = server.stdout.readline().strip()
        model: LanguageModel = model_at(url, provider, key=KEY)
        response = ask(model, *(request(f'Do "{task}" now.') for task in tasks))
        assert server.stdin is not None
        server.stdin.close()
        assert server.wait(20) == 0
    return [each.text for each in response]


def test_it_answers_by_task(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    lines = [("go", "<Plan>1</Plan>"), ("stay", "<Plan>2</Plan>"), ("go", "<Plan>3</Plan>")]
    file.write_text("\n".join(json.dumps({"task": task, "answer": text}) for task, text in lines))
    for provider in ("openai-compatible", "ollama"):
        verdict = ask_process(
            *("--answers", str(file), "--fault", "429:0", "--fault", "cut"),
            provider=provider,
            tasks=["stay", "go", "go"],
        )
        assert verdict == ["<Plan>2</Plan>", "<Plan>1</Plan>", "<Plan>3</Plan>"]


def test_it_gives_the_real_answers(shared_corpus: Path) -> None:
    folder = shared_corpus / "experiment1"
    task = (folder / "tasks" / "task3.txt").read_text(encoding="utf-8").strip()
    verdict = ask_process(
        *("--answers", str(folder / "responses.jsonl")),
        *("--choose", "system=fabric", "--choose", "model=gpt", "--choose", "prompt=zeroshot"),
        provider="vllm",
        tasks=[task] * 3,
    )
    with (folder / "responses.jsonl").open(encoding="utf-8") as lines:
        expected = [
            line["response"]
            for line in map(json.loads, lines)
            if (line["system"], line["model"], line["prompt"]) == ("fabric", "gpt", "zeroshot")
            and line["task"] == 3
        ]
    assert verdict == expected[:3]


def test_it_refuses_what_a_real_server_would() -> None:
    good = {"model": "tiny", "stream": False, "messages": [{"role": "user", "content": "a"}]}
    bad = [
        {"stream": True},
        {"messages": []},
        {"messages": [{"role": "robot", "content": "a"}]},
        {"messages": [{"role": "user"}]},
        {"made_up": 1},
        {"grammar": "a", "ebnf": "b"},
    ]
    with FakeServer() as server:
        url = f"{server.url}/v1/chat/completions"
        assert httpx.post(url, json=good).status_code == 200
        assert [httpx.post(url, json=good | more).status_code for more in bad] == [400] * len(bad)
        assert httpx.post(url, json=good | {"model": "big"}).status_code == 404
        assert httpx.post(f"{server.url}/chat", json=good).status_code == 404
        assert answer(model_at(server)).text == "<Plan/>"
