"""Runs whose prompts ask a language model: recorded answers, in a world and for real."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal_read import JournalReader
from tests.cli.support import environment, run, start, write
from tests.conftest import REPO
from tests.generation.fake_server import FakeServer
from tests.runners.test_third_party import environ, installed
from tests.simulation.support import control, plan, runner

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

WAIT = "generic_capabilities/WaitRunner"
NEXT = plan(runner("Wait", seconds="0.05"))
GENERATE = plan(
    runner("PromptText", text="Be quick.", uuid="u"),
    runner("FabricGeneratePlan", task="Wait.", uuid="u", flush="true"),
)
WORLD = str(REPO / "corpus" / "worlds" / "home.yaml")
MISSION = str(REPO / "corpus" / "missions" / "ask_and_replan.xml")
GO_HOME = plan(runner("Waypoint", x="0.0", y="0.0"))


def answers(folder: Path, *records: dict[str, object]) -> str:
    """A file of recorded answers, as an option."""
    folder.mkdir(exist_ok=True, parents=True)
    lines = "".join(f"{json.dumps(record)}\n" for record in records)
    (folder / "answers.jsonl").write_text(lines, encoding="utf-8")
    return "--model=replay:answers.jsonl"


def statuses(folder: Path) -> list[str]:
    with JournalReader(str(folder / "run.db")) as reader:
        reader.verify_queue()
        for each in reader.runs():
            reader.verify(each.number)
        return [str(run.status) for run in reader.runs()]


def test_a_mission_asks_for_its_next_plan_in_a_world(tmp_path: Path) -> None:
    model = answers(
        tmp_path,
        {"task": "Drive back and go home.", "answer": "<Plan><Runner/></Plan>", "latency_s": 3.5},
        {"task": "Drive back and go home.", "answer": f"So: {GO_HOME}", "latency_s": 2.5},
    )
    how = ("--world", WORLD, model, "--journal", "run.db")
    done = run("run", MISSION, *how, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    out = done.stdout.decode()
    assert "says: attempt 1 was rejected: " in out
    assert "says: accepted the plan of attempt 2" in out
    assert "== plan 2 from FabricSetPlanRunner" in out
    assert statuses(tmp_path) == ["COMPLETED", "COMPLETED"]
    again = tmp_path / "again"
    answers(again)
    (again / "answers.jsonl").write_bytes((tmp_path / "answers.jsonl").read_bytes())
    assert run("run", MISSION, *how, cwd=again).stdout == done.stdout
    for number in ("1", "2"):  # nobody is asked for that
        (tmp_path / "answers.jsonl").unlink(missing_ok=True)
        replayed = run("replay", "run.db", "--run", number, cwd=tmp_path)
        assert b"simulated again; all" in replayed.stdout, replayed.stderr


def test_a_check_is_asked_once_and_then_comes_from_the_journal(tmp_path: Path) -> None:
    check = runner("Check", prompt="Is there a dog?", text="A cat sleeps.")
    text = plan(check, control("recovery", runner("Waypoint", x="1.0", y="0.0")))
    write(tmp_path, a=text)
    model = answers(tmp_path, {"task": "Is there a dog?", "answer": "no", "latency_s": 2.0})
    done = run("run", "a.xml", "--world", WORLD, model, "--journal", "run.db", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    out = done.stdout.decode()
    assert "the answer is no: no" in out
    assert "WaypointRunner (x=1.0, y=0.0) succeeded" in out
    (tmp_path / "answers.jsonl").unlink()
    replayed = run("replay", "run.db", cwd=tmp_path)
    assert b"simulated again; all" in replayed.stdout, replayed.stderr
    write(tmp_path, b=plan(check))
    missing = run("run", "b.xml", "--real", cwd=tmp_path)
    assert missing.returncode == 2
    assert b"CheckRunner asks a language model" in missing.stderr


def test_a_simulation_asks_only_who_is_named_on_the_command_line(tmp_path: Path) -> None:
    write(tmp_path, a=plan(runner("PromptSpeech", task="greet", flush="true")))
    answers(tmp_path, {"answer": "from the model"})
    configured = {"GPSFSM_MODEL": "replay:answers.jsonl"}
    done = run("run", "a.xml", "--world", WORLD, cwd=tmp_path, env=configured)
    assert b"from the model" not in done.stdout
    done = run("run", "a.xml", "--world", WORLD, "--model=replay:answers.jsonl", cwd=tmp_path)
    assert b"from the model" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--real",), b"prompt_capabilities/PromptTextRunner asks a language model; name one with"),
        (
            ("--model", "replay:no.jsonl", "--world", WORLD),
            b"no.jsonl: is not a file with recorded",
        ),
        (("--model", "openai:x"), b"--model needs --world or --real"),
        (("--model", "oops:x", "--real"), b"there is no provider 'oops'"),
    ],
)
def test_a_run_that_cannot_ask_does_not_begin(
    arguments: tuple[str, ...], message: bytes, tmp_path: Path
) -> None:
    write(tmp_path, a=GENERATE)
    done = run("run", "a.xml", *arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert message in done.stderr


def test_a_real_run_that_generates_a_plan(tmp_path: Path) -> None:
    write(tmp_path, a=GENERATE)
    model = answers(tmp_path, {"task": "Wait.", "answer": "no"}, {"task": "Wait.", "answer": NEXT})
    done = run("run", "a.xml", "--real", model, "--journal", "run.db", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert b"says: attempt 1 was rejected: " in done.stdout
    assert b"== plan 2 from FabricGeneratePlanRunner" in done.stdout
    assert statuses(tmp_path) == ["COMPLETED", "COMPLETED"]


def killed(
    folder: Path, line: bytes, *arguments: str, env: Mapping[str, str] | None = None
) -> None:
    """Run until a line comes, then kill."""
    with start("run", *arguments, "--journal", "run.db", cwd=folder, env=env) as process:
        assert process.stdout is not None
        while line not in (result := process.stdout.readline()):
            assert result
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)


def test_a_real_run_that_was_killed_between_fill_and_flush(tmp_path: Path) -> None:
    write(
        tmp_path,
        a=plan(
            runner("PromptText", text="Ada is here.", uuid="u"),
            runner("Wait", seconds="60.0"),
            control("recovery", runner("Log", text="it took too long")),
            runner("PromptSpeech", task="greet them", uuid="u", flush="true"),
        ),
    )
    question = (
        "Ada is here.\nWrite what a robot says aloud for this: greet them\n"
        "Answer with the words alone, without quotes, explanations or Markdown."
    )
    model = answers(
        tmp_path,
        {"task": "greet them", "answer": "wrong", "prompt_text": "something else"},
        {"task": "greet them", "answer": "Hello Ada.", "prompt_text": question},
    )
    killed(tmp_path, b"(seconds=60.0) started", "a.xml", "--real", "--timeout", "1", model)
    done = run("resume", "run.db", "--real", cwd=tmp_path)
    assert done.returncode == 2
    assert b"run 1 asks a language model; if that is what you want, name it: --model" in done.stderr
    done = run("resume", "run.db", "--real", model, cwd=tmp_path)
    assert b"Hello Ada." in done.stdout, done.stderr
    assert statuses(tmp_path) == ["COMPLETED"]


def test_the_second_plan_goes_on_and_nobody_is_asked_again(tmp_path: Path) -> None:
    write(tmp_path, a=GENERATE)
    following = plan(runner("Wait", seconds="600.0"))
    model = answers(tmp_path, {"task": "Wait.", "answer": following, "latency_s": 3.0})
    how = ("a.xml", "--world", WORLD, model, "--speed", "30")
    killed(tmp_path, b"(seconds=600.0) started", *how)
    done = run("resume", "run.db", cwd=tmp_path)
    assert done.returncode == 2
    assert b"run 2 asks a language model" in done.stderr
    done = run("resume", "run.db", model, cwd=tmp_path)
    assert (done.returncode, statuses(tmp_path)) == (0, ["COMPLETED", "COMPLETED"]), done.stderr
    assert b"asked" not in done.stdout
    with JournalReader(str(tmp_path / "run.db")) as reader:
        assert [row[2] for row in reader.queue()].count("SUBMITTED") == 2


@pytest.mark.parametrize(
    ("how", "again"),
    [
        (("--real", "--timeout", "1"), ("--real",)),
        (("--world", WORLD, "--speed", "30"), ()),
    ],
)
def test_recorded_answers_go_on_in_order(
    how: tuple[str, ...], again: tuple[str, ...], tmp_path: Path
) -> None:
    say = runner("PromptSpeech", task="say a number", flush="true")
    late = control("recovery", runner("Log", text="it took too long"))
    write(tmp_path, a=plan(say, runner("Wait", seconds="120.0"), late, say))
    task = {"task": "say a number", "latency_s": 0.5}
    model = answers(tmp_path, {**task, "answer": "One."}, {**task, "answer": "Two."})
    killed(tmp_path, b"(seconds=120.0) started", "a.xml", *how, model)
    done = run("resume", "run.db", *again, model, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert b"succeeded: text='Two.'" in done.stdout
    assert b"One." not in done.stdout


CHATTY = """
from gpsfsm.runners.prompting import PromptSpeechRunner

