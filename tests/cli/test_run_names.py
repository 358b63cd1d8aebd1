"""Names that do not belong together, or that no file describes: gate, run, task and grade."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import write

if TYPE_CHECKING:
    from pathlib import Path

DRIVE = "nav2_capabilities/WaypointRunner"
SPEAK = "perception_capabilities/SpeechRunner"
PROCESS = "generic_capabilities/ProcessRunner"
WAIT = "generic_capabilities/WaitRunner"


def step(interface: str, provider: str, rest: str = 'x="1.0" y="2.0"') -> str:
    return f'<Runner interface="{interface}" provider="{provider}" {rest}/>'


def at_once(*steps: str) -> str:
    return f'<Plan><Control type="parallel_all" name="both">{"".join(steps)}</Control></Plan>'


def complaint(*arguments: str, capsys: pytest.CaptureFixture[str], code: int) -> str:
    exit_code = main([*arguments])
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return out + err


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    "interface",
    ["a/Say", DRIVE.replace("ner", "nr"), f"{DRIVE} ", DRIVE.replace("a", "\u0430")],
)
def test_two_drives_that_call_themselves_something_else(
    interface: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=at_once(step(interface, DRIVE), step(interface, DRIVE, 'x="3.0" y="4.0"')))
    for command in (("gate",), ("run",), ("run", "--real")):
        actual = complaint(*command, "a.xml", capsys=capsys, code=1)
        assert "GP212" in actual or "GP201" in actual
    write(tmp_path, b=at_once(step(DRIVE, DRIVE), step(DRIVE, DRIVE, 'x="3.0" y="4.0"')))
    assert "GP501" in complaint("gate", "b.xml", capsys=capsys, code=1)


def test_a_program_that_calls_itself_speech(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mark = tmp_path / "mark"
    program = step("nosuch/Speak", PROCESS, f'command="touch {mark}"')
    write(tmp_path, a=f"<Plan>{program}</Plan>")
    how = ("a.xml", "--real", "--allow-program", "touch")
    assert "GP212" in complaint("run", *how, capsys=capsys, code=1)
    actual = complaint("run", *how, "--force", capsys=capsys, code=2)
    assert f"{PROCESS} implements {PROCESS}, not nosuch/Speak" in actual
    assert not mark.exists()


TASK = """\
steps:
  - do: {interface: LogRunner}
allow:
  - {interface: SpeechRunner}
