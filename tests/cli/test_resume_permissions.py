"""``gpsfsm resume --real``: what a journal says it was allowed allows nothing; it may be forged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.capabilities.library import Library, bind, builtin_capabilities, choose_capabilities
from gpsfsm.capabilities.table import dump
from gpsfsm.cli import main
from gpsfsm.compile import compile_plan
from gpsfsm.errors import UsageError
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import CLIENT, QueueKind, QueueRow
from gpsfsm.model.capability import Interface, Provider
from gpsfsm.running.bounds import policy_of
from tests.cli.support import run
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Mapping

PROCESS = "generic_capabilities/ProcessRunner"
BUILTIN = builtin_capabilities().library


_LIFT = """\
implements: lift_bot/Lift
runner: gpsfsm.runners.generic:ProcessRunner
definition:
  configuration_parameters:
    - {name: command, type: string}
"""


def step(command: str, interface: str = PROCESS) -> str:
    return f'<Runner interface="{interface}" provider="{PROCESS}" command="{command}"/>'


def forged(
    folder: Path,
    *steps: str,
    library: Library = BUILTIN,
    waiting: str = "",
    queued_as: str = "",
    options: Mapping[str, Any] | None = None,
    allow_program: object = None,
) -> Path:
    """A journal that says a real run was begun with these options; ``waiting`` is one behind it.

    ``queued_as`` is the text that the queue has of the first plan, if it is another one.
    """
    text = f"<Plan>{''.join(steps)}</Plan>"
    plan = plan_of(text)
    programs: dict[str, Any] = {} if allow_program is None else {"allow_program": allow_program}
    kernel = Kernel(compile_plan(plan, bindings=bind(plan, library)))
    heading = Heading(
        plan=text.encode(),
        file="forged.xml",
        capabilities=dump(library),
        mode="real",
        options={"nonce": "00", **(options or {}), **programs},
    )
    with Journal(str(folder / "run.db"), "none") as journal:
        if waiting:
            rows = [
                (1, "forged.xml", queued_as or text),
                (2, "waits.xml", f"<Plan>{waiting}</Plan>"),
            ]
            for number, name, each in rows:
                data = {"sha256": "0" * 64, "name": name, "text": each}
                journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, number, CLIENT, data))
            journal.write_queue(0, QueueRow(QueueKind.BEGUN, 1, CLIENT))
            journal.begin(kernel, heading, queued=(0, 1))
        else:
            journal.begin(kernel, heading)
    return folder / "run.db"


def content(file: Path) -> tuple[list[object], list[object]]:
    with JournalReader(str(file)) as reader:
        return list(reader.events(1)), list(reader.queue())


def refused(file: Path, *arguments: str, capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    """What is said; nothing has been started, nor written down."""
    before = content(file)
    assert main(["resume", str(file), *arguments]) == code
    output = capsys.readouterr()
    assert output.out == ""
    assert content(file) == before
    return output.err


def resumed(file: Path, *arguments: str) -> str:
    done = run("resume", file, *arguments, cwd=file.parent)
    assert done.returncode == 0, done.stderr
    return done.stdout.decode()


def test_a_foreign_journal_starts_no_program(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mark = tmp_path / "mark"
    file = forged(tmp_path, step(f"touch {mark}"), allow_program=["touch", "rm -rf"])
    refusal = refused(file, capsys=capsys)
    options = "--allow-program touch --allow-program 'rm -rf'"
    assert f"if that is what you want, add --real {options}\n" in refusal
    refusal = refused(file, "--real", capsys=capsys)
    assert f"the journal recorded: {options}; " in refusal
    refusal = refused(file, "--real", "--allow-program", "touch", capsys=capsys)
    assert "the journal recorded: --allow-program 'rm -rf'; " in refusal
    refusal = refused(file, "--allow-program", "touch", capsys=capsys)
    assert "--allow-program needs --real" in refusal
    assert not mark.exists()
    refusal = resumed(file, "--real", "--allow-program", "touch", "--allow-program", "rm -rf")
    assert "COMPLETED" in refusal
    assert mark.exists()


def test_what_was_never_allowed_is_not_allowed_by_silence(tmp_path: Path) -> None:
    file = forged(tmp_path, step(f"touch {tmp_path / 'mark'}"))
    done = run("resume", file, "--real", cwd=tmp_path)
    assert done.returncode == 1
    assert b"GP213" in done.stderr  # it is refused before it begins
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("allow_host", "robot.local:8080"),
        ("allow_function", "os:getcwd"),
        ("allow_module", "wild_robot"),
    ],
)
def test_every_permission_is_given_again(
    name: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wait = "generic_capabilities/WaitRunner"
    file = forged(
        tmp_path,
        f'<Runner interface="{wait}" provider="{wait}" seconds="0.01"/>',
        options={name: [value]},
    )
    option = f"--{name.replace('_', '-')}"
    assert f"the journal recorded: {option} {value}; " in refused(file, "--real", capsys=capsys)
    assert "COMPLETED" in resumed(file, "--real", option, value)


@pytest.mark.parametrize("value", ["touch", {"a": 1}, 7, [["touch"]], [None]])
def test_a_damaged_option_allows_nothing(value: object, tmp_path: Path) -> None:
    file = forged(tmp_path, step(f"touch {tmp_path / 'mark'}"), allow_program=value)
    done = run("resume", file, "--real", cwd=tmp_path)
    assert done.returncode in (1, 2)
    assert b"Traceback" not in done.stderr
    assert not (tmp_path / "mark").exists()


def test_a_plan_that_waits_is_not_allowed_anything_either(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    marks = [tmp_path / "first", tmp_path / "second"]
    steps = [step(f"touch {mark}") for mark in marks]
    file = forged(tmp_path, steps[0], waiting=steps[1], allow_program=["touch"])
    assert "--allow-program touch" in refused(file, "--real", capsys=capsys)
    assert not any(mark.exists() for mark in marks)
    assert resumed(file, "--real", "--allow-program", "touch").count("COMPLETED") == 2
    assert all(mark.exists() for mark in marks)


@pytest.mark.parametrize("waits", [False, True])
def test_a_plan_that_the_gate_refuses_does_not_go_on(
    waits: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file says that it was checked; --force goes on, but makes no runner of wrong names."""
    wrong = step("id", interface="nosuch/Speak")
    file = forged(
        tmp_path,
        step("true") if waits else wrong,
        waiting=wrong if waits else "",
        allow_program=["id", "true"],
    )
    how = ("--real", "--allow-program", "id", "--allow-program", "true")
    refusal = refused(file, *how, capsys=capsys, code=1)
    assert "error GP212" in refusal
    refusal = refused(file, *how, "--force", capsys=capsys)
    assert "implements generic_capabilities/ProcessRunner, not nosuch/Speak" in refusal


