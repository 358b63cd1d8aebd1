"""Plans that a model writes during a run in real time are judged by another process."""

from __future__ import annotations

import os
import threading

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.checking import CheckOptions
from gpsfsm.cli._judging import JudgeApart
from gpsfsm.judging import PlanJudge
from tests.cli.support import ACCEPTED, REJECTED

OPTIONS = CheckOptions(capabilities=builtin_capabilities())
FENCED = f"Here:\n```xml\n{ACCEPTED}```\n"


def test_it_judges_as_the_judge_does_from_any_thread() -> None:
    answers = [ACCEPTED, REJECTED, FENCED, "no plan", "\x00\ud800", ""]
    judge = PlanJudge(OPTIONS)
    expected = [judge(answer) for answer in answers]
    assert [each.accepted for each in expected][:4] == [True, False, True, False]
    found = {}
    with JudgeApart(OPTIONS) as apart:

        def work(number: int) -> None:
            found[number] = apart(answers[number])

        threads = [threading.Thread(target=work, args=(each,)) for each in range(len(answers))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        process = apart._process
        assert process.pid != os.getpid()
    assert [found[number] for number in range(len(answers))] == expected
    assert process.exitcode is not None


def test_an_ended_process_decides_nothing_and_the_next_answer_has_a_new_one() -> None:
    with JudgeApart(OPTIONS) as apart:
        assert apart(ACCEPTED).accepted
        apart._process.kill()
        apart._process.join()
        undecided = apart(ACCEPTED)
        assert (undecided.accepted, undecided.decided) == (False, False)
        assert undecided.told == "the process that checked the plan has ended"
        assert apart(ACCEPTED).accepted


def test_a_check_that_takes_too_long_is_ended() -> None:
    with JudgeApart(OPTIONS, timeout_s=0.0) as apart:
        assert apart(ACCEPTED).told == "the check was ended: it took more than 0 s"
