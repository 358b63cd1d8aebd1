"""Help: its sections, its length, all options below headings, one ``--output``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click
import pytest

from gpsfsm.cli import group, main
from gpsfsm.cli._help import DOCUMENTATION, OLD_OUTPUT, Command, Section
from tests.cli.support import ACCEPTED, write

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MOST_LINES = 40


def contexts(context: click.Context) -> Iterator[click.Context]:
    """The contexts of a command and of all that it has."""
    yield context
    command = context.command
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below is not None
            yield from contexts(click.Context(below, parent=context, info_name=name))


ALL = {
    each.command_path: each
    for each in contexts(click.Context(group, info_name="gpsfsm", **group.context_settings))
}


def text_of(path: str, option: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main([*path.split()[1:], option]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("columns", ["80", "100"])
@pytest.mark.parametrize("path", ALL)
def test_help_is_short_and_says_where_there_is_more(
    path: str, columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    lines = text_of(path, "--help", capsys).splitlines()
    assert len(lines) < MOST_LINES
    assert max(map(len, lines)) <= int(columns)
    assert lines[-1].strip() == f"Documentation: {DOCUMENTATION}"
    assert "--help-all" in lines[-2]


@pytest.mark.parametrize("path", [path for path in ALL if path != "gpsfsm"])
def test_help_all_shows_every_option(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    everything = text_of(path, "--help-all", capsys)
    short = text_of(path, "--help", capsys)
    options = [each for each in ALL[path].command.params if isinstance(each, click.Option)]
    shown = [each for each in options if not each.hidden]
    assert all(
        re.search(rf"(?m)^  .*{each.opts[-1]}\b", everything)
        for each in shown
        if each.opts[-1] != OLD_OUTPUT
    )
    assert OLD_OUTPUT not in everything
    assert len(short) <= len(everything)
    assert "=" not in "".join(re.findall(r"\[[^]]*[<>][^]]*\]", short))


@pytest.mark.parametrize(
    "path", [path for path, each in ALL.items() if not isinstance(each.command, click.Group)]
)
def test_help_states_the_exit_codes(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert text_of(path, "--help", capsys).count("  Exit code: ") == 1


def test_help_shows_defaults_without_bounds(capsys: pytest.CaptureFixture[str]) -> None:
    assert "[default: 8321]" in text_of("gpsfsm serve", "--help", capsys)
    assert "[default: 8321; 0<=x<=65535]" in text_of("gpsfsm serve", "--help-all", capsys)


def test_help_all_without_a_command_is_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert text_of("gpsfsm", "--help-all", capsys) == text_of("gpsfsm", "--help", capsys)


@pytest.mark.parametrize("words", [["completion"], ["grammar"], ["port", "plan.xml"]])
def test_choices_stand_in_the_line_that_asks_for_one(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert re.search(r"Missing .*Choose from: \S+, \S+, \S+", capsys.readouterr().err)


def test_a_command_has_the_same_help_without_its_group() -> None:
    """click keeps the option for help that it makes in the first context, whichever that is."""

    @click.command(cls=Command)
    def command() -> None:
        """Nothing."""

    option = command.get_help_option(click.Context(command))
    assert option is not None
    assert option.opts == ["-h", "--help"]


def test_every_command_stands_in_one_section(capsys: pytest.CaptureFixture[str]) -> None:
    shown = text_of("gpsfsm", "--help", capsys)
    titles = [section.value for section in Section]
    assert [line[:-1] for line in shown.splitlines() if line[:-1] in titles] == titles
    for path in ALL:
        if path.count(" ") == 1:
            assert len(re.findall(rf"(?m)^  {path.split()[1]} ", shown)) == 1


@pytest.mark.parametrize("path", ALL)
def test_output_files_are_named_alike(path: str) -> None:
    """What writes a file takes -o, --output and, hidden, the old name."""
    outputs = [each for each in ALL[path].command.params if "--output" in each.opts]
    for each in ALL[path].command.params:
        assert OLD_OUTPUT not in each.opts or each in outputs
    for each in outputs:
        assert "-o" in each.opts
        assert OLD_OUTPUT in each.opts or path == "gpsfsm capabilities pull"


@pytest.mark.parametrize("option", ["-o", "--output", OLD_OUTPUT])
def test_all_names_of_the_output_work(option: str, tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    plan = tmp_path / "a.xml"
    for name, words in {
        "check": [str(plan)],
        "show": [str(plan)],
        "convert": [str(plan), "--to", "tree"],
        "grammar": ["--format", "gbnf"],
    }.items():
        file = tmp_path / f"{name}.out"
        assert main([name, *words, option, str(file)]) == 0
        assert file.stat().st_size > 0
