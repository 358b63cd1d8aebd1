from __future__ import annotations

import json
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.journal import Journal
from gpsfsm.generation.language_model import conversation_tokens
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, WARNED, run, runner, shell, start
from tests.generation.fake_server import FakeServer
from tests.generation.providers.asking import KEY

if TYPE_CHECKING:
    from collections.abc import Iterator

UNQUOTED = ACCEPTED.replace('y="2"', "y=2")
PROSE = "I am sorry, I cannot \x1b[2Jdo \x9b31m that."
WAIT_S = 30.0


def replay(*answers: str | dict[str, Any], file: str = "answers.jsonl") -> str:
    """A model with these answers."""
    lines = [{"answer": each} if isinstance(each, str) else each for each in answers]
    Path(file).write_text("".join(json.dumps(line) + "\n" for line in lines))
    return f"replay:{file}"


def generate(*arguments: str, task: str = "go to (1, 2)") -> tuple[int, str, str]:
    """Exit code, standard output, standard error."""
    done = run("generate", task, *arguments, env={"GPSFSM_API_KEY": KEY})
    assert KEY.encode() not in done.stdout + done.stderr
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def kept(*arguments: str) -> list[dict[str, Any]]:
    """The sessions of the journal."""
    done = run("attempts", *arguments, "--format", "json")
    assert done.returncode == 0, done.stderr.decode()
    sessions: list[dict[str, Any]] = json.loads(done.stdout)["sessions"]
    return sessions


@pytest.fixture(autouse=True)
def _no_key_is_kept() -> Iterator[None]:
    """No file that a test leaves behind holds the key."""
    yield
    for file in Path().rglob("*"):
        assert not file.is_file() or KEY.encode() not in file.read_bytes(), file


# -- what comes out -----------------------------------------------------------------------------


def test_the_plan_that_is_accepted_is_all_that_comes_out() -> None:
    code, out, err = generate("--model", replay(REJECTED, f"Here you are:\n{ACCEPTED}\nBye!"))
    assert (code, out) == (0, ACCEPTED)
    lines = err.splitlines()
    assert lines[0].startswith("asking replay:answers.jsonl: about ")
    assert lines[1].startswith("attempt 1: rejected, 1 error (GP307); ")
    assert lines[2].startswith("attempt 2: accepted; ")
    assert lines[3] == "accepted (2 answers)"
    (session,) = kept()
    assert session["accepted"]
    assert [each["plan"] for each in session["attempts"]] == [REJECTED.strip(), ACCEPTED.strip()]


def test_without_a_plan_the_best_answer_is_shown_and_nothing_comes_out() -> None:
    code, out, err = generate("--model", replay(BROKEN, REJECTED, PROSE))
    assert (code, out) == (1, "")
    assert "\nno plan: no plan was accepted in 3 attempts (3 answers)\n" in err
    assert "the best answer, from attempt 2:\n\nYour plan was rejected: 1 error" in err
    assert err.endswith(f"its plan, which was not accepted:\n\n{REJECTED}")
    assert "\x1b" not in err
    assert "\x9b" not in err


def test_an_answer_without_a_plan_plays_no_tricks_on_a_terminal() -> None:
    code, out, err = generate("--model", replay(PROSE), "--attempts", "1")
    assert (code, out) == (1, "")
    shown = run("attempts", "--show", "1").stdout.decode()
    for text in (err, shown):
        assert not {"\x1b", "\x9b"}.intersection(text)
    assert "I am sorry, I cannot " in shown
    assert kept()[0]["attempts"][0]["answer"] == PROSE


def test_answers_that_are_too_long_are_answers() -> None:
    code, out, err = generate("--model", replay(*["x" * 200_001] * 2), "--attempts", "2")
    assert (code, out) == (1, "")
    assert "attempt 2: the answer was cut off: it is longer than 200,000 characters" in err
    assert "no plan: no plan was accepted in 2 attempts (2 answers)" in err


def test_a_plan_that_does_nothing_or_excuses_itself_is_not_accepted() -> None:
    excused = REJECTED.replace("<Plan>", "<Plan><!-- gpsfsm: ignore GP307 because I say so -->")
    code, out, err = generate("--model", replay("<Plan/>", excused), "--attempts", "2")
    assert (code, out) == (1, "")
    assert "attempt 1: rejected, 1 error (GP109)" in err
    assert "attempt 2: rejected, 1 error (GP307)" in err


