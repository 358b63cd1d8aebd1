"""Each option of a check changes the outcome of each command that takes it, or is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest

from gpsfsm.analysis.rules import rule
from gpsfsm.checking.option_table import BY_NAME, NO_EFFECT, OPTIONS, Group
from gpsfsm.cli import group, main
from tests.cli.support import ACCEPTED, REJECTED, run, runner

TASK = str(Path(__file__).parents[2] / "docs/examples/rounds.yaml")
EXCUSED = f"<Plan>\n  <!-- gpsfsm: ignore GP307 because of a test -->\n{REJECTED[7:]}"
DEEP = f'<Plan><Control type="sequential">{runner()}{runner(x="3")}</Control></Plan>\n'
TWICE = f'<Plan>{runner()}<Control type="recovery">{runner()}</Control></Plan>\n'
ANSWER = f"Here you are:\n```xml\n{ACCEPTED}```\n"
UNKNOWN = '<Plan>\n  <Runner interface="demo/GoRunner" provider="demo/GoRunner"/>\n</Plan>\n'
ROBOT = """\
name: speaker
runners: [perception_capabilities/SpeechRunner]
"""
LIBRARY = """\
interface: demo/GoRunner
providers:
  - name: demo/GoRunner
    parameters: {where: {type: text, required: true}}
