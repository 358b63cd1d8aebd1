"""Real runners behind the service: what crashes, stops and lost bonds leave, and who goes on."""

from __future__ import annotations

import json
import os
import resource
import signal
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal_read import JournalReader
from tests.cli.support import run
from tests.service.real import (
    LONG,
    OTHER,
    ROOT,
    SHORT,
    TOKEN,
    RealService,
    held,
    move,
    plan,
    program,
    set_plan,
    status,
    until,
)
from tests.service.support import ended, slow_plan

if TYPE_CHECKING:
    from collections.abc import Iterator

_RESTARTED = "the process that runs the plans was restarted"


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealService]:
    """One service for all tests that leave it as it was; what is killed in it comes back."""
    with RealService(tmp_path_factory.mktemp("real") / "robot", stopper=True) as service:
        yield service


@pytest.fixture
def real(kept: RealService) -> Iterator[RealService]:
    kept.forget()
    yield kept
    kept.behave("well")
    with kept.client() as client:
        client.post("/v1/stop")
        until(lambda: client.get("/v1/queue").json()["plan_id"] is None)
        for each in client.get("/v1/plans").json()["plans"]:
            client.post(f"/v1/plans/{each['plan_id']}/cancel")
        assert client.post("/v1/queue/release").json()["success"]


def test_a_plan_acts_for_real_and_is_told_as_it_happens(real: RealService) -> None:
    with real.client() as client:
        number = set_plan(client, plan(move(0.5), program("sleep 0.1")))
        end = ended(client, number)
        assert (end["status"], end["world"], end["speed"]) == ("COMPLETED", "real", 1.0)
        assert real.moves() == ["go /Plan/Runner[1]", "arrive /Plan/Runner[1]"]
        run = client.get(f"/v1/runs/{end['run']}").json()
        assert run["mode"] == "real"
        data = [each["data"] for each in run["records"] if each["kind"] == "LOG"]
        assert {"feedback": "drive", "distance_left_m": 0.5} in data
        assert any(each.get("world") == "pose" for each in data)
        service = client.get("/v1/service").json()
        assert service["real"]
        assert service["worlds"] == []
        assert held(client) == ""


def test_the_gate_knows_what_plans_may_reach(real: RealService) -> None:
    with real.client() as client:
        answer = client.post("/v1/plans", json={"plan": plan(program("rm -r /tmp/nothing"))})
        assert answer.status_code == 422
        assert any("GP213" in each for each in answer.json()["rejected_list"])
        answer = client.post("/v1/gate", json={"plan": plan(program("sleep 1"))})
        assert answer.json()["verdict"] == "accepted"
        unknown = '<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>'
        answer = client.post("/v1/plans", json={"plan": unknown})
        assert answer.status_code == 422
        assert "no capability file describes a/Go" in answer.json()["detail"]


def test_what_has_no_meaning_for_real_runners_is_refused(real: RealService) -> None:
    with real.client() as client:
        for start in ({"world": "field"}, {"speed": 4}):
            answer = client.post("/v1/plans", json={"plan": SHORT, "start": start})
            assert answer.status_code == 422, answer.text
        number = set_plan(client, LONG)
        until(lambda: real.did("go"))
        for what, body in (("step", {}), ("speed", {"speed": 2}), ("fail", {"node": 1})):
            answer = client.post(f"/v1/plans/{number}/{what}", json=body).json()
            assert not answer["success"]
            assert "cannot be stepped" in answer["why"]


def test_a_pause_triggers_nothing_more(real: RealService) -> None:
    with real.client() as client:
        number = set_plan(client, plan(move(0.6), move(0.1)))
        until(lambda: real.did("go"))
        answer = client.post(f"/v1/plans/{number}/pause").json()
        assert (answer["success"], answer["paused"]) == (True, True)
        until(lambda: real.did("arrive"))
        waiting = set_plan(client, SHORT)  # the queue answers meanwhile
        assert status(client, number) == "RUNNING"
        assert len(real.did("go")) == 1
        assert client.post(f"/v1/plans/{number}/resume").json()["paused"] is False
        assert ended(client, number)["completed"]
        assert ended(client, waiting)["completed"]