def test_all_as_data() -> None:
    code, out, _ = generate("--model", replay(REJECTED, ACCEPTED), "--format", "json")
    data = json.loads(out)
    assert code == 0
    assert sorted(data) == ["accepted", "attempts", "plan", "reason", "version"]
    assert (data["version"], data["accepted"], data["reason"]) == (1, True, "")
    assert data["plan"] == ACCEPTED.strip()
    assert [each["accepted"] for each in data["attempts"]] == [False, True]
    assert data["attempts"][0]["findings"][0][0] == "GP307"
    code, out, _ = generate("--model", replay(REJECTED), "--format", "json", "--attempts", "1")
    assert (code, json.loads(out)["accepted"]) == (1, False)


def test_into_a_file_and_only_if_it_is_accepted() -> None:
    Path("plan.xml").write_text("old")
    code, out, _ = generate("--model", replay(REJECTED), "-o", "plan.xml", "--attempts", "1")
    assert (code, out, Path("plan.xml").read_text()) == (1, "", "old")
    code, out, _ = generate("--model", replay(ACCEPTED), "-o", "plan.xml")
    assert (code, out, Path("plan.xml").read_text()) == (0, "", ACCEPTED)


def test_the_same_answers_give_the_same_bytes() -> None:
    model = replay(REJECTED, UNQUOTED)
    first, second = (
        generate("--model", model, "--format", "json", "--no-journal") for _ in range(2)
    )
    assert first == second
    assert sorted(file.name for file in Path().iterdir()) == ["answers.jsonl"]


# -- what is accepted ---------------------------------------------------------------------------


def test_safe_repairs_are_made_and_told_unless_not_wanted() -> None:
    code, out, err = generate("--model", replay(UNQUOTED))
    assert (code, out) == (0, ACCEPTED)
    assert "; mended: GP101: " in err
    code, out, err = generate("--model", replay(UNQUOTED), "--no-fix", "--attempts", "1")
    assert (code, out) == (1, "")
    assert "attempt 1: rejected, 1 error (GP101)" in err
    assert "   Write instead:\n     <Runner interface=" in err


def test_warnings_can_be_too_much() -> None:
    guarded = WARNED.replace(
        "</Plan>", f'<Control type="recovery">{runner(x="3")}</Control></Plan>'
    )
    code, out, err = generate("--model", replay(WARNED, guarded), "--fail-on", "warning")
    assert "attempt 1: rejected, 1 warning (GP203)" in err
    assert "attempt 2: rejected, 1 warning (GP203)" in err
    assert (code, out) == (1, "")


def test_of_several_candidates_the_best_is_taken() -> None:
    code, out, err = generate("--model", replay(BROKEN, ACCEPTED, REJECTED), "--candidates", "3")
    assert (code, out) == (0, ACCEPTED)
    assert [line.partition(";")[0] for line in err.splitlines()[1:4]] == [
        "attempt 1, candidate 1: rejected, 2 errors (GP101, GP107)",
        "attempt 1, candidate 2: accepted",
        "attempt 1, candidate 3: rejected, 1 error (GP307)",
    ]
    assert [each["candidate"] for each in kept()[0]["attempts"]] == [1, 2, 3]


def test_what_was_not_offered_is_not_there() -> None:
    unknown = ACCEPTED.replace("nav2_capabilities/Waypoint", "dream_capabilities/Fly")
    code, _, err = generate("--model", replay(unknown), "--attempts", "1")
    assert code == 1
    assert "attempt 1: rejected, 1 error (GP201)" in err
    only = ("--interface", "perception_capabilities/*", "--attempts", "1", "--no-fix")
    code, _, err = generate("--model", replay(ACCEPTED), *only)
    assert code == 1
    assert "there is no interface 'nav2_capabilities/WaypointRunner'" in err
    code, out, _ = generate("--model", replay(ACCEPTED), "--interface", "WaypointRunner")
    assert (code, out) == (0, ACCEPTED)