"""
LOG = step("generic_capabilities/LogRunner", "generic_capabilities/LogRunner", 'text="here"')


def test_a_drive_that_calls_itself_speech_is_not_what_a_task_allows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "task.yaml").write_text(TASK)
    honest = step(SPEAK, SPEAK, 'text="hello"')
    write(tmp_path, a=f"<Plan>{honest}{LOG}</Plan>")
    write(tmp_path, b=f"<Plan>{step('x/SpeechRunner', DRIVE)}{LOG}</Plan>")
    write(tmp_path, c=f"<Plan>{step(SPEAK, DRIVE)}{LOG}</Plan>")
    complaint("gate", "a.xml", "--task", "task.yaml", capsys=capsys, code=0)
    actual = complaint(
        "grade", "--task", "task.yaml", "a.xml", "b.xml", "c.xml", capsys=capsys, code=0
    )
    assert [line.split()[:2] for line in actual.splitlines() if ".xml" in line] == [
        ["success", "a.xml"],
        ["partial", "b.xml"],  # it reads as a plan
        ["partial", "c.xml"],
    ]
    for name in ("b.xml", "c.xml"):
        complaint("gate", name, "--task", "task.yaml", capsys=capsys, code=1)
        complaint("check", name, "--task", "task.yaml", capsys=capsys, code=1)


@pytest.mark.parametrize("name", ["capabilities2_runner_nav2/WaypointRunner", "home/Kitchen"])
def test_what_is_forbidden_is_forbidden_under_every_name(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "task.yaml").write_text(
        f"actions:\n  drive: {{interface: {DRIVE}}}\nrules:\n  - absence: drive\n"
    )
    folder = tmp_path / "home" / "semantic_interfaces"
    folder.mkdir(parents=True)
    (folder / "Kitchen.yaml").write_text(
        f"name: Kitchen\nspec_type: semantic_interface\nredefines: {DRIVE}\n"
    )
    write(tmp_path, a=f"<Plan>{step(name, name)}</Plan>")
    how = ("--task", "task.yaml", "--capabilities", "home", "a.xml")
    assert "GP608" in complaint("check", *how, capsys=capsys, code=1)


def test_what_no_file_describes_is_simulated_and_not_run_for_real(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lines that are told to write are enough, but for the runner itself."""
    names = [("lift_bot/Lift", "lift_bot/Motor"), (WAIT, "lift_bot/Wait")]
    steps = [step(*pair, 'name="n"') for pair in names]
    write(tmp_path, a=f"<Plan>{''.join(steps)}</Plan>")
    complaint("gate", "a.xml", capsys=capsys, code=0)
    complaint("run", "a.xml", "--failure", "0", capsys=capsys, code=0)
    actual = complaint("run", "a.xml", "--real", "--journal", "run.db", capsys=capsys, code=2)
    assert not (tmp_path / "run.db").exists()
    assert "no capability file describes lift_bot/Lift and lift_bot/Motor, so nothing" in actual
    assert pasted(actual, tmp_path / "files") == 3
    capsys.readouterr()
    complaint("capabilities", "check", "files", capsys=capsys, code=0)
    how = ("a.xml", "--capabilities", "files")
    assert "GP210" not in complaint("check", *how, capsys=capsys, code=0)
    actual = complaint("run", *how, "--real", capsys=capsys, code=2)
    assert "no runner is installed for lift_bot/Motor" in actual
    assert "no capability file describes" not in actual


WAITING = 'seconds="0.01"'


def test_a_file_without_a_definition_is_completed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for kind, more in (
        ("interface", ""),
        ("provider", "implements: lift_bot/Lift\nrunner: gpsfsm.runners.generic:WaitRunner\n"),
    ):
        file = tmp_path / "files" / "lift_bot" / f"{kind}s" / "Lift.yaml"
        file.parent.mkdir(parents=True)
        file.write_text(f"name: lift_bot/Lift\nspec_type: {kind}\n{more}")
    write(tmp_path, a=f"<Plan>{step('lift_bot/Lift', 'lift_bot/Lift', WAITING)}</Plan>")
    how = ("run", "a.xml", "--real", "--capabilities", "files")
    actual = complaint(*how, capsys=capsys, code=2)
    assert "the file of lift_bot/Lift does not say what it takes and gives (definition)" in actual
    assert "  add to files/lift_bot/providers/Lift.yaml:\n    definition:\n" in actual
    with file.open("a") as opened:
        opened.write("definition:\n  configuration_parameters: [{name: seconds, type: double}]\n")
    complaint(*how, capsys=capsys, code=0)


def pasted(text: str, folder: Path) -> int:
    """Write the files that a message tells to write; how many they are."""
    files: dict[Path, list[str]] = {}
    for line in text.splitlines():
        if line.startswith("    "):
            [*files.values()][-1].append(line[4:])
        elif line.startswith("  ") and line.endswith(".yaml:"):
            files[folder / line.strip()[:-1]] = []
    for path, lines in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n")
    return len(files)


def test_nothing_is_done_by_a_plan_without_a_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As the gate says."""
    write(tmp_path, a="<Plan/>")
    assert "empty" in complaint("gate", "a.xml", capsys=capsys, code=1)
    actual = complaint("run", "a.xml", capsys=capsys, code=1)
    assert "a.xml: the plan has no step that does anything, so it is not run; --force" in actual
    assert "forced although" in complaint("run", "a.xml", "--force", capsys=capsys, code=0)