def test_a_plan_can_begin_paused(real: RealService) -> None:
    with real.client() as client:
        number = set_plan(client, SHORT, start={"paused": True})
        until(lambda: status(client, number) == "RUNNING")
        assert not real.did("go")
        client.post(f"/v1/plans/{number}/resume")
        assert ended(client, number)["completed"]


def test_a_program_has_the_memory_that_it_has_without_a_service(real: RealService) -> None:
    with real.client() as client:
        number = set_plan(client, plan(program("sleep 298.5")))
        pid = until(lambda: _running("sleep\x00298.5"), "the program")
        (line,) = [
            line
            for line in (pid / "limits").read_text().splitlines()
            if line.startswith("Max address space")
        ]
        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        wanted = "unlimited" if soft == resource.RLIM_INFINITY else str(soft)
        assert line.split()[3] == wanted
        client.post(f"/v1/plans/{number}/cancel")
        assert ended(client, number)["status"] == "CANCELLED"


def _running(command: str) -> Path | None:
    """The folder of a program in /proc, if it runs."""
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if (place / "cmdline").read_text().rstrip("\x00") == command:
                return place
    return None


def test_a_request_that_comes_twice_is_queued_once(real: RealService) -> None:
    with real.client() as client:
        first = set_plan(client, SHORT, request_id="once")
        assert set_plan(client, SHORT, request_id="once") == first
        assert ended(client, first)["completed"]
        assert real.did("go") == ["/Plan/Runner[1]"]


# -- what a crash leaves --------------------------------------------------------------------


def test_after_a_crash_all_is_cancelled_and_the_queue_is_held(real: RealService) -> None:
    with real.client() as client:
        first, second = set_plan(client, plan(move(300), move(0.1))), set_plan(client, SHORT)
        until(lambda: real.did("go"))
        os.kill(real.process_of_queue(), signal.SIGKILL)
        until(lambda: real.did("left"))
        end = ended(client, first)
        assert (end["status"], end["reason"]) == ("CANCELLED", _RESTARTED)
        assert held(client) == _RESTARTED
        with JournalReader(real.journal) as reader:
            how = reader.run(end["run"]).status.value
            rows = [(row.kind, row.message) for row in reader.events(end["run"])]
        assert how == "CANCELLED"
        assert ("CANCEL", _RESTARTED) in rows
        assert ("LOG", "its goal is cancelled") in rows
        third = set_plan(client, SHORT)
        assert [status(client, each) for each in (second, third)] == ["QUEUED", "QUEUED"]
        assert len(real.did("go")) == 1  # nothing has moved by itself
        assert "stop" in real.stops.read_text()  # before there was a new process
        answer = client.post("/v1/queue/release").json()
        assert (answer["success"], answer["held"]) == (True, "")
        assert ended(client, second)["completed"]
        assert ended(client, third)["completed"]
        assert not client.post("/v1/queue/release").json()["success"]
    assert real.did("go") == ["/Plan/Runner[1]"] * 3
    assert real.did("left") == ["/Plan/Runner[1]"]
    assert real.decisions("HELD")[-1] == _RESTARTED
    assert len(real.decisions("HELD")) == len(real.decisions("RELEASED"))


def test_a_program_ends_with_the_process_that_ran_it(real: RealService) -> None:
    with real.client() as client:
        number = set_plan(client, plan(program("sleep 299.125"), move(0.1)))
        until(lambda: status(client, number) == "RUNNING" and programs("299.125"))
        os.kill(real.process_of_queue(), signal.SIGKILL)
        until(lambda: status(client, number) == "CANCELLED")  # 503 where it meets the end
        assert ended(client, number)["status"] == "CANCELLED"
        until(lambda: not programs("299.125"))
        assert held(client)
        assert not real.did("go")


