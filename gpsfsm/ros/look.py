"""The look at a robot before the first goal, for all that the steps of a plan need.

Each runner is started once, as the run does it, and let go of again, so what is missing here would
be missing there: its definition, or a server of that type that can be reached. Then the fields of
each step are compared with the definition that the robot has. Without a robot, the definitions
that are installed have to do.
"""

from __future__ import annotations

import asyncio
import json
import time
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.runner import LoadContext, RunnerError
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import RosKind
from gpsfsm.ros.fields import (
    Request,
    answer_misses,
    answer_type,
    lesser_misses,
    request_type,
    settled,
)
from gpsfsm.ros.messages import as_value, first_definition
from gpsfsm.ros.node import RosError, process_node
from gpsfsm.ros.runner import RosRunner, Services
from gpsfsm.ros.services import published
from gpsfsm.ros.transforms import Transforms

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.ros import RosCall

Key = tuple[str, str]
_LOOK_S = 0.02
_MOST_FRAMES = 20


@dataclass(frozen=True, slots=True)
class Step:
    """A step that ``acts`` on ROS 2, or a runner that such a step depends on.

    ``place`` is its file and line; ``parameters`` are as the plan has them, except for
    ``open_names``, whose values come with the run.
    """

    place: str
    interface: str
    provider: str
    parameters: Mapping[str, RunValue]
    open_names: frozenset[str] = frozenset()
    acts: bool = True

    @property
    def key(self) -> Key:
        """The runner."""
        return self.interface, self.provider


@dataclass(frozen=True, slots=True)
class Miss:
    """Something that a step needs and that is not there; a plan begins without what is a note."""

    place: str
    runner: str
    why: str
    is_note: bool = False

    def __str__(self) -> str:
        """One line for people."""
        note = "note: " if self.is_note else ""
        return f"{self.place}: {note}{self.runner}: {self.why}"


@dataclass(frozen=True, slots=True)
class Sent:
    """The message that a step would send, as JSON; ``later`` are fields that the run fills."""

    place: str
    name: str
    type: str
    message: str
    later: tuple[str, ...]

    def data(self) -> dict[str, Any]:
        """The same for programs."""
        return {**asdict(self), "message": json.loads(self.message)}

    def __str__(self) -> str:
        """One line for people."""
        later = f"; from earlier steps: {', '.join(self.later)}" if self.later else ""
        return f"{self.place}: {self.name} ({self.type}) {self.message}{later}"


@dataclass(slots=True)
class Look:
    """The results of a look: what is missing, and what so many steps would send."""

    steps: int = 0
    misses: list[Miss] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)

    @property
    def stops(self) -> list[Miss]:
        """The misses with which a plan does not begin."""
        return [each for each in self.misses if not each.is_note]

    def add(self, step: Step, whys: Iterable[str], *, is_note: bool = False) -> None:
        """Note what a step lacks, each thing once for each runner."""
        before = {(each.runner, each.why) for each in self.misses}
        for why in whys:
            runner = step.provider or step.interface
            if (runner, why) not in before:
                self.misses.append(Miss(step.place, runner, why, is_note))


async def look(steps: Sequence[Step], services: Services, *, offline: bool = False) -> Look:
    """Look for all that steps need; ``offline``: in the definitions that are installed alone."""
    keys = list(dict.fromkeys(step.key for step in steps))
    rows = await asyncio.gather(*(_reached(services, key, offline) for key in keys))
    results = dict(zip(keys, rows, strict=True))
    result = Look(sum(step.acts for step in steps))
    frames = await asyncio.gather(*(_frames(services, step, offline) for step in steps))
    for step, unseen in zip(steps, frames, strict=True):
        kind, why = results[step.key]
        result.add(step, filter(None, (why, unseen)))
        if kind is not None:
            _compare(step, services.call(*step.key), kind, result)
    return result


async def _reached(services: Services, key: Key, offline: bool) -> tuple[Any, str]:
    """The definition of what a runner calls, None without one, and why it cannot be called."""
    try:
        call = services.call(*key)
    except RunnerError as error:
        return None, str(error)
    try:
        kind = None if call.kind is RosKind.TRANSFORM else first_definition(call.types)[1]
    except RosError as error:
        return None, str(error)
    if offline or call.late:
        return kind, ""
    runner = RosRunner()
    try:
        await runner.start(LoadContext(*key, {"ros": services}))
        if call.kind is RosKind.TOPIC:
            name, _ = first_definition(call.types)
            await published(process_node(), call.name, name, call.wait_s)
        return runner.kind, ""
    except (RunnerError, RosError) as error:
        return kind, str(error)
    finally:
        await runner.stop()


async def _frames(services: Services, step: Step, offline: bool) -> str:
    """The reason why a step cannot look up its transform; "" if it can, or has other frames."""
    try:
        call = services.call(*step.key)
        if call.kind is not RosKind.TRANSFORM or call.late or offline:
            return ""
        pairs = [settled(pair, step.parameters, step.open_names) for pair in call.frames]
        if not all(is_settled for _, is_settled in pairs):
            return ""
        transforms = await asyncio.to_thread(lambda: Transforms.of(process_node()))
    except (RunnerError, RosError):  # the runner cannot be started either
        return ""
    end = time.monotonic() + call.wait_s
    while not any(transforms.pose(str(outer), str(inner)) for (outer, inner), _ in pairs):
        if time.monotonic() > end:
            missing = " or ".join(f"from {outer} to {inner}" for (outer, inner), _ in pairs)
            frames = ", ".join(transforms.frames()[:_MOST_FRAMES]) or "none"
            waited = f"waited {call.wait_s:g} s"
            return clip(f"there is no transform {missing} ({waited}); its frames: {frames}", 1000)
        await asyncio.sleep(_LOOK_S)
    return ""


def _compare(step: Step, call: RosCall, kind: Any, result: Look) -> None:
    """Compare the fields of a step with a definition."""
    if (of_type := request_type(call, kind)) is not None:
        request = Request(of_type, call, step.parameters, step.open_names)
        result.add(step, (f"request: {why}" for why in request.misses))
        filled = str(as_value(request.message))
        type_name = "/".join((*kind.__module__.split(".")[:2], kind.__name__))
        result.sent.append(Sent(step.place, call.name, type_name, filled, tuple(request.later)))
    answer = answer_type(call, kind)()
    result.add(step, answer_misses(answer, call, step.parameters, step.open_names))
    result.add(step, lesser_misses(kind, call), is_note=True)
