"""Which capabilities a check uses, and what becomes of defective files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm.capabilities.library import EMPTY, builtin_capabilities, choose_capabilities
from gpsfsm.errors import UsageError
from gpsfsm.model.report import Verdict
from tests.capabilities.support import INTERFACE, PROVIDER, write

if TYPE_CHECKING:
    from pathlib import Path

WAYPOINT = "nav2_capabilities/WaypointRunner"
WAIT = "generic_capabilities/WaitRunner"
PARAMETERS = """definition:
  configuration_parameters:
    - {name: force, type: double}
"""
OURS = """name: WaypointRunner
spec_type: provider
spec_version: 1.2
implements: nav2_capabilities/WaypointRunner
definition:
  configuration_parameters:
    - {name: door, type: string}
"""
BROKEN = "name: [\n"
UNSURE = INTERFACE.replace("1.2", "9.9")  # a warning: newer than what is known


def runner(name: str, **attributes: str) -> str:
    words = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f'<Runner interface="{name}" provider="{name}"{words}/>'


def only(text: str, **options: Any) -> gpsfsm.PlanReport:
    (plan,) = gpsfsm.check(f"<Plan>{text}</Plan>", **options).plans
    return plan


def codes(report: gpsfsm.PlanReport) -> list[str]:
    return [finding.rule for finding in report.findings]


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A folder that describes arm/Grasp, which needs a force."""
    write(
        tmp_path / "mine",
        {"arm/interfaces/Grasp.yaml": INTERFACE, "arm/providers/Grasp.yaml": PROVIDER + PARAMETERS},
    )
    return tmp_path / "mine"


@pytest.fixture
def doors(tmp_path: Path) -> Path:
    """A folder with another provider of the name of a built-in one."""
    write(tmp_path / "doors", {"nav2_capabilities/providers/WaypointRunner.yaml": OURS})
    return tmp_path / "doors"


class TestChoice:
    def test_the_builtin_library_or_nothing(self) -> None:
        assert choose_capabilities(()) is builtin_capabilities()
        assert choose_capabilities((), builtin=False) is EMPTY

    def test_files_extend_the_builtin_library(self, arm: Path) -> None:
        library = choose_capabilities([arm]).library
        builtin = set(builtin_capabilities().library.interface_names)
        assert set(library.interface_names) == builtin | {"arm/Grasp"}
        assert not library.complete

    def test_alone_they_are_all_there_is(self, arm: Path) -> None:
        library = choose_capabilities([str(arm)], builtin=False).library
        assert library.interface_names == ("arm/Grasp",)
        assert library.complete

    def test_they_replace_what_has_the_same_name(self, doors: Path) -> None:
        provider = choose_capabilities([doors]).library.provider(WAYPOINT)
        assert provider is not None
        assert [parameter.name for parameter in provider.configuration] == ["door"]
        assert builtin_capabilities().library.provider(WAYPOINT) != provider

    def test_later_folders_win(self, doors: Path, tmp_path: Path) -> None:
        gates = OURS.replace("door", "gate")
        write(tmp_path / "gates", {"nav2_capabilities/providers/WaypointRunner.yaml": gates})
        for paths, name in (
            ([doors, tmp_path / "gates"], "gate"),
            ([tmp_path / "gates", doors], "door"),
        ):
            provider = choose_capabilities(paths).library.provider(WAYPOINT)
            assert provider is not None
            assert [parameter.name for parameter in provider.configuration] == [name]

    def test_errors_are_defects_and_warnings_are_not(self, arm: Path) -> None:
        assert choose_capabilities([arm]).defects == ()
        write(arm, {"arm/interfaces/Grasp.yaml": UNSURE})
        assert choose_capabilities([arm]).defects == ()
        write(arm, {"arm/interfaces/Release.yaml": BROKEN})
        (defect,) = choose_capabilities([arm]).defects
        assert str(defect).startswith(f"{arm}/arm/interfaces/Release.yaml:2:1: error: ")

    def test_a_path_that_cannot_be_used_is_misuse(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="there is no capability file in it"):
            choose_capabilities([tmp_path])
        with pytest.raises(UsageError, match="missing: cannot be read: No such file"):
            choose_capabilities([tmp_path / "missing"])


