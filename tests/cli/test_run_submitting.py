"""Real runners that submit plans: the gate is another process, and nothing waits for it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.checking.parallel import CheckApart
from gpsfsm.errors import UsageError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.model.report import PlanReport, Verdict
from gpsfsm.workers.pool_worker import Worker
from tests.cli.support import ACCEPTED, REJECTED, run, start, write
from tests.workers.works import killed_with_it_in_hand

RUNNER = """
from pathlib import Path

from gpsfsm.execution.runner import Runner, RunnerError


class NextRunner(Runner):
    async def start(self, context):
        self.plans = context.services["plans"]

    async def run(self, parameters, context):
        text = Path(parameters["file"]).read_text()
        {call}
        if self.plans.status(plan) == "REFUSED":
            raise RunnerError("; ".join(self.plans.findings(plan)))
        context.log(f"queued as plan {{plan}}")
"""
CALLS = {
    "waiting": 'plan = await self.plans.submitted(text, "NextRunner")',
    "blocking": 'plan = self.plans.submit(text, "NextRunner")',
}
PROVIDER = """
name: NextRunner
spec_type: provider
spec_version: 1.2
description: Submits the plan in a file.
implements: next_capabilities/NextRunner
runner: next_robot:NextRunner
idempotent: true
definition:
  command: "<Runner interface=next_capabilities/NextRunner provider=next_capabilities/NextRunner file='$file' />"
  configuration_parameters:
    - {name: file, type: string, description: Where the plan is.}
  runtime_parameters: {input: [], output: []}
"""  # noqa: E501  (a template is one line)
INTERFACE = """
name: NextRunner
spec_type: interface
spec_version: 1.2
description: Submits a plan.
"""
NEXT = '<Runner interface="next_capabilities/NextRunner" provider="next_capabilities/NextRunner"'
WAIT = "generic_capabilities/WaitRunner"
OPTIONS = ("--real", "--allow-module", "next_robot", "--capabilities", "robot")


def wait(seconds: float) -> str:
    return f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="{seconds}"/>'


def submitting(file: str) -> str:
    return f'{NEXT} file="{file}"/>'


def robot(folder: Path, call: str = "waiting") -> None:
    """A robot whose runner submits plans."""
    described = folder / "robot" / "next_capabilities"
    for kind, text in (("providers", PROVIDER), ("interfaces", INTERFACE)):
        (described / kind).mkdir(parents=True)
        (described / kind / "NextRunner.yaml").write_text(text, encoding="utf-8")
    (folder / "next_robot.py").write_text(RUNNER.format(call=CALLS[call]), encoding="utf-8")


@pytest.mark.parametrize("call", CALLS)
def test_a_real_runner_submits_a_plan_and_is_told_of_a_refusal(call: str, tmp_path: Path) -> None:
    robot(tmp_path, call)
    write(
        tmp_path,
        a=f"<Plan>\n{submitting('b.xml')}{submitting('bad.xml')}\n</Plan>",
        b=f"<Plan>\n{wait(0.1)}\n</Plan>",
        bad=REJECTED,
    )
    done = run("run", "a.xml", *OPTIONS, "--journal", "run.db", cwd=tmp_path)
    assert done.returncode == 1
    out = done.stdout.decode()
    assert "NextRunner (file=b.xml) says: queued as plan 2" in out
    assert "NextRunner (file=bad.xml) failed: GP307 at line 2: " in out
    assert "== plan 2 from NextRunner\n" in out
    assert b"plan 3 from NextRunner:2:3: error GP307" in done.stderr
    with JournalReader(str(tmp_path / "run.db")) as reader:
        assert [row[2] for row in reader.queue()].count("REFUSED") == 1
        assert [str(each.status) for each in reader.runs()] == ["GAVE_UP", "COMPLETED"]


def test_a_crash_in_the_plan_that_a_real_runner_has_submitted(tmp_path: Path) -> None:
    robot(tmp_path)
    write(
        tmp_path,
        a=f"<Plan>\n{submitting('b.xml')}\n</Plan>",
        b=f"<Plan>\n{wait(0.5)}{wait(0.1)}\n</Plan>",
    )
    with start("run", "a.xml", *OPTIONS, "--journal", "run.db", cwd=tmp_path) as process:
        assert process.stdout is not None
        while b"(seconds=0.5) started" not in (line := process.stdout.readline()):
            assert line
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)
    done = run("resume", "run.db", *OPTIONS, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert b"COMPLETED" in done.stdout
    with JournalReader(str(tmp_path / "run.db")) as reader:
        reader.verify_queue()
        assert [row[2] for row in reader.queue()].count("SUBMITTED") == 2
        assert [str(each.status) for each in reader.runs()] == ["COMPLETED", "COMPLETED"]


def test_standard_input_holds_one_plan(tmp_path: Path) -> None:
    done = run("run", "-", "-", stdin=ACCEPTED.encode(), cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"standard input holds only one plan" in done.stderr


# -- the process that checks ----------------------------------------------------------------------


def test_plans_are_checked_in_another_process() -> None:
    options = check_options()
    with CheckApart() as apart:
        actual = [apart.check(text.encode(), "p.xml", options) for text in (ACCEPTED, REJECTED)]
        assert apart._kept is not None
        child = apart._kept.current().child
        assert child.pid != os.getpid()
    assert [report.verdict for report in actual] == [Verdict.ACCEPTED, Verdict.REJECTED]
    assert child.exit_code() == -signal.SIGKILL


def test_a_check_that_takes_too_long_is_ended_and_the_next_one_begins_anew() -> None:
    options = check_options()
    with CheckApart(timeout_s=0.0) as apart:
        report = apart.check(ACCEPTED.encode(), "p.xml", options)
        assert report.verdict is Verdict.UNDECIDED
        assert report.findings[0].message == "the plan is undecided after 0 s (time limit)"
        assert apart._kept is not None
        assert apart._kept._worker is not None
        assert apart._kept._worker.child.exit_code() == -signal.SIGKILL
        apart._kept.timeout_s = 60.0
        assert apart.check(ACCEPTED.encode(), "p.xml", options).verdict is Verdict.ACCEPTED


def test_a_check_whose_process_is_killed_is_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    options = check_options()
    with CheckApart() as apart:
        apart.check(ACCEPTED.encode(), "p.xml", options)
        with monkeypatch.context() as patched:
            patched.setattr(Worker, "give", killed_with_it_in_hand)
            report: PlanReport = apart.check(ACCEPTED.encode(), "p.xml", options)
        assert report.verdict is Verdict.UNDECIDED
        assert "was ended by signal 9" in report.findings[0].message
        assert apart.check(ACCEPTED.encode(), "p.xml", options).verdict is Verdict.ACCEPTED


def test_options_that_make_no_sense_are_an_error_here_too() -> None:
    senseless = check_options(AnalysisOptions(solver="structural", faults=("hang",)))
    with CheckApart() as apart:
        for _ in range(2):
            with pytest.raises(UsageError, match="structural"):
                apart.check(ACCEPTED.encode(), "p.xml", senseless)
