"""``gpsfsm check`` on good, bad and hostile inputs."""

from __future__ import annotations

import json
import os
import socket
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.checking.option_table import BY_NAME
from gpsfsm.cli import main
from gpsfsm.cli._options import LIMITS
from gpsfsm.syntax import Limits, parse
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, WARNED, run, runner, shell, write

FORMATS = ("text", "json", "sarif", "github", "junit")


def checked(*arguments: str, code: int, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    """The plans of the JSON report."""
    assert main(["check", *arguments, "--format", "json"]) == code
    plans: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["plans"]
    return plans


def codes(plan: dict[str, Any]) -> list[str]:
    return [finding["rule"] for finding in plan["findings"]]


@pytest.mark.parametrize("output_format", FORMATS)
class TestExitCodes:
    """The same for every format."""

    @pytest.mark.parametrize(
        ("text", "options", "code"),
        [
            (ACCEPTED, [], 0),
            (ACCEPTED, ["--fail-on", "warning"], 0),
            (ACCEPTED, ["--fail-on", "warning", "--tolerate", "1"], 1),
            (WARNED, ["--fail-on", "warning"], 1),
            (WARNED, ["--fail-on", "warning", "--ignore", "GP203"], 0),
            (REJECTED, [], 1),
            (REJECTED, ["--fail-on", "never"], 0),
            (REJECTED, ["--ignore", "recovery-without-predecessor"], 0),
            (BROKEN, [], 1),
            (ACCEPTED, ["--max-bytes", "10"], 2),
            (ACCEPTED, ["--max-bytes", "10", "--fail-on", "never"], 2),
            (ACCEPTED, ["--max-bytes", "10", "--select", "GP3"], 2),
        ],
    )
    def test_of_a_plan(
        self,
        output_format: str,
        text: str,
        options: list[str],
        code: int,
        tmp_path: Path,
    ) -> None:
        write(tmp_path, a=text)
        assert main(["check", "a.xml", "--format", output_format, *options]) == code

    def test_the_worst_plan_counts(self, output_format: str, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED, b=REJECTED)
        assert main(["check", ".", "--format", output_format]) == 1
        assert main(["check", ".", "missing.xml", "--format", output_format]) == 2


def test_a_user_sees_the_finding_and_its_place(tmp_path: Path) -> None:
    write(tmp_path, a=REJECTED)
    done = run("check", "a.xml", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout.startswith(b"a.xml:2:3: error GP307 recovery-without-predecessor: ")
    assert done.stderr == b""


def test_a_verbose_report_shows_all_that_is_known(tmp_path: Path) -> None:
    name = "fabric_capabilities/FabricCompletionRunner"
    end = f'<Runner interface="{name}" provider="{name}"/>'
    write(tmp_path, a=f"<Plan>\n{runner()}\n{end}\n</Plan>")
    short = run("check", "a.xml", cwd=tmp_path).stdout
    whole = run("check", "a.xml", "--verbose", cwd=tmp_path).stdout
    for line in (b"(element /Plan/Runner[2])", b"= hint: remove it; the check ignores it"):
        assert line not in short
        assert line in whole
    assert b"a.xml:3:1: info GP113 explicit-completion: " in short
    assert short.endswith(b"(more with --verbose)\n")
    assert b"--verbose" not in whole


def test_standard_input(tmp_path: Path) -> None:
    done = run("check", "-", "--quiet", stdin=REJECTED.encode(), cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout.startswith(b"<stdin>:2:3: error GP307 ")


def test_options_reach_the_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"<Plan>{runner()}</Plan>", b=f"Sure!\n```xml\n{ACCEPTED}```\n")
    for options, completes in (
        ([], "sometimes"),
        (["--assume", "WaypointRunner never fails"], "always"),
        (["--assume", "WaypointRunner always fails"], "never"),
    ):
        code = 1 if completes == "never" else 0
        (plan,) = checked("a.xml", *options, code=code, capsys=capsys)
        assert plan["facts"]["completes"] == completes
    (plan,) = checked("a.xml", "--faults", "failed,hang", code=1, capsys=capsys)
    assert plan["facts"]["stuck"] == "sometimes"
    (plan,) = checked("b.xml", code=1, capsys=capsys)
    assert plan["verdict"] == "rejected"
    (plan,) = checked("b.xml", "--from-response", code=0, capsys=capsys)
    assert plan["verdict"] == "accepted"
    (plan,) = checked("a.xml", "--max-scenarios", "0", code=0, capsys=capsys)
    assert [finding["scenario"] for finding in plan["findings"]] == [None]


def test_consistent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f'<Plan>{runner()}<Control type="recovery">{runner()}</Control></Plan>')
    actual = {}
    for option in ("--no-consistent", "--consistent"):
        (plan,) = checked("a.xml", option, code=0, capsys=capsys)
        actual[option] = [each["severity"] for each in plan["findings"] if each["rule"] == "GP309"]
    assert actual == {"--no-consistent": ["info"], "--consistent": ["warning"]}


def test_codes_may_be_joined_and_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED, b=REJECTED)
    plans = checked(".", "--select", "GP302, GP306", "--select", "GP307", code=1, capsys=capsys)
    assert [codes(plan) for plan in plans] == [["GP302"], ["GP307"]]
    plans = checked(".", "--ignore", "GP302,gp307", code=0, capsys=capsys)
    assert [codes(plan) for plan in plans] == [[], []]
    assert [plan["verdict"] for plan in plans] == ["accepted", "rejected"]