class TestChecks:
    """What ``gpsfsm.check`` makes of them."""

    def test_files_describe_runners(self, arm: Path) -> None:
        grasp = runner("arm/Grasp")
        assert codes(only(grasp)) == ["GP210", "GP302"]
        assert codes(only(grasp, capabilities=[arm])) == ["GP204", "GP302"]
        wrong = runner("arm/Grasp", force="much")
        assert codes(only(wrong, capabilities=[str(arm)])) == ["GP302", "GP205"]
        assert codes(only(runner("arm/Grasp", force="2"), capabilities=[arm])) == ["GP302"]

    def test_what_complete_files_do_not_describe_does_not_exist(self, arm: Path) -> None:
        go = runner(WAYPOINT, x="1", y="2")
        report = only(go, capabilities=[arm])
        assert (report.verdict, codes(report)) == (Verdict.ACCEPTED, ["GP302"])
        report = only(go, capabilities=[arm], builtin_capabilities=False)
        assert report.verdict is Verdict.REJECTED
        assert [finding.message for finding in report.findings if finding.rule == "GP201"] == [
            f"there is no interface '{WAYPOINT}'"
        ]

    def test_without_any_nothing_is_known_of_a_runner(self) -> None:
        go = runner(WAYPOINT)  # without a place
        assert codes(only(go)) == ["GP302", "GP401"]
        assert codes(only(go, builtin_capabilities=False)) == ["GP210", "GP302"]

    def test_declared_outcomes_need_the_library(self) -> None:
        wait = runner(WAIT, seconds="5")
        for builtin, completes in ((True, "always"), (False, "sometimes")):
            facts = only(wait, builtin_capabilities=builtin).facts
            assert facts is not None
            assert facts.completes == completes

    def test_a_defective_file_stops_no_check(self, arm: Path) -> None:
        write(arm, {"arm/interfaces/Release.yaml": BROKEN})
        report = only(runner("arm/Grasp", force="2"), capabilities=[arm])
        assert (report.verdict, codes(report)) == (Verdict.ACCEPTED, ["GP211", "GP302"])
        finding = report.findings[0]
        assert (finding.location.line, finding.location.element) == (1, "/Plan")
        assert finding.message.startswith(
            f"the capability files have a defect: {arm}/arm/interfaces/Release.yaml:2:1: error: "
        )
        assert "'gpsfsm capabilities check DIR'" in finding.hint

    def test_the_first_three_defects_are_told_and_the_others_counted(self, arm: Path) -> None:
        write(arm, {f"arm/interfaces/B{number}.yaml": BROKEN for number in range(5)})
        report = only(runner("arm/Grasp", force="2"), capabilities=[arm])
        (finding,) = (each for each in report.findings if each.rule == "GP211")
        assert finding.message.startswith("the capability files have 5 defects: ")
        assert [f"/B{number}.yaml" in finding.message for number in range(5)] == [True] * 3 + [
            False
        ] * 2
        assert finding.message.endswith("; and 2 more")

    def test_a_defect_is_told_in_one_line(self, arm: Path) -> None:
        write(arm, {"arm/interfaces/Release.yaml": "a: b: c\n"})
        report = only(runner("arm/Grasp", force="2"), capabilities=[arm])
        assert "is not YAML" in report.findings[0].message
        assert "\\x0a" not in report.findings[0].message

    def test_every_plan_tells_of_defects(self, arm: Path, tmp_path: Path) -> None:
        write(arm, {"arm/interfaces/Release.yaml": BROKEN})
        plan = f"<Plan>{runner('arm/Grasp', force='2')}</Plan>"
        write(tmp_path / "plans", {"a.xml": plan, "b.xml": plan, "c.xml": "<Plan>"})
        report = gpsfsm.check(tmp_path / "plans", capabilities=[arm], select=["GP211", "GP1"])
        assert [codes(each) for each in report.plans] == [["GP211"], ["GP211"], ["GP101"]]


class TestLimits:
    """A deadline and a limit of energy."""

    PLAN = runner(WAIT, seconds="5") + runner(WAIT, seconds="6")

    def test_a_deadline(self) -> None:
        assert codes(only(self.PLAN)) == []
        assert codes(only(self.PLAN, deadline_s=11)) == []
        report = only(self.PLAN, deadline_s=10.5)
        assert (report.verdict, codes(report)) == (Verdict.REJECTED, ["GP502"])

    def test_a_limit_of_energy(self, arm: Path) -> None:
        write(arm, {"arm/providers/Grasp.yaml": PROVIDER + "energy: {max: 4}\n" + PARAMETERS})
        grasps = runner("arm/Grasp", force="2") * 2
        for limit, expected in ((8.0, []), (7.9, ["GP503"])):
            report = only(grasps, capabilities=[arm], energy_limit_j=limit, ignore=["GP302"])
            assert codes(report) == expected

    @pytest.mark.parametrize("limit", [0, -1, float("nan"), float("inf"), -float("inf")])
    def test_must_be_positive(self, limit: float) -> None:
        with pytest.raises(UsageError, match="the deadline must be a positive number"):
            gpsfsm.check("<Plan/>", deadline_s=limit)
        with pytest.raises(UsageError, match="the energy limit must be a positive number"):
            gpsfsm.check("<Plan/>", energy_limit_j=limit)


@pytest.mark.parametrize("limit", ["5", True, 10**400, float("nan")])
def test_limits_that_are_no_numbers_are_misuse(limit: object) -> None:
    with pytest.raises(UsageError, match="the deadline must be a positive number"):
        gpsfsm.check("<Plan/>", deadline_s=limit)  # type: ignore[arg-type]


@pytest.mark.parametrize("written", ["mine", ""])
def test_a_text_where_a_list_belongs_is_misuse(written: str) -> None:
    with pytest.raises(UsageError, match="capabilities takes a list of texts"):
        gpsfsm.check("<Plan/>", capabilities=written)


def test_a_path_where_a_list_belongs_is_misuse(arm: Path) -> None:
    with pytest.raises(UsageError, match="capabilities takes a list of texts"):
        gpsfsm.check("<Plan/>", capabilities=arm)  # type: ignore[arg-type]
