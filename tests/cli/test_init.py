"""``gpsfsm init``: a profile that ``gpsfsm check`` uses at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from gpsfsm.capabilities.robot import area_of
from gpsfsm.cli import main
from gpsfsm.errors import UsageError
from tests.cli.support import ACCEPTED, REJECTED, runner

WAYPOINT = "nav2_capabilities/WaypointRunner"
INIT = ["init", "--yes", "--name", "lab: 1", "--runner", WAYPOINT, "--map", "-10", "10", "-5", "5"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_what_it_writes_is_used(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(INIT) == 0
    Path("a.xml").write_text(f"<Plan>\n{runner(x='1000000', y='1.0')}\n</Plan>\n")
    capsys.readouterr()
    assert main(["check", "a.xml"]) == 1
    printed = capsys.readouterr().out
    assert 'x="1000000" is not allowed: WaypointRunner accepts -10 to 10' in printed
    assert "note: decided with robot = " in printed


def test_it_replaces_nothing_unless_forced(capsys: pytest.CaptureFixture[str]) -> None:
    Path("gpsfsm.toml").write_text("quiet = true\n")
    assert main(INIT) == 2
    assert (
        "gpsfsm: gpsfsm.toml would be overwritten; use --force to do so\n"
        in capsys.readouterr().err
    )
    assert not Path("robot.yaml").exists()
    assert main([*INIT, "--force"]) == 0


def test_what_would_not_fit_is_not_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["init", "--yes", "--runner", WAYPOINT[:-1]]) == 2
    assert "did you mean" in capsys.readouterr().err
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("name", ["robot.yaml", "gpsfsm.toml"])
def test_a_link_out_of_the_folder_is_not_followed(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    outside = tmp_path_factory.mktemp("outside") / "file"
    outside.write_text("theirs")
    Path(name).symlink_to(outside)
    assert main([*INIT, "--force"]) == 2
    expected = f"gpsfsm: cannot write {name}: a link leads out of the folder ., to {outside}\n"
    assert capsys.readouterr().err == expected
    assert outside.read_text() == "theirs"
    assert [each.name for each in Path().iterdir()] == [name]


def test_a_link_within_the_folder_stays_one() -> None:
    Path("mine.yaml").write_text("name: old\n")
    Path("robot.yaml").symlink_to("mine.yaml")
    assert main([*INIT, "--force"]) == 0
    assert Path("robot.yaml").is_symlink()
    assert Path("mine.yaml").read_text().startswith('name: "lab: 1"')


def test_both_files_are_written_or_none(capsys: pytest.CaptureFixture[str]) -> None:
    Path("gpsfsm.toml").mkdir()
    assert main([*INIT, "--force"]) == 2
    assert capsys.readouterr().err == "gpsfsm: cannot write gpsfsm.toml: it is a folder\n"
    assert not Path("robot.yaml").exists()


def test_the_command_line_goes_over_the_file_over_the_profile(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("robot.yaml").write_text("name: lab\nengine: fabric-v2\n")
    Path("a.xml").write_text(ACCEPTED)

    def engine(toml: str, *words: str) -> list[bool]:
        Path("gpsfsm.toml").write_text(f'robot = "robot.yaml"\n{toml}')
        main(["check", "a.xml", *words])
        printed = capsys.readouterr().out
        return [f'engine = "{each}"' in printed for each in ("fabric-v1", "fabric-v2")]

    assert engine("") == [False, True]
    assert engine('engine = "fabric-v1"\n') == [True, False]
    assert engine('engine = "fabric-v1"\n', "--engine", "paper") == [False, False]


def test_a_mistake_in_a_profile_ends_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    Path("robot.yaml").write_text("name: lab\nrunner: []\n")
    Path("a.xml").write_text(REJECTED)
    for command in ("check", "gate", "fix", "run"):
        assert main([command, "a.xml", "--robot", "robot.yaml"]) == 2
        assert "robot.yaml:2:1: error: the key 'runner' is not known" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "area"),
    [("", None), (" ", None), ("-10 10 -5 5", (-10, 10, -5, 5)), ("0, 1, 2, 3", (0, 1, 2, 3))],
)
def test_the_map_is_four_numbers(text: str, area: tuple[float, ...] | None) -> None:
    assert area_of(text) == area


@pytest.mark.parametrize("text", ["1 2 3", "a b c d", "1 2 3 inf", "nan 1 2 3"])
def test_anything_else_is_no_map(text: str) -> None:
    with pytest.raises(UsageError, match="a map is four numbers"):
        area_of(text)


def test_a_terminal_is_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    replies = iter(["lab", "nav2_capabilities/WaypointRunner", "paper", "0 4 0 4"])
    monkeypatch.setattr("click.prompt", lambda *_, **__: next(replies))
    assert main(["init"]) == 0
    assert Path("robot.yaml").read_text("utf-8") == (
        'name: "lab"\nrunners:\n  - "nav2_capabilities/WaypointRunner"\n'
        "map: {x: [0, 4], y: [0, 4]}\nengine: paper\n"
    )
