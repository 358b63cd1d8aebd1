"""Which class runs a provider; what a capability file names is not trusted."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.library import Library, builtin_capabilities
from gpsfsm.execution import registry
from gpsfsm.execution.registry import Maker, Mode, runner_class, wrong_registrations
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.model.capability import Interface, Provider
from gpsfsm.runners import generic
from gpsfsm.runners.generic import simulated
from gpsfsm.runners.navigation.simulated import WaypointRunner

if TYPE_CHECKING:
    from pathlib import Path

BUILT_IN = builtin_capabilities().library


class Mine(Runner):
    """A runner that is registered."""

    async def run(self, parameters: object, context: object) -> None:
        return None


class Pretends(Mine):
    """What stands in for it in simulations."""


class Both(Mine):
    """A runner with a stand-in."""

    simulated = Pretends


def provider(runner: str = "", name: str = "demo/Grasp") -> Provider:
    return Provider(name, "demo/GraspInterface", runner=runner)


def refused(found: Provider, **options: object) -> str:
    with pytest.raises(RunnerError) as caught:
        runner_class(found, **options)  # type: ignore[arg-type]
    return str(caught.value)


@pytest.fixture
def register(monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    entries: list[EntryPoint] = []
    monkeypatch.setattr(registry, "entry_points", lambda group: entries)
    return entries


def entry(name: str, value: str) -> EntryPoint:
    return EntryPoint(name, value, registry.GROUP)


@pytest.mark.parametrize("name", generic.__all__)
def test_built_in_runners(name: str) -> None:
    described = BUILT_IN.provider(f"generic_capabilities/{name}")
    assert described is not None
    assert runner_class(described) is getattr(generic, name)
    assert runner_class(described, mode=Mode.SIMULATED) is getattr(simulated, name)


def test_every_built_in_provider_has_a_simulated_runner_or_a_real_one() -> None:
    for described in BUILT_IN.providers:
        found = runner_class(described, mode=Mode.SIMULATED)
        assert found.__name__ == described.runner.partition(":")[2]


def test_what_exists_only_as_a_simulation_says_so() -> None:
    described = BUILT_IN.provider("nav2_capabilities/WaypointRunner")
    assert described is not None
    assert refused(described).startswith(
        "nav2_capabilities/WaypointRunner exists only as a simulation: install a package"
    )


@pytest.mark.parametrize(
    ("runner", "message"),
    [
        ("", "no runner is installed for demo/Grasp: its file names ''"),
        ("launch/empty.launch.py", "no runner is installed for demo/Grasp: its file names 'lau"),
        ("capabilities2_runner::WaypointRunner", "no runner is installed for demo/Grasp"),
        ("os:system", "the file of demo/Grasp names the runner os:system, and runners from"),
        ("gpsfsm.runnersx:Runner", "the file of demo/Grasp names the runner gpsfsm.runnersx"),
        ("gpsfsm.runners.generic:Path", "demo/Grasp exists only as a simulation"),
        ("gpsfsm.runners.generic.process:os", "gpsfsm.runners.generic.process:os is no runner"),
        ("gpsfsm.runners.generic.basic:Runner", "gpsfsm.runners.generic.basic:Runner is no runner"),
        ("gpsfsm.runners.nothing:Runner", "the runner gpsfsm.runners.nothing:Runner cannot be"),
        ("../evil:Runner", "no runner is installed for demo/Grasp"),
        ("evil:Runner.__init__", "no runner is installed for demo/Grasp"),
    ],
)
def test_files_are_not_trusted(runner: str, message: str) -> None:
    assert refused(provider(runner)).startswith(message)


def test_a_module_that_is_not_allowed_is_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "wild_robot.py").write_text(
        "from gpsfsm.execution.runner import Runner\n"
        "class Arm(Runner):\n    async def run(self, parameters, context):\n        return {}\n"
        "class Half(Runner):\n    pass\n"
    )
    (tmp_path / "wild_broken.py").write_text("raise ValueError('no')\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "wild_robot", raising=False)
    described = provider("wild_robot:Arm")
    assert "not allowed" in refused(described)
    assert "not allowed" in refused(described, allow=["wild", "wild_robot.deep"])
    assert "wild_robot" not in sys.modules
    assert runner_class(described, allow=["wild_robot"]).__name__ == "Arm"
    assert "has no simulated runner" in refused(
        described, allow=["wild_robot"], mode=Mode.SIMULATED
    )
    allow = ["wild_robot", "wild_broken"]
    assert "is no runner" in refused(provider("wild_robot:Half"), allow=allow)
    assert "has no Leg" in refused(provider("wild_robot:Leg"), allow=allow)
    assert "cannot be imported: ValueError: no" in refused(provider("wild_broken:X"), allow=allow)
    monkeypatch.delitem(sys.modules, "wild_robot", raising=False)


def test_installed_runners_come_first(register: list[EntryPoint]) -> None:
    register.append(entry("demo/GraspInterface", f"{__name__}:Mine"))
    assert runner_class(provider("gpsfsm.runners.generic:WaitRunner")) is Mine
    register.append(entry("demo/Grasp", f"{__name__}:Both"))
    assert runner_class(provider()) is Both
    assert runner_class(provider(), mode=Mode.SIMULATED) is Pretends


def test_an_installed_package_registers_a_runner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "my_robot-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: my-robot\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(
        f"[gpsfsm.runners]\ndemo/Grasp = {__name__}:Both\n\n[other]\ndemo/Grasp = os:sep\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert runner_class(provider()) is Both


def test_a_real_runner_leaves_the_built_in_simulation_as_it_is(
    register: list[EntryPoint],
) -> None:
    register.append(entry("nav2_capabilities/WaypointRunner", f"{__name__}:Mine"))
    described = BUILT_IN.provider("nav2_capabilities/WaypointRunner")
    assert described is not None
    assert runner_class(described) is Mine
    assert runner_class(described, mode=Mode.SIMULATED) is WaypointRunner


def test_installed_runners_that_do_not_fit(register: list[EntryPoint]) -> None:
    register.append(entry("demo/Grasp", "no_such_module:Runner"))
    assert "cannot be imported: ModuleNotFoundError" in refused(provider())
    register[:] = [entry("demo/Grasp", "os:sep")]
    assert refused(provider()).startswith("the runner demo/Grasp = os:sep is no runner")
    register[:] = [
        entry("demo/Grasp", f"{__name__}:Mine"),
        entry("demo/Grasp", f"{__name__}:Both"),
    ]
    assert refused(provider()).startswith("several installed packages register a runner for")


def test_nobody_registers_in_place_of_a_real_built_in_runner(register: list[EntryPoint]) -> None:
    name = "generic_capabilities/ProcessRunner"
    register.append(entry(name, f"{__name__}:Mine"))
    described = BUILT_IN.provider(name)
    assert described is not None
    assert refused(described).startswith(
        f"the runner {name} = {__name__}:Mine claims {name}, for which gpsfsm has a runner of its "
    )
    assert runner_class(described, mode=Mode.SIMULATED) is simulated.ProcessRunner
    assert len(wrong_registrations(BUILT_IN, [(name, "")])) == 1


@pytest.mark.parametrize("value", ["no_such_module:Runner", "os:sep", "os", "exits_at_once:X"])
def test_a_simulation_leaves_wrong_runners_out_and_says_so(
    value: str, register: list[EntryPoint], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The built-in simulation stays; the note comes once, whatever the plan calls the runner."""
    (tmp_path / "exits_at_once.py").write_text("raise SystemExit(0)\n")
    monkeypatch.syspath_prepend(tmp_path)
    name = "nav2_capabilities/WaypointRunner"
    register.append(entry(name, value))
    described = BUILT_IN.provider(name)
    assert described is not None
    assert runner_class(described, mode=Mode.SIMULATED) is WaypointRunner
    assert refused(described).startswith(f"the runner {name} = {value}")
    (note,) = wrong_registrations(BUILT_IN, [(name, name), (name, ""), ("other/X", "")])
    assert note == refused(described)
    assert wrong_registrations(BUILT_IN, [("other/X", "other/X")]) == []


