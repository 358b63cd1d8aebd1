"""What the tests of worlds share: plans run in a world, in virtual time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.library import bind, builtin_capabilities
from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Record, RunValue, Status
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.simulation.makers import world_maker, world_services
from gpsfsm.simulation.world import Map, Obstacle, Rectangle, Robot, World
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.runner import Runner
    from gpsfsm.model.plan import Plan
    from gpsfsm.simulation.base import WorldState

LIBRARY = builtin_capabilities().library
_PACKAGES = {
    "Waypoint": "nav2_capabilities",
    "WaypointYaw": "nav2_capabilities",
    "RobotPose": "nav2_capabilities",
    "OccupancyGrid": "nav2_capabilities",
    "Check": "perception_capabilities",
    "ImageAnalysis": "perception_capabilities",
    "Transcribe": "perception_capabilities",
    "Speech": "perception_capabilities",
    "Sentiment": "perception_capabilities",
    "GetCapabilitySpecs": "capabilities2_runner",
    "FabricSetPlan": "fabric_capabilities",
    "FabricGeneratePlan": "fabric_capabilities",
    "FabricCompletion": "fabric_capabilities",
    "Http": "generic_capabilities",
    "Process": "generic_capabilities",
    "Python": "generic_capabilities",
    "Wait": "generic_capabilities",
    "Log": "generic_capabilities",
}


def runner(name: str, **attributes: object) -> str:
    """A runner element of the built-in library, by its short name."""
    package = _PACKAGES.get(name, "prompt_capabilities")
    full = f"{package}/{name}Runner"
    written = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    return f'<Runner interface="{full}" provider="{full}" {written}/>'


def plan(*elements: str) -> str:
    return f"<Plan>{''.join(elements)}</Plan>"


def control(kind: str, *elements: str) -> str:
    return f'<Control type="{kind}">{"".join(elements)}</Control>'


def field_of(*obstacles: Obstacle, **more: Any) -> World:
    """A field of 10 by 10 metres around the robot, which drives 1 m/s and turns at once."""
    robot = Robot(speed=1.0, turn_speed=1e9, **more.pop("robot", {}))
    area = Rectangle(-5.0, -5.0, 5.0, 5.0)
    return World(map=Map(area, 0.1, obstacles), robot=robot, **more)


@dataclass
class Ran:
    """A run that has ended."""

    status: Status
    world: WorldState
    driver: VirtualDriver
    rows: list[tuple[int, Input, Sequence[Record]]]
    outputs: dict[int, Mapping[str, RunValue]] = field(default_factory=dict)
    messages: dict[int, str] = field(default_factory=dict)
    ended_s: dict[int, float] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        return self.driver.now_us() / 1e6

    @property
    def places(self) -> list[tuple[float, float]]:
        return [(x, y) for _, x, y in self.world.arrivals]

    @property
    def said(self) -> list[str]:
        return [said.text for said in self.world.said]


class _Rows(list[tuple[int, Input, "Sequence[Record]"]]):
    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self.append((at_us, happened, records))


def run(
    text: str | Plan,
    world: World,
    *,
    seed: int = 1,
    make: Callable[[str, str], Runner] | None = None,
    prepare: Callable[[VirtualDriver], None] = lambda driver: None,
    state: WorldState | None = None,
    **services: Any,
) -> Ran:
    """Run a plan in a world; ``outputs`` and ``messages`` are by runner number.

    With ``state`` it is the world as a run before has left it.
    """
    parsed = plan_of(text) if isinstance(text, str) else text
    compiled = compile_plan(parsed, bindings=bind(parsed, LIBRARY))
    kernel, rows = Kernel(compiled), _Rows()
    result = world_services(world, LIBRARY, **services)
    if state is not None:
        result["world"] = state
    driver = VirtualDriver(
        kernel, rows, make or world_maker(world, LIBRARY), seed=seed, services=result
    )
    prepare(driver)
    driver.run()
    ran = Ran(kernel.status, result["world"], driver, rows)
    for at_us, happened, _ in rows:
        if happened.kind in (Kind.SUCCEEDED, Kind.FAILED):
            ran.outputs[happened.number] = happened.outputs
            ran.messages[happened.number] = happened.message
            ran.ended_s[happened.number] = at_us / 1e6
    return ran