"""

LIMITS: dict[str, tuple[str, list[str], list[str]]] = {
    "max_bytes": (DEEP, [], ["--max-bytes", "20"]),
    "max_depth": (DEEP, [], ["--max-depth", "2"]),
    "max_elements": (DEEP, [], ["--max-elements", "2"]),
    "max_attributes": (DEEP, [], ["--max-attributes", "1"]),
    "max_attribute_length": (DEEP, [], ["--max-attribute-length", "5"]),
}
CASES: dict[str, tuple[str, list[str], list[str]]] = {
    # option: a plan, what both have, what one has
    "select": (ACCEPTED, [], ["--select", "GP1"]),
    "ignore": (ACCEPTED, [], ["--ignore", "GP302"]),
    "fail_on": (rule("GP309").bad, ["--consistent"], ["--fail-on", "warning"]),
    "allow_suppressions": (EXCUSED, [], ["--allow-suppressions"]),
    "assume": (ACCEPTED, [], ["--assume", "never fails: WaypointRunner"]),
    "consistent": (TWICE, [], ["--consistent"]),
    "faults": (rule("GP306").bad, [], ["--faults", "hang"]),
    "from_response": (ANSWER, [], ["--from-response"]),
    "capabilities": (UNKNOWN, [], ["--capabilities", "demo"]),
    "builtin_capabilities": (ACCEPTED, [], ["--no-builtin-capabilities"]),
    "robot": (ACCEPTED, [], ["--robot", "robot.yaml"]),
    "deadline": (rule("GP502").bad, [], ["--deadline", "60"]),
    "energy_limit": (rule("GP503").bad, [], ["--energy-limit", "100"]),
    "tolerate": (ACCEPTED, [], ["--tolerate", "1"]),
    "solver": (rule("GP904").bad, ["--consistent", "--rlimit", "1"], ["--solver", "structural"]),
    "rlimit": (rule("GP904").bad, ["--consistent"], ["--rlimit", "1"]),
    "total_rlimit": (rule("GP904").bad, ["--consistent"], ["--total-rlimit", "1"]),
    "max_scenarios": (ACCEPTED, [], ["--max-scenarios", "0"]),
    "require_proof": (ACCEPTED, ["--rlimit", "1"], ["--require-proof"]),
    "engine": (rule("GP705").bad, [], ["--engine", "fabric-v2"]),
    **LIMITS,
}


def going(x: str, y: str) -> str:
    return runner(x=x, y=y)


ENTRANCE, LAB, OFFICE = going("4.0", "1.0"), going("6.5", "3.0"), going("0.5", "3.0")
STORE = f'<Control type="recovery">{going("6.5", "5.0")}</Control>'
ROUNDS = f"<Plan>\n{ENTRANCE}\n{LAB}\n{STORE}\n{OFFICE}\n</Plan>\n"
"""Does what the task asks for."""
BRITTLE = ROUNDS.replace(STORE, "")
AGAIN = f"<Plan>\n{ENTRANCE}\n{ENTRANCE}\n{LAB}\n</Plan>\n"
CERTAIN = ["--assume", "line 2 succeeds and line 3 fails"]
"""Which no two equal actions do."""
SPEECH = "perception_capabilities/SpeechRunner"
SPEAKING = BRITTLE.replace(
    LAB,
    f'<Control type="parallel_all">{LAB}<Runner interface="{SPEECH}" provider="{SPEECH}"'
    ' text="Hi."/></Control>',
)
TYPED = f"<Plan>\n{going('4', '1')}\n</Plan>\n"
"""Integers, where the runner takes doubles."""
OWN: dict[tuple[str, str], tuple[str, list[str], list[str]]] = {
    ("grade", "assume"): (BRITTLE, [], ["--assume", "never fails: WaypointRunner"]),
    ("grade", "consistent"): (AGAIN, CERTAIN, ["--consistent"]),
    ("grade", "faults"): (SPEAKING, [], ["--faults", "no-start"]),
    ("grade", "builtin_capabilities"): (
        ROUNDS.replace('provider="nav2_capabilities/WaypointRunner"', f'provider="{SPEECH}"', 1),
        *([], ["--no-builtin-capabilities"]),
    ),
    ("grade", "rlimit"): (ROUNDS, ["--consistent", "--solver", "z3"], ["--rlimit", "1"]),
    ("grade", "solver"): (ROUNDS, ["--consistent", "--rlimit", "1"], ["--solver", "z3"]),
    ("fuzz", "assume"): (
        BRITTLE,
        ["--task", TASK],
        ["--assume", "never fails: WaypointRunner"],
    ),
    ("fuzz", "consistent"): (AGAIN, CERTAIN, ["--consistent"]),
    ("fuzz", "faults"): (BRITTLE, ["--task", TASK], ["--faults", "late"]),
    ("fuzz", "builtin_capabilities"): (
        f'<Plan><Control type="parallel_all">{ENTRANCE}{LAB}</Control></Plan>',
        *([], ["--no-builtin-capabilities"]),
    ),
    ("fix", "engine"): (TYPED, [], ["--engine", "fabric-v2"]),
    ("grade", "robot"): (ROUNDS, [], ["--robot", "robot.yaml"]),
    ("fuzz", "robot"): (
        f'<Plan><Control type="parallel_all">{ENTRANCE}{LAB}</Control></Plan>',
        *([], ["--robot", "robot.yaml"]),
    ),
    ("show", "engine"): (rule("GP705").bad, ["--format", "dot"], ["--engine", "fabric-v2"]),
    ("fuzz", "select"): (ACCEPTED, ["--mutate"], ["--select", "GP1"]),
    ("fuzz", "ignore"): (ACCEPTED, ["--mutate"], ["--ignore", "ALL"]),
    ("gate", "ignore"): (
        rule("GP309").bad,
        ["--fail-on", "warning", "--consistent"],
        ["--ignore", "GP309"],
    ),
}
"""Where a command needs another input to show it."""

COMMON: dict[str, list[str]] = {
    "check": [],
    "convert": ["--to", "tree"],
    "fix": ["--diff"],
    "gate": ["--format", "json"],
    "grade": ["--task", TASK],
    "view": ["-o", "page.html", "--force"],
    "diff": ["other.xml"],
    "fuzz": ["--runs", "40"],
    "show": [],
    "port": ["--to", "fabric-v2"],
}


def cases() -> list[Any]:
    """Each command with each option of the table that it takes."""
    context, pairs = click.Context(group), []
    for name in COMMON:
        command = group.get_command(context, name)
        assert command is not None
        for each in command.params:
            option = BY_NAME.get(str(each.name))
            if option is None or option.group is Group.OUTPUT or option.flag not in each.opts:
                continue
            pairs.append(pytest.param(name, option.name, id=f"{name}-{option.name}"))
    return pairs


def outcome(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[Any, ...]:
    """All that somebody sees of a command."""
    page = Path("page.html")
    page.unlink(missing_ok=True)
    if words[0] == "gate":  # its process is forked there, and else loads everything each time
        done = run(*words, cwd=Path.cwd())
        return done.returncode, done.stdout.decode(), done.stderr.decode(), b""
    code = main(words)
    output = capsys.readouterr()
    return code, output.out, output.err, page.read_bytes() if page.exists() else b""


@pytest.mark.parametrize(("command", "option"), cases())
def test_an_option_changes_the_outcome_or_is_refused(
    command: str,
    option: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    plan, both, one = OWN.get((command, option)) or CASES[option]
    Path("plan.xml").write_text(plan)
    Path("other.xml").write_text(plan if option == "assume" else TWICE)
    Path("demo").mkdir()
    Path("demo/go.yaml").write_text(LIBRARY)
    Path("robot.yaml").write_text(ROBOT)
    words = [command, "plan.xml", *COMMON[command], *both]
    without, with_option = outcome(words, capsys), outcome([*words, *one], capsys)
    if option in NO_EFFECT.get(command, {}):
        assert with_option[0] == 2
        assert f"{BY_NAME[option].flag} has no effect on {command}: " in with_option[2]
    else:
        assert "No such option" not in with_option[2]
        assert without != with_option


def test_the_commands_are_those_that_take_such_options() -> None:
    context = click.Context(group)
    taking = set()
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        flags = {flag for each in command.params for flag in each.opts}
        if {option.flag for option in OPTIONS if option.group is Group.LIMIT} & flags:
            taking.add(name)
    assert taking == {*COMMON, "run"}  # what its options do is tested with runs
