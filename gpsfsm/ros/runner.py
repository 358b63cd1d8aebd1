"""The runner of everything that a section ``ros`` describes: it needs no code of its own.

The description comes with the library of the run (``Services``), with the names that hold for this
robot. Feedback and the pose of the robot become lines in the journal, at most one a second at first
and fewer later, so that neither a long drive nor a chatty server fills it.
"""

from __future__ import annotations

import asyncio
import math
import operator
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import InDoubtError, LoadContext, RunContext, Runner, RunnerError
from gpsfsm.model.ros import (
    Comparison,
    OnResume,
    RosCall,
    RosKind,
    RosSettings,
    parameter_in,
)
from gpsfsm.ros.actions import CANCELED, SUCCEEDED, Action, ForgottenError, Goal
from gpsfsm.ros.ledger import LEDGER, OURS, Entry, GoalState, Said, Word, goal_id
from gpsfsm.ros.messages import fill, first_definition, has_field, value_at
from gpsfsm.ros.node import Answer, RosError, RosNode, choose, process_node, rclpy_module
from gpsfsm.ros.services import Service, absence, appeared
from gpsfsm.ros.topics import Step, Subscription, Topics, check_conditions
from gpsfsm.ros.transforms import Transforms

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Provider
    from gpsfsm.model.ros import Condition
    from gpsfsm.ros.topics import Silence

    _Sets = tuple[tuple[Condition, ...], ...]

_APART_S = 1.0
"""Between two lines of feedback, at first."""
_SLOWER_S = 60.0
"""From then on they come the less often the longer it takes: a run keeps 1,000 lines of a step, and
feedback and poses of an hour are some 600, those of a day 1,000."""
_DIGITS = 4
_ORDERS: Mapping[Comparison, Callable[[Any, Any], bool]] = {
    Comparison.AT_LEAST: operator.ge,
    Comparison.AT_MOST: operator.le,
    Comparison.ABOVE: operator.gt,
    Comparison.BELOW: operator.lt,
}
_LEAST_S = 0.001
_ACCEPTED_S = 0.5
_LEFT_S = 4.0
"""What the end of a goal of a process before may take."""


@dataclass(frozen=True)
class Services:
    """The services of ROS runners in a run: who does what on the robot.

    ``said`` are the words of a person about goals of a process that has ended, by their ids;
    ``settings`` say where it is: they are those of the node of this process from now on.
    """

    settings: RosSettings
    library: Library
    said: Mapping[str, str] = field(default_factory=dict)
    topics: Topics = field(default_factory=Topics)

    def __post_init__(self) -> None:
        choose(self.settings)

    def resources(self, interface: str, provider: str) -> frozenset[str]:
        """The resources of a runner, by the names of its file."""
        described = self.library.resolve(interface, provider).provider
        return frozenset() if described is None else frozenset(described.resources)

    def call(self, interface: str, provider: str) -> RosCall:
        """The call that a runner makes on this robot. Raises RunnerError if no file says so."""
        resolution = self.library.resolve(interface, provider)
        described = resolution.provider
        if described is None or described.ros is None:
            raise RunnerError(f"no file says what {provider or interface} does on ROS 2")
        call = described.ros
        remappings = list(described.remappings)
        for semantic in self.library.semantic:
            if semantic.name != interface:
                continue
            remappings += semantic.remappings
            if semantic.namespace and not call.name.startswith("/"):
                call = replace(call, name=f"/{semantic.namespace.strip('/')}/{call.name}")
        kinds = {"actions", "services", "topics"}
        for kind, old, new in remappings:
            if kind in kinds and _last_part(old) == _last_part(described.ros.name):
                call = replace(call, name=new)
        return call


class Listening:
    """A watcher of a run, whose subscriptions live as long as it.

    ``runner_class`` gives the class of a runner, by interface and provider.
    """

    def __init__(
        self, services: Services, kernel: Kernel, runner_class: Callable[[str, str], type[Runner]]
    ) -> None:
        self._services, self._kernel, self._runner_class = services, kernel, runner_class
        self._begun = False

    def __call__(self, *_: object) -> None:
        """Subscribe as the run begins, let go as it ends."""
        if self._kernel.status.ended:
            self._services.topics.close()
        elif not self._begun and self._kernel.status is Status.RUNNING:
            self._begun = True
            threading.Thread(target=self._open, name="ros topics").start()

    def _open(self) -> None:
        for key in self._kernel.runners:
            with suppress(GpsfsmError):  # the step that needs it says what is wrong
                if self._runner_class(*key) is not RosRunner:
                    continue
                call = self._services.call(*key)
                if call.kind is RosKind.TOPIC:
                    self._services.topics.of(process_node(), key, call)