def test_an_example_is_no_answer() -> None:
    Path("example.xml").write_text(ACCEPTED)
    code, _, err = generate(
        *("--model", replay(ACCEPTED, REJECTED), "--example", "example.xml", "--attempts", "2")
    )
    assert code == 1
    assert "attempt 1: this is an example; " in err


# -- what the model is asked --------------------------------------------------------------------


def test_a_follow_up_tells_what_is_wrong_and_speakers_take_turns() -> None:
    with FakeServer([PROSE, "", REJECTED, ACCEPTED]) as server:
        code, _, err = generate(
            *("--model", "vllm:tiny", "--base-url", server.url, "--attempts", "4"),
            "--no-constrain",
        )
        turns = [request.body["messages"] for request in server.received]
    assert code == 0, err
    for messages in turns:
        roles = [message["role"] for message in messages]
        assert roles in (["system", "user"], ["system", "user", "assistant", "user"])
    assert "Your answer was empty." in turns[2][1]["content"]
    assert turns[3][2]["content"] == REJECTED.strip()
    assert turns[3][3]["content"].startswith("Your plan was rejected: 1 error")


@pytest.mark.parametrize("context", [2000, 2600, 4096, 8192])
def test_everything_fits_into_a_small_context(context: int) -> None:
    steps = "\n".join(runner(x=str(number)) for number in range(12))
    long = f'<Plan>\n<Control type="recovery">{runner()}</Control>\n{steps}\n</Plan>'
    with FakeServer([long, REJECTED, ACCEPTED]) as server:
        code, _, err = generate(
            *("--model", "vllm:tiny", "--base-url", server.url, "--context", str(context)),
            "--no-constrain",
        )
        requests = [each.body for each in server.received]
    assert code == 0, err
    most = min(4096, context // 3)
    for body in requests:
        assert body["max_tokens"] == most
        texts = [message["content"] for message in body["messages"]]
        assert conversation_tokens(texts) + most <= context
    assert f"note: an answer may have {most:,} tokens, a third of the context\n" in err
    without = "asked without its earlier answer" in err
    assert without == (len(requests[1]["messages"]) == 2) == (context < 4096)


@pytest.mark.parametrize(("heeds", "recorded"), [(True, "gbnf"), (False, None)])
def test_it_is_recorded_whether_a_grammar_was_heeded(heeds: bool, recorded: str | None) -> None:
    with FakeServer([ACCEPTED], heeds=["structured_outputs"] if heeds else []) as server:
        code, _, err = generate("--model", "vllm:tiny", "--base-url", server.url)
        (request,) = server.plan_requests
    assert code == 0, err
    assert bool(request.grammar_field) is heeds
    assert ("; constrained by gbnf" in err) is heeds
    assert kept()[0]["attempts"][0].get("constrained") == recorded


# -- what can go wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "gpsfsm: no model is named: use --model, GPSFSM_MODEL or [tool.gpsfsm.model]."),
        (("--model", "replay:absent.jsonl"), "absent.jsonl: is not a file with recorded answers"),
        (("--model", "vllm:m", "--base-url", "http://127.0.0.1:9", "--retries", "0"), "no one an"),
        (("--model", "replay:one.jsonl", "-o", "absent/plan.xml"), "absent"),
        (("--model", "replay:one.jsonl", "--journal", "absent/run.db"), "--journal FILE keeps"),
        (("--model", "replay:one.jsonl", "--journal", "one.jsonl"), "this is not a journal"),
        (("--model", "replay:one.jsonl", "--attempts", "0"), "--attempts"),
        (("--model", "replay:one.jsonl", "--context", "700"), "the shortest prompt takes about"),
    ],
)
def test_what_cannot_be_asked(arguments: tuple[str, ...], message: str) -> None:
    replay(ACCEPTED, file="one.jsonl")
    code, out, err = generate(*arguments)
    assert (code, out) == (2, "")
    assert message in err


def test_a_model_that_does_not_answer_any_more() -> None:
    code, out, err = generate("--model", replay(REJECTED, {"error": "the server is gone"}))
    assert (code, out) == (1, "")
    assert "attempt 2: replay:answers.jsonl: the server is gone\n" in err
    assert "the best answer, from attempt 1:" in err


