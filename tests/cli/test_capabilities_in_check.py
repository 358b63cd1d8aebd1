"""``gpsfsm check`` with capability files, a deadline and a limit of energy."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.cli import main
from tests.capabilities.support import INTERFACE, PROVIDER
from tests.capabilities.support import write as write_files
from tests.cli.support import ACCEPTED, run, runner, write

if TYPE_CHECKING:
    from pathlib import Path

GRASP = '<Plan>\n  <Runner interface="arm/Grasp" provider="arm/Grasp"/>\n</Plan>\n'
WAIT = "generic_capabilities/WaitRunner"
WAITS = f'<Plan><Runner interface="{WAIT}" provider="{WAIT}" seconds="5"/></Plan>'
NEVER_FAILS = "outcomes: {never_fails: true}\ndefinition: {}\n"
ENERGY = "energy: {min: 2, max: 3}\ndefinition: {}\n"
BROKEN = "name: [\n"


def describe(folder: Path, body: str = "definition: {}\n") -> None:
    """A folder that describes arm/Grasp."""
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/providers/Grasp.yaml": PROVIDER + body,
    }
    write_files(folder, files)


@pytest.fixture(autouse=True)
def _folders(tmp_path: Path) -> None:
    """Two folders of capability files and a plan; the tests run beside them."""
    describe(tmp_path / "plain")
    describe(tmp_path / "sure", NEVER_FAILS)
    write(tmp_path, a=GRASP)


def checked(
    *arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0
) -> list[dict[str, Any]]:
    """The plans of the JSON report."""
    assert main(["check", *arguments, "--format", "json"]) == code
    plans: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["plans"]
    return plans


def codes(plan: dict[str, Any]) -> list[str]:
    return [finding["rule"] for finding in plan["findings"]]


class TestFolders:
    def test_describe_runners(self, capsys: pytest.CaptureFixture[str]) -> None:
        (plan,) = checked("a.xml", capsys=capsys)
        assert codes(plan) == ["GP210", "GP302"]
        (plan,) = checked("a.xml", "--capabilities", "plain", capsys=capsys)
        assert codes(plan) == ["GP302"]

    @pytest.mark.parametrize(
        ("folders", "completes"), [(["plain", "sure"], "always"), (["sure", "plain"], "sometimes")]
    )
    def test_the_later_one_wins(
        self, folders: list[str], completes: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        options = [word for folder in folders for word in ("--capabilities", folder)]
        (plan,) = checked("a.xml", *options, capsys=capsys)
        assert plan["facts"]["completes"] == completes

    def test_may_be_single_files(self, capsys: pytest.CaptureFixture[str]) -> None:
        options = ["--capabilities", "sure/arm/providers/Grasp.yaml"]
        (plan,) = checked("a.xml", "--capabilities", "plain", *options, capsys=capsys)
        assert plan["facts"]["completes"] == "always"

    def test_alone_they_are_all_there_is(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, b=ACCEPTED)
        options = ["--capabilities", "plain", "--no-builtin-capabilities"]
        first, second = checked("a.xml", "b.xml", *options, code=1, capsys=capsys)
        assert codes(first) == ["GP302"]
        assert codes(second) == ["GP302", "GP201"]
        (plan,) = checked("b.xml", "--no-builtin-capabilities", capsys=capsys)
        assert codes(plan) == ["GP210", "GP302"]
        assert checked("b.xml", "--builtin-capabilities", capsys=capsys) == checked(
            "b.xml", capsys=capsys
        )

    @pytest.mark.parametrize(
        ("folder", "message"),
        [
            ("missing", "gpsfsm: missing: cannot be read: No such file or directory\n"),
            ("empty", "gpsfsm: empty: there is no capability file in it; such files are\n"),
            ("", "gpsfsm: a path of capability files is empty\n"),
        ],
    )
    def test_that_cannot_be_used_is_a_message(
        self, folder: str, message: str, tmp_path: Path
    ) -> None:
        (tmp_path / "empty").mkdir()
        done = run("check", "a.xml", "--capabilities", folder, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, b"")
        assert done.stderr.decode().startswith(message)

    def test_with_a_broken_file_are_told_and_used(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write_files(tmp_path / "sure", {"arm/providers/Bad.yaml": BROKEN})
        (plan,) = checked("a.xml", "--capabilities", "sure", capsys=capsys)
        assert (plan["verdict"], codes(plan)) == ("accepted", ["GP211"])
        assert plan["facts"]["completes"] == "always"
        assert " sure/arm/providers/Bad.yaml:2:1: error: " in plan["findings"][0]["message"]
        checked("a.xml", "--capabilities", "sure", "--fail-on", "warning", code=1, capsys=capsys)

    def test_defects_are_told_for_people(self, tmp_path: Path) -> None:
        write_files(tmp_path / "sure", {"arm/providers/Bad.yaml": BROKEN})
        done = run("check", "a.xml", "--capabilities", "sure", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, b"")
        first, *_ = done.stdout.decode().splitlines()
        assert first.startswith("a.xml:1:1: warning GP211 defective-capability-file: ")

    def test_a_misspelt_key_is_reported(self, tmp_path: Path) -> None:
        """Else what the key was meant to declare, such as a resource, is missing unnoticed."""
        describe(tmp_path / "sure", "resource: [base]\n")
        command = ("a.xml", "--capabilities", "sure")
        done = run("check", *command, cwd=tmp_path)
        assert done.returncode == 1
        assert b"the key 'resource' is not known here" in done.stdout
        strict = ("--fail-on", "warning", "--ignore", "GP302")
        assert run("gate", *command, *strict, cwd=tmp_path).returncode == 2
        describe(tmp_path / "sure", "resources: [base]\ncolour: of another program\n")
        assert run("gate", *command, *strict, cwd=tmp_path).returncode == 0


class TestJobs:
    COMMAND = ("plans", "--capabilities", "sure", "--deadline", "4")

    @pytest.fixture(autouse=True)
    def _plans(self, tmp_path: Path) -> None:
        write_files(tmp_path / "sure", {"arm/providers/Bad.yaml": BROKEN})
        write(tmp_path / "plans", a=GRASP, b=ACCEPTED, c=WAITS, d="<Plan>", e=GRASP)

    def test_output_does_not_depend_on_them(self, tmp_path: Path) -> None:
        alone, several = (
            run(*("check", *self.COMMAND, "--jobs", jobs, "--format", "sarif"), cwd=tmp_path)
            for jobs in ("1", "2")
        )
        assert alone.returncode == several.returncode == 1
        assert alone.stdout == several.stdout
        assert alone.stderr == several.stderr == b""

    def test_workers_get_everything(self, capsys: pytest.CaptureFixture[str]) -> None:
        plans = checked(*self.COMMAND, "--jobs", "2", code=1, capsys=capsys)
        assert plans == checked(*self.COMMAND, "--jobs", "1", code=1, capsys=capsys)
        assert [codes(plan) for plan in plans] == [
            ["GP211", "GP502"],
            ["GP211", "GP502", "GP302"],
            ["GP211", "GP502"],
            ["GP101"],
            ["GP211", "GP502"],
        ]


class TestLimits:
    def test_a_deadline(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write(tmp_path, w=WAITS)
        (plan,) = checked("w.xml", "--deadline", "5", capsys=capsys)
        assert codes(plan) == []
        (plan,) = checked("w.xml", "--deadline", "4.5", code=1, capsys=capsys)
        assert (plan["verdict"], codes(plan)) == ("rejected", ["GP502"])

    def test_a_limit_of_energy(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        describe(tmp_path / "hungry", ENERGY)
        for limit, code, expected in (("3", 0, ["GP302"]), ("2.5", 1, ["GP503", "GP302"])):
            options = ["--capabilities", "hungry", "--energy-limit", limit]
            (plan,) = checked("a.xml", *options, code=code, capsys=capsys)
            assert codes(plan) == expected

    @pytest.mark.parametrize(
        ("option", "name"), [("--deadline", "deadline"), ("--energy-limit", "energy limit")]
    )
    @pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "1e999"])
    def test_must_be_positive(
        self, option: str, name: str, value: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert main(["check", "a.xml", option, value]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.startswith(f"gpsfsm: the {name} must be a positive number, not ")

    @pytest.mark.parametrize("option", ["--deadline", "--energy-limit"])
    def test_must_be_numbers(self, option: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["check", "a.xml", option, "soon"]) == 2
        assert "'soon' is not a valid float" in capsys.readouterr().err


class TestSettings:
    def configure(self, folder: Path, text: str) -> None:
        folder.mkdir(exist_ok=True)
        (folder / "gpsfsm.toml").write_text(text, encoding="utf-8")

    def test_folders_are_relative_to_the_file(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.configure(tmp_path, 'capabilities = ["plain", "sure"]\n')
        (tmp_path / ".git").mkdir()
        write(tmp_path / "deep", a=GRASP)
        describe(tmp_path / "deep" / "sure")
        monkeypatch.chdir(tmp_path / "deep")
        (plan,) = checked("a.xml", capsys=capsys)
        assert (codes(plan), plan["facts"]["completes"]) == ([], "always")
        (plan,) = checked("a.xml", "--capabilities", "sure", capsys=capsys)
        assert (codes(plan), plan["facts"]["completes"]) == (["GP302"], "sometimes")
        (plan,) = checked("a.xml", "--isolated", capsys=capsys)
        assert codes(plan) == ["GP210", "GP302"]

    def test_a_missing_folder_is_a_message(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.configure(tmp_path, 'capabilities = ["missing"]\n')
        assert main(["check", "a.xml"]) == 2
        assert "missing: cannot be read: No such file or directory" in capsys.readouterr().err

    def test_the_builtin_library_can_be_left_out(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.configure(tmp_path, "builtin-capabilities = false\n")
        write(tmp_path, b=f"<Plan>{runner()}</Plan>")
        (plan,) = checked("b.xml", capsys=capsys)
        assert codes(plan) == ["GP210", "GP302"]
        (plan,) = checked("b.xml", "--builtin-capabilities", capsys=capsys)
        assert codes(plan) == ["GP302"]

    def test_limits(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        describe(tmp_path / "hungry", ENERGY)
        settings = 'capabilities = ["hungry"]\ndeadline = 4\nenergy-limit = 2.5\n'
        self.configure(tmp_path, settings)
        write(tmp_path, w=WAITS)
        (plan,) = checked("w.xml", code=1, capsys=capsys)
        assert "GP502" in codes(plan)
        (plan,) = checked("w.xml", "--deadline", "5", code=1, capsys=capsys)
        assert "GP502" not in codes(plan)
        (plan,) = checked("a.xml", code=1, capsys=capsys)
        assert "GP503" in codes(plan)
        (plan,) = checked("a.xml", "--energy-limit", "3", code=1, capsys=capsys)
        assert "GP503" not in codes(plan)

    @pytest.mark.parametrize("key", ["deadline", "energy-limit"])
    @pytest.mark.parametrize("value", ["0", "-1.5", '"5"', "nan", "inf", "true"])
    def test_wrong_limits_are_explained(
        self, key: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.configure(tmp_path, f"{key} = {value}\n")
        assert main(["check", "a.xml"]) == 2
        error = capsys.readouterr().err
        assert str(tmp_path / "gpsfsm.toml") in error
        assert f"'{key}' must be " in error

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ('capabilities = "mine"', "'capabilities' must be a valid list, not 'mine'"),
            ("capabilities = [1]", "'capabilities[0]' must be a valid string, not 1"),
            ("builtin-capabilities = 1", "'builtin-capabilities' must be a valid boolean, not 1"),
        ],
    )
    def test_wrong_folders_are_explained(
        self, text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.configure(tmp_path, text)
        assert main(["check", "a.xml"]) == 2
        assert words in capsys.readouterr().err


H = """\
name: Grasp
spec_type: provider
spec_version: 1.2
description: Grasps.
implements: arm/Grasp
"""
DEFECTIVE = {
    "misspelt": H + "resorces: [arm]\n",
    "another level": H + "definition: {resources: [arm]}\n",
    "type": H + "resources: arm\n",
    "minimum": H + "definition: {configuration_parameters: [{name: x, minimum: 3, maximum: 1}]}\n",
    "duration": H + "duration: {min: 3, max: 1}\n",
    "no YAML": H + "definition: {\n",
    "a list": "- 1\n",
    "no text": b"\xff\xfe",
    "nameless": H.replace("name: Grasp\n", ""),
}


@pytest.mark.parametrize("case", DEFECTIVE)
def test_a_defect_of_a_file_of_a_runner_is_an_error_and_leaves_the_gate_undecided(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {"arm/providers/Grasp.yaml": DEFECTIVE[case], "arm/interfaces/Lift.yaml": INTERFACE}
    files["arm/providers/Lift.yaml"] = (PROVIDER + "definition: {}\n").replace("Grasp", "Lift")
    files["arm/interfaces/Lift.yaml"] = INTERFACE.replace("Grasp", "Lift")
    write_files(tmp_path / "plain", files)
    write(tmp_path, b=GRASP.replace("Grasp", "Lift"))
    (plan,) = checked("a.xml", "--capabilities", "plain", capsys=capsys, code=1)
    found = next(each for each in plan["findings"] if each["rule"] == "GP211")
    assert found["severity"] == "error"
    assert "plain/arm/providers/Grasp.yaml:" in found["message"]
    (plan,) = checked("b.xml", "--capabilities", "plain", capsys=capsys)
    assert [each["severity"] for each in plan["findings"] if each["rule"] == "GP211"] == ["warning"]
    assert main(["gate", "a.xml", "b.xml", "--capabilities", "plain"]) == 2
    said = capsys.readouterr().out
    assert "a.xml: undecided: inconclusive: the capability files of runners of this plan" in said
    assert "b.xml: accepted" in said