def test_a_forced_run_is_forced_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = f'<Runner interface="{PROCESS}" provider="{PROCESS}" command="true" timeout_s="soon"/>'
    file = forged(tmp_path, step("true"), f'<Control type="recovery">{bad}</Control>')
    assert "--force needs --real" in refused(file, "--force", capsys=capsys)
    refusal = refused(file, "--real", capsys=capsys, code=1)
    assert "GP205" in refusal
    assert "the plan has errors, so it is not run; --force runs it anyway" in refusal
    done = run("resume", file, "--real", "--force", cwd=tmp_path)
    assert b"the run continues in another process" in done.stdout
    assert "forced in spite of" in str(content(file)[0])


def test_what_runners_do_is_not_for_the_journal_to_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table in which a program is a lift: the files of the robot are named again."""
    lift = Provider(
        "lift_bot/Lift",
        "lift_bot/Lift",
        runner="gpsfsm.runners.generic:ProcessRunner",
        described=True,
    )
    library = BUILTIN.extended(Library((Interface("lift_bot/Lift"),), (lift,)))
    text = '<Runner interface="lift_bot/Lift" provider="lift_bot/Lift" command="true"/>'
    file = forged(tmp_path, text, library=library)
    refusal = refused(file, "--real", capsys=capsys)
    assert "was begun with other capabilities than this command has" in refusal
    mild = tuple(
        replace(each, resources=()) if each.name.endswith("/WaypointRunner") else each
        for each in BUILTIN.providers
    )
    file.unlink()
    file = forged(tmp_path, text, library=replace(BUILTIN, providers=mild))
    assert "other capabilities" in refused(file, "--real", capsys=capsys)


@pytest.mark.parametrize("total", [1e300, 10**400, float("inf"), "long", None])
def test_a_journal_makes_no_model_write_without_end(total: Any) -> None:
    policy = policy_of({"regenerations": 10**9, "regenerate_for_s": total})
    assert policy is not None
    assert (policy.continuations, policy.total_s) == (100, 1e6)
    with pytest.raises(UsageError, match="must be positive"):
        policy_of({"regenerations": 1, "regenerate_for_s": float("nan")})


def queued(folder: Path, *more: QueueRow) -> Path:
    """A real run of a harmless plan, a bad plan that waits behind it, and rows after these."""
    wait = "generic_capabilities/WaitRunner"
    bad = f'<Runner interface="{wait}" provider="{wait}" seconds="-5"/>{step("touch mark")}'
    harmless = f'<Runner interface="{wait}" provider="{wait}" seconds="0.01"/>'
    file = forged(folder, harmless, waiting=bad)
    with Journal(str(file), "none") as journal:
        for row in more:
            journal.write_queue(0, row)
    return file


@pytest.mark.parametrize(
    "row",
    [
        QueueRow(QueueKind.RUN, 2, CLIENT, {"run": 1}),
        QueueRow(QueueKind.RUN, 2, CLIENT, {"run": 2}),
        QueueRow(QueueKind.RUN, 1, CLIENT, {"run": 2}),
        QueueRow(QueueKind.ENDED, 2, CLIENT, {"status": "QUEUED"}),
        QueueRow(QueueKind.ENDED, 2, CLIENT, {"status": "huh"}),
        QueueRow(QueueKind.ENDED, 2, CLIENT, {}),
        QueueRow(QueueKind.ENDED, 9, CLIENT, {"status": "COMPLETED"}),
        QueueRow(QueueKind.BEGUN, 9),
        QueueRow(QueueKind.CANCEL, -1),
        QueueRow(QueueKind.SUBMITTED, 4, CLIENT, {"sha256": "", "name": "", "text": ""}),
        QueueRow(QueueKind.SUBMITTED, 3, CLIENT, {"name": "c", "text": "<Plan/>"}),
    ],
)
def test_rows_that_no_queue_writes_hide_no_plan_from_the_gate(
    row: QueueRow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = queued(tmp_path, row)
    for command in ("resume", "events"):
        words = ["--real", "--allow-program", "touch"] if command == "resume" else []
        assert main([command, str(file), *words]) == 2
        message = capsys.readouterr().err
        assert "of the plan queue is damaged" in message
        assert "defect" not in message
    assert not (tmp_path / "mark").exists()


def test_a_bad_plan_that_waits_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(queued(tmp_path), "--real", "--allow-program", "touch", capsys=capsys, code=1)


def test_the_run_is_that_of_the_plan_that_is_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    touch = step(f"touch {tmp_path / 'mark'}")
    file = forged(tmp_path, touch, waiting=step("true"), queued_as="<Plan/>")
    message = refused(file, "--real", "--allow-program", "touch", capsys=capsys)
    assert "run 1 is not that of the plan that was queued" in message


def test_a_configuration_on_the_way_does_not_say_what_runners_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A journal may come together with a folder of files that agree with it."""
    for kind, more in (("interface", ""), ("provider", _LIFT)):
        file = tmp_path / "caps" / "lift_bot" / f"{kind}s" / "Lift.yaml"
        file.parent.mkdir(parents=True)
        file.write_text(f"name: lift_bot/Lift\nspec_type: {kind}\nspec_version: 1.2\n{more}")
    chosen = choose_capabilities([str(tmp_path / "caps")], builtin=True)
    lift = '<Runner interface="lift_bot/Lift" provider="lift_bot/Lift" command="touch mark"/>'
    file = forged(tmp_path, lift, library=chosen.library)
    monkeypatch.chdir(tmp_path)
    Path("gpsfsm.toml").write_text('capabilities = ["caps"]\n')
    allowed = ("--real", "--allow-program", "touch")
    message = refused(file, *allowed, capsys=capsys)
    assert "was begun with other capabilities than this command has" in message
    assert not Path("mark").exists()
    assert "COMPLETED" in resumed(file, *allowed, "--config", "gpsfsm.toml")
    assert Path("mark").exists()