@pytest.mark.parametrize("provider", ["openai-compatible", "ollama"])
@pytest.mark.parametrize(
    ("fault", "code"), [("cut", 2), ("429", 2), ("garbage", 2), ("html", 2), ("huge", 2)]
)
def test_servers_that_fail(provider: str, fault: str, code: int) -> None:
    with FakeServer([ACCEPTED], faults=[fault] * 50) as server:
        exit_code, out, err = generate(
            *("--model", f"{provider}:tiny", "--base-url", server.url, "--no-constrain"),
            *("--retries", "1" if fault != "429" else "0", "--timeout", "20"),
        )
    assert (exit_code, out) == (code, ""), err
    assert f"no plan: {provider}:tiny: " in err
    (session,) = kept()
    assert (session["accepted"], session["interrupted"]) == (False, False)
    assert "answer" not in session["attempts"][0]


def test_an_answer_that_is_far_too_long_is_not_read() -> None:
    huge = "<Plan>" + " " * 300_000 + "</Plan>"
    with FakeServer([huge, ACCEPTED]) as server:
        code, out, err = generate(
            "--model", "vllm:tiny", "--base-url", server.url, "--no-constrain"
        )
        assert len(json.dumps(server.received[1].body)) < 100_000
    assert (code, out) == (0, ACCEPTED)
    assert "attempt 1: the answer was cut off: it is longer than 200,000 characters" in err
    assert len(kept()[0]["attempts"][0]["answer"]) == 200_000


def test_the_time_is_bounded() -> None:
    with FakeServer([ACCEPTED], faults=["hang"]) as server:
        code, out, err = generate(
            *("--model", "vllm:tiny", "--base-url", server.url, "--no-constrain"),
            *("--total", "0.2"),
        )
    assert (code, out) == (2, "")
    assert "vllm:tiny did not answer in the time that was left" in err


def test_a_journal_that_another_process_writes_to() -> None:
    with FakeServer([ACCEPTED]) as server, Journal("run.db"):
        code, out, err = generate(
            *("--model", "vllm:tiny", "--base-url", server.url, "--journal", "run.db")
        )
        assert server.received == []
    assert (code, out) == (2, "")
    assert "run.db: another process writes to this journal" in err
    assert "--journal FILE keeps the attempts elsewhere" in err


def test_a_disk_that_is_full() -> None:
    model = replay("x" * 200_000)
    command = f"ulimit -f 100; $NEW_GPSFSM generate go --model {model} --journal run.db"
    done = shell(command, Path())
    assert done.returncode == 2
    assert done.stdout == b""
    assert b"run.db: the journal cannot be written" in done.stderr
    assert b"--journal FILE keeps the attempts elsewhere" in done.stderr
    assert kept("run.db")[0]["interrupted"]


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGKILL])
def test_what_was_answered_before_it_was_stopped_is_kept(signum: signal.Signals) -> None:
    with FakeServer([REJECTED], faults=["", "hang"]) as server:
        command = ["generate", "go", "--model", "vllm:tiny", "--base-url", server.url]
        with start(*command, "--no-constrain", env={"GPSFSM_API_KEY": KEY}) as process:
            deadline = time.monotonic() + WAIT_S
            while len(server.received) < 2 and time.monotonic() < deadline:
                time.sleep(0.01)
            process.send_signal(signum)
            out, err = process.communicate(timeout=WAIT_S)
    assert out == b""
    assert KEY.encode() not in err
    assert b"Traceback" not in err
    if signum is signal.SIGINT:
        assert process.returncode == 130
        assert err.endswith(b"stopped; the answers are in gpsfsm.db\n")
    (session,) = kept()
    assert session["interrupted"]
    assert [each["plan"] for each in session["attempts"]] == [REJECTED.strip()]
    assert run("attempts").stdout.endswith(b"\n  interrupted\n")


def test_what_the_service_asks_for_takes_only_files_that_it_names() -> None:
    Path("gpsfsm.toml").write_text('capabilities = ["missing"]\n', encoding="utf-8")
    model = replay(ACCEPTED)
    assert generate("--model", model)[0] == 2
    assert generate("--model", model, "--served")[:2] == (0, ACCEPTED)
    assert generate("--model", model, "--served", "--config", "gpsfsm.toml")[0] == 2
