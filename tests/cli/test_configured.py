"""Settings of a configuration file and the command line together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.cli import main
from gpsfsm.cli.check import COMMAND
from gpsfsm.settings import ModelTable, Settings
from tests.cli.support import ACCEPTED, REJECTED, run, write

DOCS = Path(__file__).parents[2] / "docs"
NOT_SETTINGS = {"paths", "config", "isolated", "no_baseline", "fix", "diff", "unsafe_fixes", "task"}


def configure(text: str, folder: Path = Path()) -> None:
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "gpsfsm.toml").write_text(text, encoding="utf-8")


def shown(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 0) -> str:
    assert main(arguments) == code
    return capsys.readouterr().out


def test_every_option_has_a_key_and_the_other_way_round() -> None:
    keys = set(Settings.model_fields) - {"model"}
    assert {option.name for option in COMMAND.params} - NOT_SETTINGS == keys


def test_the_documentation_names_every_key_and_option() -> None:
    configuration = (DOCS / "configuration.md").read_text(encoding="utf-8")
    options = (DOCS / "cli.md").read_text(encoding="utf-8")
    for name in (*Settings.model_fields, *ModelTable.model_fields):
        assert f"`{name.replace('_', '-')}`" in configuration
    for option in COMMAND.params:
        if option.param_type_name == "option":
            # of a switch that is on the way to turn it off is told
            names = option.secondary_opts if option.default is True else option.opts
            assert f"`{max(names, key=len)}" in options


def test_a_file_sets_what_the_command_line_does_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED)
    configure('format = "json"\nassume = ["WaypointRunner never fails"]\nmax-scenarios = 0\n')
    (plan,) = json.loads(shown(["check", "a.xml"], capsys))["plans"]
    assert plan["facts"]["gives_up"] == "never"
    other = shown(["check", "a.xml", "--assume", "WaypointRunner always fails"], capsys, code=1)
    assert json.loads(other)["plans"][0]["facts"]["gives_up"] == "always"
    assert shown(["check", "a.xml", "--format", "text"], capsys).startswith("a.xml: accepted")
    assert shown(["check", "a.xml", "--isolated"], capsys).startswith("a.xml:2:3: warning GP302")


@pytest.mark.parametrize(
    ("setting", "code", "option", "code_with_option"),
    [
        ('fail-on = "warning"', 1, ["--fail-on", "error"], 0),
        ('select = ["GP9"]\nfail-on = "warning"', 0, ["--select", "GP3"], 1),
        ('ignore = ["GP302"]\nfail-on = "warning"', 0, ["--ignore", "GP301"], 1),
        ('faults = ["hang"]', 1, ["--faults", "failed"], 0),
        ("max-bytes = 3", 2, ["--max-bytes", "3000"], 0),
    ],
)
def test_the_command_line_wins(
    setting: str, code: int, option: list[str], code_with_option: int, tmp_path: Path
) -> None:
    write(tmp_path, a=ACCEPTED)
    configure(setting)
    assert main(["check", "a.xml"]) == code
    assert main(["check", "a.xml", *option]) == code_with_option


@pytest.mark.parametrize("key", ["quiet", "statistics", "consistent", "from-response"])
def test_switches_can_be_turned_off_again(
    key: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrapped = f"Here it is:\n{ACCEPTED}"
    write(tmp_path, a=wrapped if key == "from-response" else ACCEPTED)
    plain = shown(["check", "a.xml", "--fail-on", "never"], capsys)
    configure(f"{key} = true")
    off = shown(["check", "a.xml", "--fail-on", "never", f"--no-{key}"], capsys)
    assert off == plain
    if key != "consistent":
        assert shown(["check", "a.xml", "--fail-on", "never"], capsys) != plain


def test_paths_in_a_file_are_relative_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=REJECTED)
    write(tmp_path / "deep" / "er", a=REJECTED)
    monkeypatch.chdir(tmp_path / "deep" / "er")
    (tmp_path / "known.json").write_text(
        shown(["check", "a.xml", "--format", "json"], capsys, 1), encoding="utf-8"
    )
    configure('baseline = "known.json"\noutput-file = "report.txt"', tmp_path)
    assert shown(["check", "a.xml"], capsys) == ""
    assert "suppressed" in (tmp_path / "report.txt").read_text(encoding="utf-8")
    assert main(["check", "a.xml", "--no-baseline", "--output-file", "-"]) == 1
    assert "GP307" in capsys.readouterr().out


def test_a_chosen_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED)
    configure('fail-on = "never"')
    (tmp_path / "strict.toml").write_text('fail-on = "warning"', encoding="utf-8")
    assert main(["check", "a.xml"]) == 0
    assert main(["check", "a.xml", "--config", "strict.toml"]) == 1
    assert main(["check", "a.xml", "--config", "missing.toml"]) == 2
    assert "missing.toml: cannot be read: No such file" in capsys.readouterr().err


def test_a_wrong_file_is_a_message(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    configure('fail_on = "error"')
    done = run("check", "a.xml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr.endswith(b"there is no key 'fail_on'; did you mean 'fail-on'?\n")
    assert run("check", "a.xml", "--isolated", cwd=tmp_path).returncode == 0
    assert run("rule", "GP302", cwd=tmp_path).returncode == 0


def test_show_takes_the_limits_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED)
    configure('format = "json"\noutput-file = "x"')
    assert "plan\n" in shown(["show", "a.xml"], capsys)
    configure("max-elements = 1")
    assert main(["show", "a.xml"]) == 2
    assert main(["show", "a.xml", "--max-elements", "5"]) == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('solver = "magic"', "'solver' must be 'auto', 'z3' or 'structural', not 'magic'"),
        ('format = "xlsx"', "'format': there is no format 'xlsx'; the formats are: text,"),
        ('select = ["GP302", "GP0"]', "'select': no rule matches 'GP0'"),
        ('assume = ["never"]', "'assume': "),
    ],
)
def test_values_are_explained(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[Any]
) -> None:
    write(tmp_path, a=ACCEPTED)
    configure(text)
    assert main(["check", "a.xml"]) == 2
    error = capsys.readouterr().err
    assert str(tmp_path / "gpsfsm.toml") in error
    assert words in error