def test_limits_have_the_defaults_that_the_help_names() -> None:
    assert {name: BY_NAME[name].initial for name in LIMITS} == {
        name: getattr(Limits(), name) for name in LIMITS
    }


@pytest.mark.parametrize("name", LIMITS)
def test_every_limit_can_be_set(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f'<Plan><Control type="sequential">{runner(x="1", y="22")}</Control></Plan>')
    option = "--" + name.replace("_", "-")
    (plan,) = checked("a.xml", option, "1", code=2, capsys=capsys)
    assert (plan["verdict"], codes(plan)) == ("undecided", ["GP103"])
    checked("a.xml", option, "1000", code=0, capsys=capsys)


class TestHostileInputs:
    def check(self, path: str, **kwargs: Any) -> tuple[int, str]:
        done = run("check", path, "--quiet", **kwargs)
        assert done.stderr == b""
        return done.returncode, done.stdout.decode()

    def test_missing_file(self, tmp_path: Path) -> None:
        code, shown = self.check("missing.xml", cwd=tmp_path)
        assert code == 2
        assert shown.startswith("missing.xml: error GP901 unreadable-input: cannot be read: No")

    def test_empty_folder(self, tmp_path: Path) -> None:
        code, shown = self.check(".", cwd=tmp_path)
        assert code == 2
        assert "GP901 unreadable-input: is a folder without any *.xml file" in shown

    @pytest.mark.parametrize(
        ("content", "rule"),
        [
            (b"", "GP104"),
            (b" \n", "GP104"),
            (b"<Plan>\x00</Plan>", "GP116"),
            (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\xff\xd8", "GP116"),
            (b"<" * 100_000, "GP1"),
            (b"<a " * 100_000, "GP1"),
            (b"<Control>" * 100_000, "GP1"),
        ],
    )
    def test_no_plan_at_all(self, content: bytes, rule: str, tmp_path: Path) -> None:
        (tmp_path / "a.xml").write_bytes(content)
        code, shown = self.check("a.xml", cwd=tmp_path)
        assert code in (1, 2)
        assert f" {rule}" in shown

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
    def test_a_pipe_in_a_folder_is_not_waited_for(self, tmp_path: Path) -> None:
        os.mkfifo(tmp_path / "pipe.xml")
        code, shown = self.check(".", cwd=tmp_path)
        assert (code, "pipe.xml: error GP901 unreadable-input: is not a regular" in shown) == (
            2,
            True,
        )

    @pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
    def test_a_device_that_never_ends(self) -> None:
        code, shown = self.check("/dev/zero")
        assert code == 2
        assert "is not a regular file" in shown

    def test_a_socket(self, tmp_path: Path) -> None:
        with socket.socket(socket.AF_UNIX) as opened:
            opened.bind("s.xml")
            code, shown = self.check("s.xml", cwd=tmp_path)
        assert code == 2
        assert "is not a regular file" in shown

    def test_a_path_that_is_no_text(self, tmp_path: Path) -> None:
        name = os.fsdecode(b"caf\xe9\x1b[31m.xml")
        try:
            (tmp_path / name).write_text(ACCEPTED, encoding="utf-8")
        except OSError:
            pytest.skip("this file system wants UTF-8 names")
        for output_format in FORMATS:
            done = run("check", ".", "--format", output_format, cwd=tmp_path)
            assert done.returncode == 0, done
            assert b"\x1b" not in done.stdout
            done.stdout.decode("utf-8")

    def test_a_path_that_is_too_long(self) -> None:
        code, shown = self.check("x" * 5000)
        assert code == 2
        assert "GP901" in shown

    def test_standard_input_that_is_closed(self, tmp_path: Path) -> None:
        done = shell("$NEW_GPSFSM check - -q <&-", tmp_path)
        assert done.returncode == 2
        assert b"<stdin>: error GP901 unreadable-input: cannot be read" in done.stdout


class TestDefects:
    """What goes wrong with one plan does not hide what is known of the others."""

    def test_of_one_plan(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def fragile(text: bytes, *, file: str, includes: Any, **options: Any) -> Any:
            assert includes is None
            if file == "b.xml":
                raise ZeroDivisionError("of the universe")
            return parse(text, file=file, **options)

        monkeypatch.setattr("gpsfsm.checking.check.read_plan_or_machine", fragile)
        write(tmp_path, a=ACCEPTED, b=ACCEPTED, c=REJECTED)
        plans = checked(".", code=2, capsys=capsys)
        assert [plan["verdict"] for plan in plans] == ["accepted", "undecided", "rejected"]
        assert codes(plans[1]) == ["GP903"]
        assert "ZeroDivisionError: of the universe" in plans[1]["findings"][0]["message"]
        monkeypatch.setenv("GPSFSM_DEBUG", "1")
        with pytest.raises(ZeroDivisionError):
            main(["check", "."])


def test_short_names_of_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=REJECTED)
    for short, long in (("-v", "--verbose"), ("-q", "--quiet")):
        assert main(["check", "a.xml", short]) == 1
        printed = capsys.readouterr().out
        assert main(["check", "a.xml", long]) == 1
        assert capsys.readouterr().out == printed
