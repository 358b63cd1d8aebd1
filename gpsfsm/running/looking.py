"""The look at a robot before a plan begins: the steps of the plan that act on ROS 2.

What is looked at is what a run would do: the runners that it would make, with the values that it
would hand them. Values that earlier steps hand over are open.
"""

from __future__ import annotations

import asyncio
import json
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.kernel import parameters
from gpsfsm.execution.runner import RunnerError
from gpsfsm.model.ros import RosSettings
from gpsfsm.model.story import Vocabulary
from gpsfsm.ros.look import Look, Step, look
from gpsfsm.ros.runner import RosRunner, Services
from gpsfsm.running.admission import Admitted, Refused
from gpsfsm.running.drivers import FROM_COMMAND, Advice, maker_of, real_maker
from gpsfsm.running.prepare import REAL, prepare
from gpsfsm.streams import Form, complain, to_stdout

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.execution.registry import Maker
    from gpsfsm.execution.runner import Runner
    from gpsfsm.generation.service import ModelService
    from gpsfsm.model.capability import Provider
    from gpsfsm.running.prepare import Prepared
    from gpsfsm.running.session import Submission


async def refuse_missing(
    prepared: Prepared,
    model: ModelService | None = None,
    runners: Mapping[str, type[Runner]] | None = None,
    advice: Advice = FROM_COMMAND,
) -> None:
    """Raises GpsfsmError with all that the steps of a plan need and that is not there."""
    result = await look_for(prepared, runners, advice)
    if result.stops:
        real_maker(prepared, model, runners, advice, missing=[str(each) for each in result.stops])


async def look_for(
    prepared: Prepared,
    runners: Mapping[str, type[Runner]] | None = None,
    advice: Advice = FROM_COMMAND,
    *,
    offline: bool = False,
) -> Look:
    """The look for what a plan needs; ``offline``: in the definitions alone. Raises GpsfsmError."""
    maker, _ = maker_of(prepared, runners, advice)
    steps = ros_steps(prepared, maker)
    if not steps:
        return Look()
    settings = RosSettings.of(prepared.heading.options.get("ros"))
    services = Services(settings, prepared.library)
    try:
        return await look(steps, services, offline=offline)
    finally:
        services.topics.close()


def rehearse(submitted: Sequence[Submission], model: Any, *, as_json: bool) -> int:
    """Write what the steps of plans would send, and send nothing.

    The exit code is 2 if one cannot begin. ``model``: anything, if runners may ask one.
    """
    from gpsfsm.running.terminal import worst

    codes = []
    for each in submitted:
        if isinstance(each.decision, Admitted):
            codes.append(_rehearse(each.decision.prepared, model, as_json))
        else:
            codes.append(each.decision.code if isinstance(each.decision, Refused) else 2)
    return worst(codes)


def _rehearse(prepared: Prepared, model: Any, as_json: bool) -> int:
    result = asyncio.run(look_for(prepared))
    for each in result.sent:
        to_stdout(f"{json.dumps(each.data()) if as_json else each}\n", Form.JSON)
    for note in (each for each in result.misses if each.is_note):
        complain(str(note))
    try:
        real_maker(prepared, model, missing=[str(each) for each in result.stops])
    except GpsfsmError as error:
        complain(str(error))
        return 2
    return 0


def check_for_robot(
    path: str, capabilities: Capabilities, settings: Mapping[str, Any], *, offline: bool
) -> int:
    """Write what a plan needs on ROS 2 and is not there: exit code 1 if it would not begin."""
    from gpsfsm.checking.inputs import read_joined
    from gpsfsm.syntax import Limits

    limits = Limits()
    name, content = read_joined(path, limits)
    options: dict[str, Any] = {"ros": settings}
    heading = Heading(plan=content, file=name, mode=REAL, options=options)
    prepared = prepare(heading, capabilities.library, limits)
    result = asyncio.run(look_for(prepared, offline=offline))
    lines = [str(each) for each in result.misses]
    of = len(prepared.compiled.automaton.plan.runners)
    where = "in the definitions that are installed" if offline else "on the robot"
    count = len(result.stops)
    tally = f"{count} {'thing is' if count == 1 else 'things are'}" if count else "nothing is"
    lines.append(f"{name}: {result.steps} of {of} steps act on ROS 2; {tally} missing {where}")
    to_stdout("\n".join(lines) + "\n")
    return 1 if count else 0


def ros_steps(prepared: Prepared, maker: Maker) -> list[Step]:
    """The steps of a plan that act on ROS 2, and behind them the runners that they depend on."""
    kernel, plan = prepared.kernel(), prepared.compiled.automaton.plan
    steps = list[Step]()
    for number, element in enumerate(plan.runners):
        key = kernel.runners[kernel.runner_of[number]]
        if not _is_ros(maker, key):
            continue
        binding = prepared.compiled.bindings[number]
        values = parameters(element, binding, {})
        open_names = _open_names(prepared, number)
        place = f"{element.file or prepared.heading.file}:{element.line}"
        steps.append(Step(place, *key, values, open_names))
    used = {step.key for step in steps}
    for key in maker.with_dependencies(kernel.runners):
        if key not in used and key not in kernel.runners and _is_ros(maker, key):
            names = _names(maker.described(*key))
            steps.append(Step(prepared.heading.file, *key, {}, names, acts=False))
    return steps


def _is_ros(maker: Maker, key: tuple[str, str]) -> bool:
    try:
        return issubclass(maker.runner_class(*key), RosRunner)
    except RunnerError:  # real_maker says so
        return False


def _names(provider: Provider) -> frozenset[str]:
    names = {each.name for each in provider.configuration}
    return frozenset(names.union(each.name for each in provider.inputs))


def _open_names(prepared: Prepared, number: int) -> frozenset[str]:
    """The parameters of an instance whose values the step right before it may hand over."""
    binding = prepared.compiled.bindings[number]
    if binding is None or prepared.compiled.automaton.plan.vocabulary is Vocabulary.TREE:
        return frozenset()  # leaves hand nothing over
    return frozenset(each for each in _names(binding.provider) if not binding.settled(each))
