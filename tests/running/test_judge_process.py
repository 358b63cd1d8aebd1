"""Plans that a model writes during a run in real time are judged by another process."""

from __future__ import annotations

import os
import signal
import threading
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.checking import CheckOptions
from gpsfsm.running.answer_judge import JudgeApart, PlanJudge
from gpsfsm.workers.pool_worker import KeptWorker, Worker
from tests.cli.support import ACCEPTED, REJECTED
from tests.workers.works import Double, killed_with_it_in_hand

if TYPE_CHECKING:
    import pytest

OPTIONS = CheckOptions(capabilities=builtin_capabilities())
FENCED = f"Here:\n```xml\n{ACCEPTED}```\n"


def test_it_judges_as_the_judge_does_from_any_thread() -> None:
    answers = [ACCEPTED, REJECTED, FENCED, "no plan", "\x00\ud800", ""]
    judge = PlanJudge(OPTIONS)
    expected = [judge(answer) for answer in answers]
    assert [each.accepted for each in expected][:4] == [True, False, True, False]
    actual = {}
    with JudgeApart(PlanJudge(OPTIONS)) as apart:

        def work(number: int) -> None:
            actual[number] = apart(answers[number])

        threads = [threading.Thread(target=work, args=(each,)) for each in range(len(answers))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        child = apart._kept.current().child
        assert child.pid != os.getpid()
    assert [actual[number] for number in range(len(answers))] == expected
    assert not child.alive
    assert child.exit_code() == -signal.SIGKILL


def test_an_ended_process_decides_nothing_and_the_next_answer_has_a_new_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with JudgeApart(PlanJudge(OPTIONS)) as apart:
        assert apart(ACCEPTED).accepted
        with monkeypatch.context() as patched:
            patched.setattr(Worker, "give", killed_with_it_in_hand)
            undecided = apart(ACCEPTED)
        assert (undecided.accepted, undecided.decided) == (False, False)
        assert undecided.feedback == "the process that checked the plan has ended"
        assert apart(ACCEPTED).accepted
        os.kill(apart._kept.current().child.pid, signal.SIGKILL)  # with nothing in hand
        assert apart._kept.current().child.exit_code() == -signal.SIGKILL
        assert apart(ACCEPTED).accepted


def test_a_check_that_takes_too_long_is_ended() -> None:
    with JudgeApart(PlanJudge(OPTIONS), timeout_s=0.0) as apart:
        assert apart(ACCEPTED).feedback == "the check was ended: it took more than 0 s"


def test_a_process_that_speaks_of_misuse_has_decided_nothing() -> None:
    """Nobody has misused it: that process was taken over, or is broken."""
    with JudgeApart(PlanJudge(OPTIONS)) as apart:
        apart._kept = KeptWorker(Double(), 60)  # type: ignore[assignment]
        undecided = apart("misuse")
        assert (undecided.accepted, undecided.decided) == (False, False)
        assert undecided.feedback == "the process that checked the plan has ended"
