"""Which class runs a provider; what a capability file names is not trusted."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.library import Library, bind, builtin_capabilities
from gpsfsm.compile import compile_plan
from gpsfsm.execution import registry
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.registry import (
    Maker,
    Mode,
    UndescribedError,
    runner_class,
    wrong_registrations,
)
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.model.capability import Interface, Parameter, Provider, SemanticInterface
from gpsfsm.ros.runner import RosRunner
from gpsfsm.runners import generic
from gpsfsm.runners.generic import simulated
from gpsfsm.runners.navigation.simulated import WaypointRunner
from tests.support import plan_of

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


def refused(actual: Provider, **options: object) -> str:
    with pytest.raises(RunnerError) as caught:
        runner_class(actual, **options)  # type: ignore[arg-type]
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
        chosen = runner_class(described, mode=Mode.SIMULATED)
        assert chosen.__name__ == described.runner.partition(":")[2]


def test_what_exists_only_as_a_simulation_says_so() -> None:
    described = provider("gpsfsm.runners.navigation:WaypointRunner")
    assert refused(described).startswith(
        "demo/Grasp exists only as a simulation: install a package"
    )


def test_what_a_file_describes_on_ros_2_needs_no_code() -> None:
    described = BUILT_IN.provider("nav2_capabilities/WaypointRunner")
    assert described is not None
    assert runner_class(described) is RosRunner
    assert runner_class(described, mode=Mode.SIMULATED).__module__.endswith(".simulated")


@pytest.mark.parametrize(
    ("runner", "message"),
    [
        ("", "no runner is installed for demo/Grasp: its file has neither a section"),
        ("launch/empty.launch.py", "no runner is installed for demo/Grasp: its file names 'lau"),
        ("capabilities2_runner::WaypointRunner", "no runner is installed for demo/Grasp"),
        ("os:system", "the file of demo/Grasp names the runner os:system, and runners from"),
        ("gpsfsm.runnersx:Runner", "the file of demo/Grasp names the runner gpsfsm.runnersx"),
        ("gpsfsm.runners.generic:Path", "demo/Grasp exists only as a simulation"),
        ("gpsfsm.runners.generic.process:os", "gpsfsm.runners.generic.process:os is not a runner"),
        ("gpsfsm.runners.generic:Runner", "gpsfsm.runners.generic:Runner is not a runner"),
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
    assert "is not a runner" in refused(provider("wild_robot:Half"), allow=allow)
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
    assert refused(provider()).startswith("the runner demo/Grasp = os:sep is not a runner")
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
    assert len(wrong_registrations([described])) == 1


@pytest.mark.parametrize("value", ["no_such_module:Runner", "os:sep", "os", "exits_at_once:X"])
def test_a_simulation_leaves_wrong_runners_out_and_says_so(
    value: str, register: list[EntryPoint], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The built-in simulation stays; the note comes once."""
    (tmp_path / "exits_at_once.py").write_text("raise SystemExit(0)\n")
    monkeypatch.syspath_prepend(tmp_path)
    name = "nav2_capabilities/WaypointRunner"
    register.append(entry(name, value))
    described = BUILT_IN.provider(name)
    assert described is not None
    assert runner_class(described, mode=Mode.SIMULATED) is WaypointRunner
    assert refused(described).startswith(f"the runner {name} = {value}")
    (note,) = wrong_registrations([described, provider(), described])
    assert note == refused(described)
    assert wrong_registrations([provider()]) == []


# -- for drivers ----------------------------------------------------------------------------


LIBRARY = Library(
    (Interface("demo/GraspInterface"),),
    (
        Provider(
            "demo/Grasp",
            "demo/GraspInterface",
            runner="gpsfsm.runners.generic:WaitRunner",
            described=True,
            depends_on=(("demo/Arm", "demo/Arm"),),
        ),
        Provider("demo/Silent", "demo/GraspInterface", runner="gpsfsm.runners.generic:WaitRunner"),
    ),
)
ARM = Library((Interface("demo/Arm"),), (Provider("demo/Arm", "demo/Arm", described=True),))


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
    assert problem.startswith("no capability file describes demo/Arm")
    assert Maker(LIBRARY).undescribed(runners) == [("demo/Arm", "demo/Arm")]
    both = LIBRARY.extended(ARM)
    (problem,) = Maker(both).problems(runners)
    assert problem.startswith("no runner is installed for demo/Arm")
    register.append(entry("demo/Arm", "os:sep"))
    (problem,) = Maker(both).problems(runners)
    assert problem.startswith("the runner demo/Arm = os:sep is not a runner")
    register[:] = [entry("demo/Arm", f"{__name__}:Mine")]
    assert Maker(both).problems(runners) == []
    assert len(Maker(LIBRARY).problems(runners)) == 1  # installed, but nobody tells what it does


@pytest.mark.parametrize(
    ("interface", "provider", "missing"),
    [
        ("demo/Unknown", "", "demo/Unknown"),
        ("demo/Unknown", "demo/Unknown", "demo/Unknown"),
        ("demo/Unknown", "demo/Other", "demo/Unknown and demo/Other"),
        ("demo/GraspInterface", "demo/Other", "demo/Other"),
        ("demo/GraspInterface ", "demo/Other", "demo/GraspInterface  and demo/Other"),
    ],
)
def test_what_no_file_describes_is_not_made(
    interface: str, provider: str, missing: str, register: list[EntryPoint]
) -> None:
    """Not even if a package registers it: nothing that it does has been checked."""
    register += [entry(name, f"{__name__}:Both") for name in {interface, provider} - {""}]
    for mode in Mode:
        maker = Maker(LIBRARY, mode=mode)
        with pytest.raises(UndescribedError) as caught:
            maker(interface, provider)
        assert str(caught.value).startswith(f"no capability file describes {missing}, so nothing")
        assert list(maker.depends_on(interface, provider)) == []
        assert maker.undescribed([(interface, provider)]) == [(interface, provider)]