# -- for drivers ----------------------------------------------------------------------------


LIBRARY = Library(
    (Interface("demo/GraspInterface"),),
    (
        Provider(
            "demo/Grasp",
            "demo/GraspInterface",
            runner="gpsfsm.runners.generic:WaitRunner",
            depends_on=(("demo/Arm", "demo/Arm"),),
        ),
    ),
)


def test_a_maker_makes_new_runners() -> None:
    maker = Maker(LIBRARY)
    first = maker("demo/GraspInterface", "demo/Grasp")
    assert type(first) is generic.WaitRunner
    assert maker("demo/GraspInterface", "demo/Grasp") is not first
    assert type(maker("demo/GraspInterface", "")) is generic.WaitRunner
    assert list(maker.depends_on("demo/GraspInterface", "")) == [("demo/Arm", "demo/Arm")]
    pretending = Maker(LIBRARY, mode=Mode.SIMULATED)
    assert type(pretending("demo/GraspInterface", "demo/Grasp")) is simulated.WaitRunner
    assert list(pretending.depends_on("demo/GraspInterface", "demo/Grasp")) == []


def test_what_a_runner_depends_on_is_looked_for_before_a_run(register: list[EntryPoint]) -> None:
    runners = [("demo/GraspInterface", "demo/Grasp"), ("demo/GraspInterface", "")]
    (problem,) = Maker(LIBRARY).problems(runners)
    assert problem.startswith("nothing is known of demo/Arm")
    register.append(entry("demo/Arm", "os:sep"))
    (problem,) = Maker(LIBRARY).problems(runners)
    assert problem.startswith("the runner demo/Arm = os:sep is no runner")
    register[:] = [entry("demo/Arm", f"{__name__}:Mine")]
    assert Maker(LIBRARY).problems(runners) == []


def test_what_no_file_describes(register: list[EntryPoint]) -> None:
    maker = Maker(LIBRARY)
    with pytest.raises(RunnerError, match="nothing is known of demo/Unknown: no capability file"):
        maker("demo/Unknown", "")
    assert list(maker.depends_on("demo/Unknown", "")) == []
    register.append(entry("demo/Unknown", f"{__name__}:Mine"))
    assert type(maker("demo/Unknown", "")) is Mine
    with pytest.raises(RunnerError, match="nothing is known of demo/Unknown"):
        Maker(LIBRARY, mode=Mode.SIMULATED)("demo/Unknown", "")
