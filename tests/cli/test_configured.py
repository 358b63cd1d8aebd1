"""Settings of a configuration file and the command line together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.checking.settings import ModelTable, Settings
from gpsfsm.cli import main
from gpsfsm.cli.check import command as check
from tests.cli.support import ACCEPTED, REJECTED, WARNED, run, runner, write

DOCS = Path(__file__).parents[2] / "docs"
NOT_SETTINGS = {
    "field",
    "paths",
    "config",
    "isolated",
    "no_baseline",
    "fix",
    "diff",
    "unsafe_fixes",
    "task",
    "time_limit",
    "output_file",  # no file says what is written where
}


def configure(text: str, folder: Path = Path()) -> None:
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "gpsfsm.toml").write_text(text, encoding="utf-8")


def shown(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 0) -> str:
    assert main(arguments) == code
    return capsys.readouterr().out


def test_every_option_has_a_key_and_the_other_way_round() -> None:
    keys = set(Settings.model_fields) - {"model"}
    assert {option.name for option in check.params} - NOT_SETTINGS == keys


def test_the_documentation_names_every_key_and_option() -> None:
    configuration = (DOCS / "configuration.md").read_text(encoding="utf-8")
    options = (DOCS / "cli.md").read_text(encoding="utf-8")
    for name in (*Settings.model_fields, *ModelTable.model_fields):
        assert f"`{name.replace('_', '-')}`" in configuration
    for option in check.params:
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
    assert shown(["check", "a.xml", "--isolated"], capsys).startswith("a.xml:2:3: info GP302")


@pytest.mark.parametrize(
    ("setting", "code", "option", "code_with_option"),
    [
        ('fail-on = "warning"\ntolerate = 1', 1, ["--fail-on", "error"], 0),
        ('fail-on = "warning"\ntolerate = 1', 1, ["--tolerate", "0"], 0),
        ('select = ["GP9"]\nfail-on = "warning"\ntolerate = 1', 0, ["--select", "GP3"], 1),
        ('ignore = ["GP302"]\nfail-on = "warning"\ntolerate = 1', 0, ["--ignore", "GP301"], 1),
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


@pytest.mark.parametrize("key", ["quiet", "verbose", "statistics", "consistent", "from-response"])
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
    (tmp_path / ".git").mkdir()
    write(tmp_path / "deep" / "er", a=REJECTED)
    monkeypatch.chdir(tmp_path / "deep" / "er")
    (tmp_path / "known.json").write_text(
        shown(["check", "a.xml", "--format", "json"], capsys, 1), encoding="utf-8"
    )
    configure('baseline = "known.json"', tmp_path)
    out = shown(["check", "a.xml"], capsys)
    assert "suppressed" in out
    text = f'baseline = "{tmp_path}/known.json"'
    assert f"(1 error) hidden by {text} in {tmp_path}/gpsfsm.toml" in out
    assert main(["check", "a.xml", "--no-baseline"]) == 1
    assert "GP307" in capsys.readouterr().out


def test_a_chosen_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=WARNED)
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
    configure('format = "json"\nquiet = true')
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


EXCUSED = REJECTED.replace(
    "<Control", "<!-- gpsfsm: ignore GP307 because the planner knows better --><Control"
)
NOTES = {
    "text": "\nnote: {}\n",
    "json": None,
    "sarif": '"level": "note", "message": {{"text": "{}"}}',
    "markdown": None,
    "junit": "{}</system-out>",
    "github": "::notice title=settings::{}",
    "gitlab": None,
    "llm": None,
}
"""How formats tell a setting, where they have room."""


class TestWhatAFileTakesAway:
    """A report names every setting without which it would say more."""

    @pytest.mark.parametrize("name", NOTES)
    def test_in_every_format(
        self, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=REJECTED)
        configure(f'ignore = ["GP307"]\nformat = "{name}"')
        assert main(["check", "a.xml"]) == 0
        out, err = capsys.readouterr()
        sentence = 'hidden by ignore = ["GP307"] in gpsfsm.toml'
        assert (sentence in err) is (name != "text")
        said = "1 finding (1 error) " + sentence
        if name == "json":
            assert json.loads(out)["settings"] == [
                {
                    "setting": 'ignore = ["GP307"]',
                    "file": "gpsfsm.toml",
                    "effect": "hides",
                    "findings": 1,
                    "errors": 1,
                }
            ]
        elif name == "sarif":
            (invocation,) = json.loads(out)["runs"][0]["invocations"]
            (notice,) = invocation["toolConfigurationNotifications"]
            assert notice["message"]["text"] == said
        elif (form := NOTES[name]) is not None:
            assert form.format(said) in out
        elif name == "markdown":
            assert "1 finding (1 error) hidden by ignore" in out

    @pytest.mark.parametrize(
        ("setting", "said"),
        [
            ('select = ["GP9"]', '1 finding (1 error) hidden by select = ["GP9"]'),
            ('fail-on = "never"', '1 finding (1 error) excused by fail-on = "never"'),
            ('assume = ["x never fails"]', 'decided with assume = ["x never fails"]'),
            ("consistent = true", "decided with consistent = true"),
            ("builtin-capabilities = false", "decided with builtin-capabilities = false"),
            ("from-response = true", "decided with from-response = true"),
            ('engine = "fabric-v2"', 'decided with engine = "fabric-v2"'),
        ],
    )
    def test_each_of_them(
        self, setting: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=REJECTED)
        configure(f"{setting}\nquiet = true")
        main(["check", "a.xml"])
        assert f"note: {said} in gpsfsm.toml\n" in capsys.readouterr().out

    def test_what_a_comment_suppresses_counts_as_well(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=EXCUSED)
        configure('fail-on = "never"\nquiet = true')
        said = 'note: 1 finding (1 error) excused by fail-on = "never" in gpsfsm.toml\n'
        assert said in shown(["check", "a.xml"], capsys)

    def test_what_takes_nothing_away_is_not_told(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=ACCEPTED)
        configure('ignore = ["GP307"]\nfail-on = "never"\nassume = []\nengine = "paper"')
        assert "note:" not in shown(["check", "a.xml"], capsys)

    def test_the_command_line_is_told_as_such(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=REJECTED)
        configure('ignore = ["GP302"]')
        out = shown(["check", "a.xml", "--ignore", "GP307,GP302"], capsys)
        assert "note: 1 finding (1 error) hidden by --ignore GP307,GP302\n" in out
        assert shown(["check", "a.xml", "--ignore", "GP307", "--quiet"], capsys) == ""

    def test_the_own_file_of_the_user(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        write(tmp_path, a=REJECTED)
        monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "xdg"))
        own = tmp_path / "xdg" / "gpsfsm"
        own.mkdir(parents=True)
        (own / "config.toml").write_text('ignore = ["GP307"]\nquiet = true', encoding="utf-8")
        assert 'hidden by ignore = ["GP307"] in xdg' in shown(["check", "a.xml"], capsys)
        configure('ignore = ["GP302"]')  # the project comes before it
        assert "GP307" in shown(["check", "a.xml"], capsys, 1)
        assert "GP307" in shown(["check", "a.xml", "--isolated"], capsys, 1)

    @pytest.mark.parametrize("command", ["fix", "view", "grade", "diff", "fuzz", "port"])
    def test_other_commands_tell_it_too(
        self, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=ACCEPTED, b=ACCEPTED)
        configure('assume = ["x never fails"]\nmax-elements = 100\nbuiltin-capabilities = false')
        task = Path(DOCS / "examples" / "rounds.yaml")
        more = {"diff": ["b.xml"], "grade": ["--task", str(task)], "fuzz": ["--runs", "1"]}
        more["port"] = ["--to", "fabric-v2"]
        main([command, "a.xml", *more.get(command, [])])
        assert "decided with " in capsys.readouterr().err


class TestCommentsInAPlan:
    def test_they_excuse_nothing(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write(tmp_path, a=EXCUSED)
        for command in ("check", "fix"):
            assert main([command, "a.xml"]) == 1
            out, err = capsys.readouterr()
            assert "--allow-suppressions changes that" in err
            assert main([command, "a.xml", "--allow-suppressions"]) == 0
            assert "excused by --allow-suppressions" in "".join(capsys.readouterr())
        assert main(["check", "a.xml"]) == 1
        out = capsys.readouterr().out
        assert ": suppressed error GP307 recovery-without-predecessor: " in out
        assert "(comment: the planner knows better)" in out
        assert out.endswith("1 plan: 1 rejected; no findings, 1 finding suppressed by comments\n")

    @pytest.mark.parametrize("level", ["warning", "error"])
    def test_warnings_count_likewise(self, level: str, tmp_path: Path) -> None:
        text = WARNED.replace("<Runner", "<!-- gpsfsm: ignore GP203 because x --><Runner")
        write(tmp_path, a=text)
        code = int(level == "warning")
        assert main(["check", "a.xml", "--fail-on", level]) == code
        assert main(["check", "a.xml", "--fail-on", level, "--allow-suppressions"]) == 0

    def test_check_alone_takes_it_from_a_file(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=EXCUSED)
        configure("allow-suppressions = true")
        out = shown(["check", "a.xml", "--quiet"], capsys)
        assert "excused by allow-suppressions = true in gpsfsm.toml" in out
        assert main(["check", "a.xml", "--no-allow-suppressions"]) == 1
        assert main(["fix", "a.xml", "--diff"]) == 1
        assert main(["gate", "a.xml"]) == 1
        assert main(["gate", "a.xml", "--config", "gpsfsm.toml"]) == 1

    @pytest.mark.parametrize(
        "comment",
        ["ignore ALL", "ignore ALL because x", "ignore GP3 because x", "ignore GP307", "ignore"],
    )
    def test_what_suppresses_nothing(
        self, comment: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        text = REJECTED.replace("<Control", f"<!-- gpsfsm: {comment} --><Control")
        write(tmp_path, a=text)
        out = shown(["check", "a.xml", "--quiet", "--allow-suppressions"], capsys, 1)
        assert "error GP307" in out
        assert "warning GP905" in out

    def test_what_is_wrong_with_one_is_told_of_broken_texts_too(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a="<Plan><!-- gpsfsm: ignore ALL --><Control></Plan>")
        assert "GP905" in shown(["check", "a.xml", "--quiet"], capsys, 1)

    def test_a_baseline_knows_what_a_comment_suppresses(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=EXCUSED)
        text = shown(["check", "a.xml", "--format", "json"], capsys, 1)
        (tmp_path / "known.json").write_text(text, encoding="utf-8")
        assert main(["check", "a.xml", "--baseline", "known.json"]) == 0


class TestWhatDecidesAboutRuns:
    """Gate, run and service take from a file what the command line names, and nothing else."""

    @pytest.fixture
    def weak(self, tmp_path: Path) -> str:
        """A plan that needs two things at once of one robot, unless a file says otherwise."""
        go, other = runner(x="1"), runner(x="9")
        write(tmp_path, a=f'<Plan><Control type="parallel_all">{go}{other}</Control></Plan>')
        configure('builtin-capabilities = false\nignore = ["ALL"]\nmax-elements = 100')
        return "a.xml"

    def test_gate_and_run_agree(self, weak: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["check", weak]) == 0
        assert main(["gate", weak]) == 1
        capsys.readouterr()
        assert main(["run", weak, "--failure", "0"]) == 1
        assert "it is not run" in capsys.readouterr().err
        assert main(["gate", weak, "--config", "gpsfsm.toml"]) == 0
        assert main(["run", weak, "--failure", "0", "--config", "gpsfsm.toml"]) == 0

    def test_a_file_that_does_not_fit_decides_nothing(self, weak: str) -> None:
        configure("this is no toml")
        assert main(["gate", weak]) == 1
        assert main(["run", weak, "--failure", "0"]) == 1
        assert main(["check", weak]) == 2

    def test_a_file_of_others(
        self, weak: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        tmp_path.chmod(0o1777)
        try:
            assert main(["check", weak]) == 2
            err = capsys.readouterr().err
            assert f"{tmp_path}/gpsfsm.toml: this configuration is not read" in err
            assert f"name it: --config {tmp_path}/gpsfsm.toml" in err
            assert main(["check", weak, "--config", "gpsfsm.toml"]) == 0
            assert main(["check", weak, "--isolated"]) == 1
        finally:
            tmp_path.chmod(0o700)