def _last_part(name: str) -> str:
    return name.strip("/")


class RosRunner(Runner):
    """Calls an action or a service, or waits for a message or a transform."""

    def __init__(self) -> None:
        self._call = RosCall(RosKind.SERVICE)
        self._node: RosNode | None = None
        self._client: Any = None
        self._kind: Any = None
        self._who = ""
        self._resources: frozenset[str] = frozenset()
        self._said: Mapping[str, str] = {}
        self._there: dict[str, Goal] = {}  # goals of a process before, by their keys
        self._steps: dict[str, Step] = {}  # by the keys of their contexts

    @classmethod
    def unavailable(cls, described: Provider) -> str:
        """The reason why a provider cannot act with what is installed here; "" if it can."""
        try:
            rclpy_module()
            if described.ros is not None and described.ros.types:
                first_definition(described.ros.types)
        except RosError as error:
            return f"{described.name}: {error}"
        return ""

    async def start(self, context: LoadContext) -> None:
        """Find the definitions and the server. Raises RunnerError, which says what is missing."""
        services = context.services.get("ros")
        if not isinstance(services, Services):
            raise RunnerError("a runner of ROS 2 acts in a run with --real only")
        self._call = call = services.call(context.interface, context.provider)
        reads = call.kind in (RosKind.TOPIC, RosKind.TRANSFORM)
        self.idempotent = reads or call.on_resume is OnResume.CONTINUE
        self._node = node = await asyncio.to_thread(process_node)
        self._resources = services.resources(context.interface, context.provider)
        self._said = services.said
        self._who = f"the {call.kind.value} {call.name}"
        try:
            if call.kind is RosKind.TRANSFORM:
                self._client = await asyncio.to_thread(Transforms.of, node)
            elif call.kind is RosKind.ACTION:
                self._client = await self._open_action(services.settings.doubt_s)
            elif call.kind is RosKind.SERVICE:
                self._client = await Service.open(node, call.name, call.types, call.wait_s)
                self._kind = self._client.kind
            else:
                key = context.interface, context.provider
                self._client = await asyncio.to_thread(services.topics.of, node, key, call)
                self._kind = self._client.kind
        except RosError as error:
            raise RunnerError(str(error)) from None

    @property
    def kind(self) -> Any:
        """The definition of what it calls, once it is started; None for a transform."""
        return self._kind

    async def _open_action(self, doubt_s: float) -> Action:
        from rclpy.action import ActionClient

        node, call = self._node, self._call
        assert node is not None
        name, kind = first_definition(call.types)

        def opened() -> Action:
            client = ActionClient(node.handle, kind, node.name(call.name))
            return Action(*(node, client, kind, call), resources=self._resources, doubt_s=doubt_s)

        self._kind = kind
        action = await asyncio.to_thread(node.do, opened)
        try:
            await appeared(
                node,
                action.client.server_is_ready,
                lambda: absence(node, "action", call.name, name, call.wait_s),
                call.wait_s,
            )
        except BaseException:
            await asyncio.to_thread(node.do, action.close)
            raise
        return action

    async def stop(self) -> None:
        """Let go of the client; the node stays for the runs to come."""
        client, self._client = self._client, None
        if isinstance(client, Service):
            await client.close()
        elif isinstance(client, Action) and self._node is not None:
            for goal in self._there.values():
                self._node.call(goal.let_go)
            await asyncio.to_thread(self._node.do, client.close)

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Call it, and hand over what comes back."""
        act = {
            RosKind.ACTION: self._act,
            RosKind.SERVICE: self._ask,
            RosKind.TOPIC: self._listen,
            RosKind.TRANSFORM: self._look_up,
        }[self._call.kind]
        deadline = self._call.deadline_s
        if self._is_done(context):
            return {}
        try:
            async with asyncio.timeout(deadline or None):
                return await act(parameters, context)
        except TimeoutError:
            why = await self._silence(self._steps.get(context.key))
            raise RunnerError(f"{self._who} has not ended within {deadline:g} s{why}") from None
        except RosError as error:
            raise RunnerError(f"{self._who}: {error}") from None
        finally:
            self._steps.pop(context.key, None)

    async def may_repeat(self, key: str) -> bool:
        """True if it is to be followed or sent again, or if a person says that it has succeeded."""
        kind, on_resume, name = self._call.kind, self._call.on_resume, goal_id(key).hex
        if kind is RosKind.ACTION and on_resume is not OnResume.CANCEL:
            goal: Goal = self._client.goal(key)
            if await goal.is_there(_LEFT_S):
                self._there[key] = goal
                return True
        if kind in (RosKind.TOPIC, RosKind.TRANSFORM) or on_resume is not OnResume.ASK:
            return self.idempotent
        if word := self._said.get(name):
            return word != Word.ENDED
        why = "does not know it" if kind is RosKind.ACTION else "cannot be asked"
        raise InDoubtError(
            f"{self._who}: nobody knows what became of {name[:8]}, since its server {why}; look at "
            f"the robot, and add --goal {name[:8]}=succeeded, ended or never (which sends it again)"
        )

    def _is_done(self, context: RunContext) -> bool:
        """True if a person has said that a process before has done it."""
        name = goal_id(context.key).hex
        if context.key in self._there or self._said.get(name) != Word.SUCCEEDED:
            return False
        entry = Entry(name, self._who, state=GoalState.ENDED, how="a person says it has succeeded")
        context.log(*entry.line)
        return True

    async def left(self, key: str) -> str:
        """Cancel the goal that a process which has ended had sent."""
        if self._call.kind not in (RosKind.ACTION, RosKind.SERVICE):
            return ""
        word, problem = self._said.get(goal_id(key).hex), ""
        if self._call.kind is RosKind.ACTION:  # whatever a person says of it
            problem = await self._client.goal(key).cancel_left(_LEFT_S)
        if word:
            ended = "never began" if word == Word.NEVER else f"has {word}"
            return f"{self._who}: a person says that it {ended}"
        if self._call.kind is RosKind.SERVICE:
            raise RunnerError("a request cannot be withdrawn")
        if problem:
            raise InDoubtError(problem)
        return f"{self._who}: its goal was cancelled, or had ended"

    # -- actions ------------------------------------------------------------------------------

    async def _act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        message = self._kind.Goal()
        fill(message, _filled(self._call.request, parameters), self._call.optional)
        feedback, tell = _Feedback(self._call, context), _Lines(context)
        left = self._there.pop(context.key, None)
        goal: Goal = left or self._client.goal(context.key, feedback, tell)
        context.doubt = lambda: goal.doubt
        try:
            if left is not None:
                await goal.follow(message, feedback, tell)
            elif not await goal.send(message):
                raise RunnerError(f"{self._who} has rejected the goal")
            status, result = await goal.result()
        except ForgottenError as error:
            if error.how != "succeeded" or self._call.success or self._call.outputs:
                raise
            return {}
        except InDoubtError:
            goal.abandon()
            raise
        except BaseException:  # no step ends as long as its goal may act
            if goal.withdraw() and (doubt := await goal.cancel(self._client.doubt_s)):
                raise InDoubtError(doubt) from None
            raise
        if status != SUCCEEDED:
            word = "canceled" if status == CANCELED else "aborted"
            raise RunnerError(f"{self._who} was {word}{_reason(self._call, result)}")
        return self._outcome(result, parameters)

    # -- services, topics, transforms ---------------------------------------------------------

    async def _ask(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        values = _filled(self._call.request, parameters)
        entry = Entry(goal_id(context.key).hex, self._who, self._resources, is_request=True)
        OURS.begin(entry, context.log)
        try:
            response = await self._client.ask(
                *(values, 0, self._call.optional),
                may_send=lambda: OURS.take(entry.goal, Said.SENT).may_act,
                answered=lambda: OURS.take(entry.goal, Said.ENDED),
            )
        finally:  # it cannot be withdrawn: without an answer nobody knows what it does
            OURS.cancel(entry.goal)
            OURS.take(entry.goal, Said.SILENT)
        return self._outcome(response, parameters)

    async def _listen(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        node, topic, until = self._node, self._client, self._call.until
        assert node is not None
        feedback = _Feedback(self._call, context)

        def lacks(message: Any) -> str:
            feedback(message)
            return _missed(message, until, parameters)

        def listen() -> Any:
            check_conditions(topic.kind(), until, lambda value: _value(value, parameters))
            if lost := topic.lost():
                line = f"{lost} messages of {topic.name} before this step were too many to be kept"
                context.log(line, {"topic": topic.name, "lost": lost})
            return topic.listen(step)

        step = self._steps[context.key] = Step(lacks)
        answer: Answer[Any] = Answer(node, listen)
        try:
            return self._outcome(await self._heard(answer, step, context), parameters)
        finally:
            node.call(lambda: topic.leave(step))

    async def _heard(self, answer: Answer[Any], step: Step, context: RunContext) -> Any:
        """The message of a step. A silence is journaled once, and at its limit a failure."""
        limit = self._call.silence_s or math.inf
        note = self._call.wait_s or math.inf
        while True:
            left = min(limit, note) + step.heard_s - time.monotonic()
            if not math.isfinite(left):
                return await answer.within(0)
            with suppress(TimeoutError):
                return await answer.within(max(left, _LEAST_S))
            quiet = time.monotonic() - step.heard_s
            if quiet >= limit:
                why = await self._silence(step)
                raise RunnerError(f"{self._who} has been silent for {limit:g} s{why}")
            if quiet >= note:
                note = math.inf
                silence = await self._reason(step)
                data: dict[str, RunValue] = {"topic": silence.topic, "silence": silence.cause.value}
                context.log(f"no message for {self._call.wait_s:g} s: {silence.words()}", data)

    async def _reason(self, step: Step) -> Silence:
        node, topic = self._node, self._client
        assert node is not None
        assert isinstance(topic, Subscription)
        return await asyncio.to_thread(node.do, lambda: topic.silence(step))

    async def _silence(self, step: Step | None) -> str:
        """The reason why a step has no message, after a colon; "" for one that waits for none."""
        return "" if step is None else f": {(await self._reason(step)).words()}"

    async def _look_up(
        self, parameters: Mapping[str, RunValue], _context: RunContext
    ) -> Mapping[str, RunValue]:
        frames = [
            (_value(outer, parameters), _value(inner, parameters))
            for outer, inner in self._call.frames
        ]
        while True:
            for outer, inner in frames:
                pose = self._client.pose(str(outer), str(inner))
                if pose is not None:
                    names = dict(self._call.outputs) or {name: name for name in pose}
                    return {output: pose[field] for output, field in names.items()}
            await asyncio.sleep(0.05)

    # -- what comes back ----------------------------------------------------------------------

    def _outcome(self, message: Any, parameters: Mapping[str, RunValue]) -> Mapping[str, RunValue]:
        """The outputs of a message. Raises RunnerError if it says that nothing came of it."""
        read = {
            name: value_at(message, path)
            for name, path in self._call.outputs
            if has_field(message, path) or path not in self._call.optional
        }
        outputs = {name: value for name, value in read.items() if value is not None}
        if missed := _missed(message, self._call.success, parameters):
            why = _reason(self._call, message)
            raise RunnerError(f"{self._who} answers {missed}{why}", **outputs)
        return outputs


def _missed(message: Any, sets: _Sets, parameters: Mapping[str, RunValue]) -> str:
    """The conditions that keep each of some sets from holding; "" if one holds or there is none."""
    missed = [unmet(message, each, parameters) for each in sets]
    return " and ".join(missed) if all(missed) else ""


def unmet(
    message: Any, conditions: tuple[Condition, ...], parameters: Mapping[str, RunValue]
) -> str:
    """The first condition that a message does not fulfil, as ``field=value``; "" if there is none.

    A value that has not been measured fulfils nothing, nor does a parameter without a value.
    """
    for path, comparison, wanted in conditions:
        try:
            value, operand = value_at(message, path), _value(wanted, parameters)
            if value is None or operand is None or not _holds(value, comparison, operand):
                return f"{path}={'NaN' if value is None else repr(value)}"
        except RosError as error:  # another set of conditions may hold
            return f"{path}: {error}"
    return ""


def _holds(value: RunValue, comparison: Comparison, operand: RunValue) -> bool:
    same = value == operand and isinstance(value, bool) == isinstance(operand, bool)
    if comparison in (Comparison.IS, Comparison.IS_NOT):
        return same == (comparison is Comparison.IS)
    for each in (value, operand):
        if isinstance(each, bool | str | list):
            raise RosError(f"{each!r} cannot be compared by {comparison}: it is not a number")
    return bool(_ORDERS[comparison](value, operand))


class _Lines:
    """Lines of the ledger in the journal; called in any thread.

    ACCEPTED waits a moment: a goal that ends before needs no such line, as its step ends with it,
    and no next goal waits for the disk.
    """

    def __init__(self, context: RunContext) -> None:
        self._context, self._loop = context, asyncio.get_running_loop()
        self._last: Mapping[str, RunValue] = {}

    def __call__(self, text: str, data: Mapping[str, RunValue]) -> None:
        self._last = data
        if data[LEDGER] != GoalState.ACCEPTED:
            self._context.log(text, data)
            return
        later = self._loop.call_later
        with suppress(RuntimeError):  # nobody waits any more
            self._loop.call_soon_threadsafe(later, _ACCEPTED_S, self._write, text, data)

    def _write(self, text: str, data: Mapping[str, RunValue]) -> None:
        if self._last is data and OURS.may_act(str(data["goal"])):
            self._context.log(text, data)


class _Feedback:
    """Feedback as lines of the journal, thinned out; called in the thread of the node."""

    def __init__(self, call: RosCall, context: RunContext) -> None:
        self._call, self._context = call, context
        self._began = time.monotonic()
        self._next = 0.0

    def __call__(self, message: Any) -> None:
        now = time.monotonic() - self._began
        if now < self._next:
            return
        self._next = now + _APART_S * max(1.0, now / _SLOWER_S)
        values: dict[str, RunValue] = {}
        for name, path in self._call.feedback:
            value = _if_there(message, path)
            if value is not None:  # Nav2 may not know yet how far it is
                values[name] = round(value, _DIGITS) if isinstance(value, float) else value
        if values:
            self._context.log("feedback", {"feedback": self._call.name, **values})
        if self._call.pose:
            x, y, yaw = flat(_pose(message, self._call.pose))
            if not math.isfinite(x + y + yaw):
                return
            data: dict[str, RunValue] = {"world": "pose", "x": x, "y": y, "yaw": yaw}
            self._context.log(f"the robot is at ({x}, {y})", data)


def _if_there(message: Any, path: str) -> RunValue | None:
    """A field of what is only told; None if this version, or this message, has none."""
    try:
        return value_at(message, path)
    except RosError:
        return None


def _pose(message: Any, path: str) -> tuple[float, ...]:
    names = ["position.x", "position.y", *(f"orientation.{axis}" for axis in "xyzw")]
    values = [_if_there(message, f"{path}.{name}") for name in names]
    return tuple(each if isinstance(each, int | float) else math.nan for each in values)


def flat(pose: tuple[float, ...]) -> tuple[float, float, float]:
    """A pose on the floor: x, y and the direction, from x, y, qx, qy, qz, qw."""
    x, y, qx, qy, qz, qw = pose
    yaw = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
    return round(x, _DIGITS), round(y, _DIGITS), round(yaw, _DIGITS)


def _reason(call: RosCall, message: Any) -> str:
    """The reason that a result gives for a failure: text and code, as far as there are any."""
    code = _if_there(message, "error_code")
    parts = [str(_if_there(message, call.message) or "") if call.message else ""]
    if code:
        parts.append(f"error code {code}")
    shown = ", ".join(part for part in parts if part)
    return f": {shown}" if shown else ""


def _filled(
    request: tuple[tuple[str, Any], ...], parameters: Mapping[str, RunValue]
) -> dict[str, RunValue]:
    """The fields of a request; a parameter that has no value leaves its field as it is."""
    values = {path: _value(value, parameters) for path, value in request}
    return {path: value for path, value in values.items() if value is not None}


def _value(value: Any, parameters: Mapping[str, RunValue]) -> Any:
    if isinstance(value, str) and value.startswith("$"):
        return parameter_value(*parameter_in(value), parameters)
    if isinstance(value, tuple):
        items = [_value(each, parameters) for each in value]
        if None in items:
            raise RosError("a parameter in a list has no value")
        return items
    return value


def parameter_value(name: str, axis: str, parameters: Mapping[str, RunValue]) -> RunValue | None:
    """The value of a parameter; with an axis, that part of the quaternion of this yaw."""
    value = parameters.get(name)
    if not axis or value is None:
        return value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RosError(f"{name} is no angle in radians: {value!r}")
    return {"qz": math.sin(value / 2), "qw": math.cos(value / 2)}.get(axis, 0.0)