class Chatty(PromptSpeechRunner):
    async def run(self, parameters, context):
        context.log("asked replay:answers.jsonl: 1.0 s")
        context.log("asked the operator")
        outputs = await super().run(parameters, context)
        context.log("accepted the plan of attempt 1")
        return outputs
"""


def test_lines_of_a_runner_are_no_requests_whatever_they_say(tmp_path: Path) -> None:
    """The second answer is the next one, although the first step has logged "asked" three times."""
    described = tmp_path / "robot" / "my_capabilities" / "providers"
    described.mkdir(parents=True)
    built_in = REPO / "runners" / "prompting" / "prompt_capabilities" / "providers"
    text = (built_in / "PromptSpeechRunner.yaml").read_text(encoding="utf-8")
    text = text.replace("name: PromptSpeechRunner", "name: Chatty", 1)
    text = text.replace("gpsfsm.runners.prompting:PromptSpeechRunner", "chatty:Chatty")
    text = text.replace(
        "provider=prompt_capabilities/PromptSpeechRunner", "provider=my_capabilities/Chatty"
    )
    (described / "Chatty.yaml").write_text(text, encoding="utf-8")
    env = environ(
        installed(tmp_path, "my_capabilities/Chatty = my_robot.chatty:Chatty", chatty=CHATTY)
    )
    how = ("--real", "--capabilities", "robot")
    say = (
        '<Runner interface="prompt_capabilities/PromptSpeechRunner" '
        'provider="my_capabilities/Chatty" task="say a number" flush="true"/>'
    )
    write(tmp_path, a=plan(say, runner("Wait", seconds="1.0"), say))
    task = {"task": "say a number"}
    model = answers(tmp_path, *({**task, "answer": word} for word in ("One.", "Two.", "Three.")))
    killed(tmp_path, b"(seconds=1.0) started", "a.xml", *how, model, env=env)
    done = run("resume", "run.db", *how, model, cwd=tmp_path, env=env)
    assert done.returncode == 0, done.stderr
    assert b"succeeded: text='Two.'" in done.stdout


ASK = plan(runner("PromptSpeech", task="greet", flush="true"))


def asking(server: FakeServer) -> tuple[str, ...]:
    return ("--model", "openai-compatible:tiny", "--base-url", f"{server.url}/v1")


@contextmanager
def under_way(folder: Path, server: FakeServer, *how: str) -> Iterator[subprocess.Popen[bytes]]:
    """A run whose request has reached the server, which does not answer."""
    write(folder, a=ASK)
    command = ["run", "a.xml", *how, "--journal", "run.db"]
    with start(*command, *asking(server), cwd=folder) as process:
        try:
            until = time.monotonic() + 30
            while not server.received:
                assert process.poll() is None
                assert time.monotonic() < until
                time.sleep(0.01)
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("how", [("--real",), ("--world", WORLD)])
def test_ctrl_c_ends_a_request_at_once(how: tuple[str, ...], tmp_path: Path) -> None:
    with FakeServer(faults=["slow:60"]) as server, under_way(tmp_path, server, *how) as process:
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=30)  # not the 60 seconds of the server
    assert process.returncode == 130
    assert b"CANCELLED" in out
    assert b"Traceback" not in out + error
    assert statuses(tmp_path) == ["CANCELLED"]
    assert len(server.received) == 1


@pytest.mark.parametrize("how", [("--real",), ("--world", WORLD)])
def test_a_request_without_an_answer_is_made_once_more(
    how: tuple[str, ...], tmp_path: Path
) -> None:
    with FakeServer(["Hello!"], faults=["slow:60"]) as server:
        with under_way(tmp_path, server, *how) as process:
            process.send_signal(signal.SIGKILL)
            process.communicate(timeout=30)
        done = run(
            "resume", "run.db", *how[:1][: how[0] == "--real"], *asking(server), cwd=tmp_path
        )
        assert (done.returncode, len(server.received)) == (0, 2), done.stderr
    assert b"succeeded: text='Hello!'" in done.stdout
    assert run("replay", "run.db", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("place", [1, 6])
def test_wherever_it_is_killed_each_fill_is_there_once(place: int, tmp_path: Path) -> None:
    texts = [f"Fact {number}." for number in range(8)]
    fills = [runner("PromptText", text=text, uuid="u") for text in texts]
    write(tmp_path, a=plan(*fills, runner("PromptText", text="And now?", uuid="u", flush="true")))
    with FakeServer(["Fine."]) as server:
        line = f"(text={texts[place]}, uuid=u) started".encode()
        killed(tmp_path, line, "a.xml", "--real", *asking(server))
        done = run("resume", "run.db", "--real", *asking(server), cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert server.received[-1].prompt == "\n".join([*texts, "And now?"])
    assert statuses(tmp_path) == ["COMPLETED"]


def test_no_key_gets_into_a_journal(tmp_path: Path) -> None:
    write(tmp_path, a=ASK)
    secret = "sk-very-secret-0123456789"  # noqa: S105
    with FakeServer(["Hello!"], key="another") as server:
        done = run(
            *("run", "a.xml", "--real", "--journal", "run.db", *asking(server)),
            cwd=tmp_path,
            env={"GPSFSM_API_KEY": secret},
        )
    assert done.returncode == 1
    assert b"asked openai-compatible:tiny: " in done.stdout
    assert secret.encode() not in done.stdout + done.stderr
    assert all(secret.encode() not in file.read_bytes() for file in tmp_path.iterdir())


def test_no_model_no_import(tmp_path: Path) -> None:
    """One process for both: what one of them loads stays loaded."""
    write(tmp_path, a=NEXT)
    code = (
        "import sys; from gpsfsm.cli import main\n"
        f"for how in (['--world', {WORLD!r}], ['--real']):\n"
        "    print(main(['run', 'a.xml', *how]), *sys.modules, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        timeout=60,
        check=True,
    )
    simulated, real = done.stderr.decode().splitlines()
    for expected, never in (
        (simulated, ("httpx", "gpsfsm.running.answer_judge", "gpsfsm.generation")),
        (real, ("httpx", "gpsfsm.running.answer_judge", "gpsfsm.generation.loop")),
    ):
        code, *loaded = expected.split()
        assert code == "0"
        assert "gpsfsm.execution.kernel" in loaded
        assert not [name for name in loaded if name.startswith(never)]