def programs(marker: str) -> list[int]:
    """The processes with a marker on their command line."""
    from pathlib import Path

    results = []
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                words = (place / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if words[:1] == [b"sleep"] and marker.encode() in words:
                results.append(int(place.name))
    return results


def test_the_queue_stays_held_over_further_restarts(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    with RealService(folder) as service, service.client() as client:
        number = set_plan(client, LONG)
        until(lambda: service.did("go"))
        os.kill(service.process_of_queue(), signal.SIGSTOP)  # it is not to notice that
        hung = service.process_of_queue()
        service.process.kill()
        os.kill(hung, signal.SIGKILL)
        service.finish()
    with RealService(folder, stopper=True) as service, service.client() as client:
        assert held(client) == _RESTARTED
        until(service.stops.exists, "a stop of what was left")
        assert ended(client, number)["status"] == "CANCELLED"
        waiting = set_plan(client, SHORT)
        assert service.stop() == 0
    with RealService(folder) as service, service.client() as client:
        assert held(client) == _RESTARTED
        assert status(client, waiting) == "QUEUED"
        client.post("/v1/queue/release")
        assert ended(client, waiting)["completed"]
        assert len(service.did("go")) == 2


def test_a_service_that_ends_in_good_order_stops_what_runs(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    with RealService(folder) as service, service.client() as client:
        set_plan(client, LONG)
        until(lambda: service.did("go"))
        assert service.stop() == 0
        assert service.did("stop") == ["/Plan/Runner[1]"]
        with JournalReader(service.journal) as reader:
            assert reader.run(1).status.value == "CANCELLED"
            why = [row.message for row in reader.events(1) if row.kind == "CANCEL"]
        assert why == ["the service was stopped"]
    with RealService(folder) as service, service.client() as client:
        assert held(client) == "the service was stopped"
        assert not service.did("left")  # nothing was left


def test_a_robot_stops_before_the_last_request_is_answered(tmp_path: Path) -> None:
    with RealService(tmp_path / "robot", "--grace", "60") as service, service.client() as client:
        set_plan(client, LONG)
        until(lambda: service.did("go"))
        connection = service.connect()  # a body that does not come holds up the end
        content = httpx_body({"plan": SHORT})
        connection.sendall(content[:-1])
        until(lambda: "gpsfsm_body_bytes 0" not in client.get("/metrics").text, "a body")
        service.process.send_signal(signal.SIGTERM)
        until(lambda: service.did("stop"), "the end of the run")
        connection.setblocking(False)
        with pytest.raises(BlockingIOError):  # the service still waits for the body
            connection.recv(1)
        connection.setblocking(True)
        connection.sendall(content[-1:])
        assert service.stop() == 0
        connection.close()


def test_a_stop_before_the_first_plan_is_the_reason_after_a_restart(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    with RealService(folder) as service, service.client() as client:
        client.post("/v1/stop")
        waiting = set_plan(client, SHORT)
        service.kill()
    with RealService(folder) as service, service.client() as client:
        assert held(client) == "stopped by token 0"
        assert status(client, waiting) == "QUEUED"
        assert not service.did("go")


@pytest.mark.parametrize("stopped", [True, False])
def test_resume_lets_nothing_move_that_a_service_holds(tmp_path: Path, stopped: bool) -> None:
    folder = tmp_path / "robot"
    with RealService(folder) as service, service.client() as client:
        set_plan(client, LONG)
        set_plan(client, SHORT)
        until(lambda: service.did("go"))
        if stopped:
            client.post("/v1/stop")
        os.kill(hung := service.process_of_queue(), signal.SIGSTOP)
        service.process.kill()
        os.kill(hung, signal.SIGKILL)
        service.finish()
    words = ("--capabilities", folder, "--allow-module", "mover", "--allow-program", "sleep")
    before = service.moves()
    around = {"PYTHONPATH": f"{ROOT}:{folder}", "MOVER_LOG": str(service.log)}
    done = run("resume", "--real", "--isolated", folder / "queue.db", *words, env=around)
    assert done.returncode == 2
    assert "start 'gpsfsm serve --real' with this journal" in done.stderr.decode()
    assert service.moves() == before


# -- stop -----------------------------------------------------------------------------------


def test_stop_cancels_what_runs_and_holds_the_queue(real: RealService) -> None:
    service = real
    with real.client() as client:
        number, waiting = set_plan(client, LONG), set_plan(client, SHORT)
        until(lambda: service.did("go"))
        answer = client.post("/v1/stop")
        assert answer.status_code == 200, answer.text
        document = answer.json()
        assert (document["plan_id"], document["goals"], document["problems"]) == (number, 2, [])
        assert document["held"] == "stopped by token 0"
        assert service.stops.read_text() == "stop\n"
        assert ended(client, number)["reason"] == "stopped by token 0"
        assert service.did("stop") == ["/Plan/Runner[1]"]
        assert status(client, waiting) == "QUEUED"
        assert client.get("/v1/queue").json()["stopper"] == "up"
        client.post("/v1/queue/release")
        assert ended(client, waiting)["completed"]


def test_stop_needs_a_token_and_nothing_to_stop(real: RealService) -> None:
    with real.client("no-token-of-this-service") as stranger:
        assert stranger.post("/v1/stop").status_code == 401
        assert stranger.post("/v1/queue/release").status_code == 401
    assert not real.stops.exists()
    with real.client() as client:
        document = client.post("/v1/stop").json()
        assert (document["plan_id"], document["held"]) == (None, "stopped by token 0")
        waiting = set_plan(client, SHORT)
        assert status(client, waiting) == "QUEUED"


def test_stop_reaches_a_robot_whose_queue_hangs(real: RealService) -> None:
    service = real
    with real.client() as client:
        number = set_plan(client, LONG)
        until(lambda: service.did("go"))
        hung = service.process_of_queue()
        os.kill(hung, signal.SIGSTOP)
        answer = client.post("/v1/stop")
        assert answer.status_code == 503
        assert "it was killed" in answer.json()["detail"]
        assert answer.json()["goals"] == 2
        assert service.stops.read_text().startswith("stop\n")
        assert hung not in service.children()
        end = ended(client, number)
        assert (end["status"], end["reason"]) == ("CANCELLED", "stopped by token 0")
        assert held(client) == "stopped by token 0"
        assert service.did("left") == ["/Plan/Runner[1]"]


def test_stop_waits_for_no_worker_and_for_no_share(real: RealService) -> None:
    service = real
    with real.client() as client:
        number = set_plan(client, LONG)
        until(lambda: service.did("go"))
        opened = []
        try:
            slow = {"plan": slow_plan(), "options": {"consistent": True}}
            body = httpx_body(slow)
            for _ in range(80):  # workers, places in the line, bodies that never come
                connection = service.connect()
                connection.sendall(body)
                opened.append(connection)
            answer = client.post("/v1/stop", timeout=10)
            assert answer.status_code == 200, answer.text
            assert answer.json()["plan_id"] == number
            with service.client(OTHER) as other:
                assert other.post("/v1/stop", timeout=10).status_code == 200
        finally:
            for connection in opened:
                connection.close()


def httpx_body(body: object) -> bytes:
    """A request to check something, as it goes over the wire."""
    content = json.dumps(body).encode()
    return (
        b"POST /v1/check HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        + f"Authorization: Bearer {TOKEN}\r\nContent-Length: {len(content)}\r\n\r\n".encode()
        + content
    )


@pytest.mark.parametrize(
    ("how", "why"),
    [
        ("deaf", "the stopper has not answered within 3 s"),
        ("partly", "/dock has not answered"),
        ("strange", "no number of goals"),
    ],
)
def test_a_stop_that_is_not_confirmed_says_so(real: RealService, how: str, why: str) -> None:
    real.behave(how)
    with real.client() as client:
        number = set_plan(client, LONG)
        until(lambda: real.did("go"))
        answer = client.post("/v1/stop")
        assert answer.status_code == 503
        assert why in answer.json()["detail"]
        assert ended(client, number)["status"] == "CANCELLED"  # all the same
        assert held(client)


def test_a_late_answer_of_the_stopper_confirms_no_later_stop(real: RealService) -> None:
    real.behave("late")
    with real.client() as client:
        for _ in range(2):  # the answer to the first one comes while the second one waits
            answer = client.post("/v1/stop")
            assert answer.status_code == 503, answer.text
            assert "the stopper has not answered within 3 s" in answer.json()["detail"]


def test_a_stopper_that_has_ended_is_started_again(real: RealService) -> None:
    service = real
    with real.client() as client:
        os.kill(first := service.child("stopper_child"), signal.SIGKILL)
        answer = client.post("/v1/stop")  # while it ends or is being started
        assert answer.json()["goals"] == 2 or "the stopper" in answer.json()["detail"]
        until(lambda: client.post("/v1/stop").status_code == 200, "a new stopper")
        assert service.child("stopper_child") != first
        assert client.get("/health").json()["stopper"] == "up"
        assert "the stopper is not available" in "".join(service.said)


def test_a_queue_is_not_released_where_nothing_could_be_stopped(real: RealService) -> None:
    service = real
    with real.client() as client:
        client.post("/v1/stop")
        os.kill(service.child("stopper_child"), signal.SIGSTOP)
        until(lambda: client.get("/health").json()["stopper"] == "down", "a silent stopper")
        answer = client.post("/v1/queue/release")
        until(lambda: client.get("/health").json()["stopper"] == "up", "a new stopper")
        assert answer.status_code == 503 or client.get("/v1/queue").json()["stopper"] == "up"


def test_a_release_is_for_the_reason_that_its_operator_knows(real: RealService) -> None:
    with real.client() as client, real.client(OTHER) as other:
        client.post("/v1/stop")
        seen = held(client)
        assert other.post("/v1/stop").json()["held"] == "stopped by token 1"
        answer = client.post("/v1/queue/release", json={"held": seen}).json()
        assert (answer["success"], answer["held"]) == (False, "stopped by token 1")
        waiting = set_plan(client, SHORT)
        assert status(client, waiting) == "QUEUED"
        answer = client.post("/v1/queue/release", json={"held": answer["held"]}).json()
        assert (answer["success"], answer["held"]) == (True, "")
        assert ended(client, waiting)["completed"]


def test_a_release_does_not_wait_for_a_queue_that_comes_back_held(real: RealService) -> None:
    with real.client() as client:
        client.post("/v1/stop")
        os.kill(real.process_of_queue(), signal.SIGKILL)
        until(lambda: client.get("/health").json()["queue"] == "down", "the end of the queue")
        answer = client.post("/v1/queue/release")
        assert answer.status_code == 503
        assert "is being restarted" in answer.json()["detail"]
        assert held(client) == "stopped by token 0"


# -- the bond -------------------------------------------------------------------------------


def test_a_lost_bond_cancels_what_runs_and_holds_the_queue(real: RealService) -> None:
    with real.client() as client:
        number = set_plan(client, LONG)
        until(lambda: real.did("go"))
        answer = client.post("/v1/bond", json={"lease_s": 1.5})
        assert answer.json()["bonds"] == 1
        end = ended(client, number)
        assert end["reason"] == "the bond is lost: no beat for 1.5 s from token 0"
        assert held(client) == end["reason"]
        assert client.post("/v1/bond", json={"lease_s": 60}).json()["held"] == end["reason"]
        client.post("/v1/queue/release")
        assert ended(client, set_plan(client, SHORT))["completed"]


def test_a_bond_that_beats_or_was_left_stops_nothing(real: RealService) -> None:
    with real.client() as client:
        client.post("/v1/bond", json={"lease_s": 30})
        assert client.post("/v1/bond", json={"lease_s": 2}).json()["bonds"] == 1
        assert client.post("/v1/bond", json={"end": True}).json()["bonds"] == 0
        assert ended(client, set_plan(client, plan(move(2.5))))["completed"]
        assert held(client) == ""


def test_a_service_that_hangs_stops_no_clock_of_a_bond(tmp_path: Path) -> None:
    with RealService(tmp_path / "robot") as service, service.client() as client:
        set_plan(client, LONG)
        until(lambda: service.did("go"))
        client.post("/v1/bond", json={"lease_s": 1})
        service.process.send_signal(signal.SIGSTOP)
        until(lambda: service.did("stop"), "the end of the lease")
        service.process.send_signal(signal.SIGCONT)
        assert held(client) == "the bond is lost: no beat for 1 s from token 0"


def test_a_model_goes_on_for_a_plan_that_gave_up(tmp_path: Path) -> None:
    answers = tmp_path / "answers.jsonl"
    answers.write_text(json.dumps({"answer": plan(move(0.2))}) + "\n", encoding="utf-8")
    words = ("--model", f"replay:{answers}", "--task", "Get there.")
    with RealService(tmp_path / "robot", *words) as service, service.client() as client:
        number = set_plan(client, plan(program("sleep nonsense")))
        assert ended(client, number)["status"] == "GAVE_UP"
        following = until(
            lambda: [each for each in client.get("/v1/plans").json()["plans"] if each["continues"]]
        )
        assert ended(client, following[0]["plan_id"])["completed"]
        assert service.did("arrive") == ["/Plan/Runner[1]"]


# -- how it begins --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ((), "--real needs --journal"),
        (("--journal", "q.db"), "say what they may reach"),
        (("--journal", "q.db", "--allow-program", "echo"), "a token is needed"),
        (("--journal", "q.db", "--world", "w.yaml"), "--real and --world cannot be used together"),
        (("--journal", "q.db", "--speed", "2"), "--real and --speed cannot be used together"),
        (("--journal", "q.db", "--failure", "0"), "--real and --failure cannot be used together"),
    ],
)
def test_it_does_not_begin_without_what_it_needs(
    tmp_path: Path, words: tuple[str, ...], why: str
) -> None:
    done = run("serve", "--real", "--isolated", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert why in done.stderr.decode()


def test_permissions_without_real_runners_are_refused(tmp_path: Path) -> None:
    done = run("serve", "--isolated", "--allow-program", "echo", cwd=tmp_path)
    assert done.returncode == 2
    assert "--allow-program needs --real" in done.stderr.decode()


def test_journals_of_simulations_and_of_robots_are_not_mixed(tmp_path: Path) -> None:
    from tests.service.support import Service

    folder = tmp_path / "robot"
    with RealService(folder) as service, service.client() as client:
        ended(client, set_plan(client, SHORT))
        service.stop()
    journal = folder / "queue.db"
    done = run("serve", "--isolated", "--port", "0", "--journal", journal)
    assert done.returncode == 2
    assert "are for real runners" in done.stderr.decode()
    journal.rename(tmp_path / "real.db")
    for rest in folder.glob("queue.db-*"):
        rest.unlink()
    with Service("--journal", journal, "--failure", "0") as simulated, simulated.client() as client:
        ended(client, client.post("/v1/plans", json={"plan": LOG}).json()["plan_id"])
        simulated.stop()
    other = RealService(folder)
    with pytest.raises(AssertionError, match="not submitted to be run for real"):
        other.start()
    other.finish()


LOG = (
    '<Plan><Runner interface="generic_capabilities/LogRunner" '
    'provider="generic_capabilities/LogRunner" text="x"/></Plan>'
)


def test_stop_is_for_real_runners(tmp_path: Path) -> None:
    from tests.service.support import Service

    with Service("--journal", tmp_path / "q.db") as service, service.client() as client:
        assert client.post("/v1/stop").status_code == 501
        assert client.get("/v1/queue").status_code == 501


def test_the_journal_of_all_this_is_whole(real: RealService) -> None:
    with JournalReader(real.journal) as reader:
        reader.check()
        reader.verify_queue()
        for run in reader.runs():
            reader.verify(run.number)
            assert run.mode == "real"
            assert run.status.ended