def test_a_file_without_a_definition_does_not_describe(register: list[EntryPoint]) -> None:
    register.append(entry("demo/Silent", f"{__name__}:Mine"))
    with pytest.raises(UndescribedError, match="the file of demo/Silent does not say what it"):
        Maker(LIBRARY)("demo/GraspInterface", "demo/Silent")


@pytest.mark.parametrize("interface", ["a/Say", "demo/Grasp", "demo/GraspInterface ", "demo/Arm"])
def test_a_provider_is_not_made_for_another_interface(
    interface: str, register: list[EntryPoint]
) -> None:
    """Neither the provider, nor what a package registers for the interface."""
    register += [entry("demo/Grasp", f"{__name__}:Mine"), entry(interface, f"{__name__}:Mine")]
    maker = Maker(LIBRARY.extended(Library((Interface("demo/Arm"),))))
    with pytest.raises(RunnerError, match="demo/Grasp implements demo/GraspInterface, not"):
        maker(interface, "demo/Grasp")
    assert list(maker.depends_on(interface, "demo/Grasp")) == []
    assert maker.undescribed([(interface, "demo/Grasp")]) == []
    assert len(maker.problems([(interface, "demo/Grasp")])) == 1


def test_a_maker_makes_what_a_check_has_bound(register: list[EntryPoint]) -> None:
    """A semantic interface keeps its name, so that its remappings hold where it is named."""
    shop = Provider("shop/Picker", "shop/Pick", described=True)
    library = LIBRARY.extended(
        Library(
            providers=(shop,), semantic=(SemanticInterface("shop/Pick", "demo/GraspInterface"),)
        )
    )
    register.append(entry("shop/Picker", f"{__name__}:Mine"))
    keys = [(name, "shop/Picker") for name in ("shop/Pick", "demo/GraspInterface")]
    kernels = [
        Kernel(compile_plan(plan, bindings=bind(plan, library)))
        for plan in (
            plan_of(f'<Plan><Runner interface="{name}" provider="shop/Picker"/></Plan>')
            for name, _ in keys
        )
    ]
    assert [kernel.runners for kernel in kernels] == [(key,) for key in keys]
    assert [dict(kernel.bound) for kernel in kernels] == [{keys[0]: shop}, {}]
    assert type(Maker(library, bound=kernels[0].bound)(*keys[0])) is Mine
    with pytest.raises(RunnerError, match="shop/Picker implements shop/Pick, not"):
        Maker(library, bound=kernels[1].bound)(*keys[1])


def test_one_wrong_use_does_not_unbind_a_right_one() -> None:
    """Two spellings are two runners; the wrong one is not made (only --force gets there)."""
    library = LIBRARY.extended(
        Library(
            providers=(Provider("shop/Picker", "shop/Pick", described=True),),
            semantic=(SemanticInterface("shop/Pick", "demo/GraspInterface"),),
        )
    )
    names = ("shop/Pick", "demo/GraspInterface")
    for order in (names, names[::-1]):
        steps = "".join(f'<Runner interface="{name}" provider="shop/Picker"/>' for name in order)
        plan = plan_of(f"<Plan>{steps}</Plan>")
        bound = Kernel(compile_plan(plan, bindings=bind(plan, library))).bound
        assert [*bound] == [("shop/Pick", "shop/Picker")]


def elsewhere(actual: Provider) -> type[Runner] | None:
    """Whoever else acts: it offers what is called Waypoint or Prompt, and the runner of a demo."""
    offered = ("Waypoint", "PromptText", "Log", "Grasp")
    return Brings if actual.name.rpartition("/")[2].startswith(offered) else None


class Brings(Mine):
    """A runner that needs nothing beside it."""

    brings_dependencies = True


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("nav2_capabilities/WaypointRunner", Brings),
        ("nav2_capabilities/RobotPoseRunner", RosRunner),  # not offered there
        ("generic_capabilities/LogRunner", generic.LogRunner),  # gpsfsm's own, offered or not
    ],
)
def test_what_another_server_offers_acts_there_unless_gpsfsm_has_it(
    name: str, expected: type[Runner]
) -> None:
    assert Maker(BUILT_IN, via=elsewhere).runner_class(name, name) is expected


def test_a_class_that_is_given_comes_before_what_another_server_offers() -> None:
    name = "nav2_capabilities/WaypointRunner"
    assert Maker(BUILT_IN, via=elsewhere, own={name: Mine}).runner_class(name, name) is Mine


def test_what_gpsfsm_has_code_for_is_run_by_it_whatever_the_file_of_a_robot_names() -> None:
    name = "prompt_capabilities/PromptTextRunner"
    described = BUILT_IN.provider(name)
    assert described is not None
    theirs = replace(described, runner="capabilities2_runner::PromptTextRunner")
    library = replace(BUILT_IN, providers=(theirs,))
    chosen = Maker(library, via=elsewhere).runner_class(name, name)
    assert chosen.__module__ == "gpsfsm.runners.prompting"


def test_another_server_starts_what_its_runners_depend_on() -> None:
    grasp = replace(
        provider(),
        depends_on=(("demo/Arm", "demo/Arm"),),
        configuration=(Parameter("x"),),
        described=True,
    )
    library = Library(interfaces=(Interface("demo/GraspInterface"),), providers=(grasp,))
    key = ("demo/GraspInterface", "demo/Grasp")
    assert Maker(library).depends_on(*key) == (("demo/Arm", "demo/Arm"),)
    assert Maker(library, via=elsewhere).depends_on(*key) == ()
