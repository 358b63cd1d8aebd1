"""``gpsfsm generate`` against a server that speaks the wire formats, with all that can go wrong."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.cli.support import run
from tests.generation.fake_server import FakeServer, recorded_answers
from tests.generation.providers.asking import KEY

WAIT = "generic_capabilities/WaitRunner"
PLAN = f'<Plan>\n  <Runner interface="{WAIT}" provider="{WAIT}" seconds="2"/>\n</Plan>'
TREE = json.dumps({"plan": [{"interface": WAIT, "parameters": {"seconds": 2}}]})
FIELDS = {"vllm": "structured_outputs", "ollama": "format"}


def generate(server: FakeServer, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run it with a key, which must show nowhere."""
    own = folder / "home/gpsfsm"
    own.mkdir(parents=True, exist_ok=True)
    (own / "config.toml").write_text('[model]\nmax-wait = 0\napi-key-env = "ROBOT_API_KEY"\n')
    done = run(
        *("generate", *arguments, "--base-url", server.url, "--journal", "run.db"),
        cwd=folder,
        env={"ROBOT_API_KEY": KEY, "GPSFSM_DEBUG": "1", "XDG_CONFIG_HOME": str(own.parent)},
    )
    out, errors = done.stdout.decode(), done.stderr.decode()
    assert KEY not in out + errors
    for file in filter(Path.is_file, folder.iterdir()):
        assert KEY.encode() not in file.read_bytes()
    return subprocess.CompletedProcess(done.args, done.returncode, out, errors)


@pytest.mark.parametrize("provider", ["vllm", "ollama"])
@pytest.mark.parametrize("heeds", [True, False])
def test_a_plan_comes_out(provider: str, heeds: bool, tmp_path: Path) -> None:
    as_tree = heeds and provider == "ollama"
    with FakeServer(
        [TREE if as_tree else PLAN], heeds=[FIELDS[provider]] if heeds else [], key=KEY
    ) as server:
        done = generate(server, tmp_path, "wait", "--model", f"{provider}:tiny")
        assert done.returncode == 0, done.stderr
        assert f'provider="{WAIT}"' in done.stdout
        (request,) = server.plan_requests
    assert request.grammar_field == (FIELDS[provider] if heeds else "")
    if request.grammar_field:
        assert WAIT in json.dumps(request.body[request.grammar_field])


@pytest.mark.parametrize(
    ("faults", "code"),
    [
        (["429:0", "503", "cut"], 0),
        (["garbage"] * 3, 2),
        (["huge", "huge", "huge"], 2),
        (["gzip-bomb"] * 3, 2),
        (["html"] * 3, 2),
        (["429"] * 99, 2),
        (["echo-refusal"] * 3, 2),
        (["echo-headers"] * 3, 1),
        (["hang-inside"] * 9, 2),
        (["endless"] * 9, 2),
    ],
)
def test_a_server_that_misbehaves(faults: list[str], code: int, tmp_path: Path) -> None:
    with FakeServer([PLAN], faults=faults, key=KEY) as server:
        done = generate(
            server, tmp_path, "wait", "--model", "vllm:tiny", "--no-constrain", "--timeout", "1"
        )
    assert done.returncode == code, done.stderr
    assert (": vllm:tiny: " in done.stderr) is (code == 2)


def test_real_answers(shared_corpus: Path, tmp_path: Path) -> None:
    folder = shared_corpus / "experiment1"
    answers = recorded_answers(
        folder / "responses.jsonl", system="fabric", model="gpt", prompt="zeroshot"
    )
    task = (folder / "tasks" / "task2.txt").read_text(encoding="utf-8").strip()
    for provider in FIELDS:
        with FakeServer(answers, key=KEY) as server:
            done = generate(server, tmp_path, task, "--model", f"{provider}:tiny")
        assert done.returncode == 0, done.stderr
        places = ('x="2.0" y="-0.5"', 'x="0.0" y="2.0"', 'x="-2.0" y="0.0"', 'x="0.0" y="-2.0"')
        assert [done.stdout.count(place) for place in places] == [1, 1, 1, 1]
