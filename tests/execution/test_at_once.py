"""Two instances of one runner that act at once: the test kit finds what gets mixed up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.conformance import ConformanceError, check_runner
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.model.capability import Provider

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext


class OneAtATime(Runner):
    """Fails for the second of two steps."""

    busy = False

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        if self.busy:
            raise RunnerError("I am busy")
        self.busy = True
        try:
            await context.sleep(0.1)
        finally:
            self.busy = False


class MixesUp(Runner):
    """Keeps the parameters of a step where the next one finds them."""

    values: Mapping[str, RunValue]

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        self.values = parameters
        await context.sleep(0.1)
        return dict(self.values)


class Waits(Runner):
    """Lets one step after the other act, and keeps them apart."""

    busy = False

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        while self.busy:
            await context.sleep(0.01)
        self.busy = True
        try:
            await context.sleep(0.1)
        finally:
            self.busy = False
        if context.random.random() < 0.5:
            raise RunnerError(f"no luck {context.random.random()}")
        return {"drawn": context.random.random(), **parameters}


class LocksUp(Waits):
    """Waits for ever for a turn that never comes."""

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> Any:
        while self.busy:
            await context.sleep(1)
        self.busy = True
        await context.sleep(0.1)


class OnlyOnes(Runner):
    """Never ends with anything but what it knows."""

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        await context.sleep(0.1 if parameters.get("x") in (1, None) else float("inf"))


def breach(
    make: type[Runner], parameters: Mapping[str, RunValue] | None = None, **more: Any
) -> str:
    with pytest.raises(ConformanceError) as caught:
        check_runner(make, parameters or {"x": 1}, timeout_s=20, **more)
    return str(caught.value)


REAL = pytest.mark.parametrize("real", [False, True])


@REAL
def test_one_that_fails_because_of_the_other_is_found(real: bool) -> None:
    violation = breach(OneAtATime, real=real)
    assert violation.startswith(
        "of two instances of OneAtATime that act at once the one with {'x': "
    )
    assert "it fails: RunnerError: I am busy, alone it returns None" in violation


def test_parameters_that_get_mixed_up_are_found() -> None:
    for more in ({}, {"other": {"x": 7}}, {"real": False, "seed": 3}):
        violation = breach(MixesUp, **more)
        other = more.get("other", {"x": 2})
        assert f"the one with {{'x': 1}} ends otherwise than alone: it returns {other}" in violation
    assert "it returns {'text': 'a 2'}" in breach(MixesUp, {"text": "a"})


@REAL
def test_one_of_which_the_second_never_ends_is_found(real: bool) -> None:
    with pytest.raises(ConformanceError, match=r"of two instances of LocksUp .* one never ends"):
        check_runner(LocksUp, {}, timeout_s=0.5, real=real)


def test_one_that_waits_for_its_turn_passes_whatever_its_luck() -> None:
    expected = {}
    for seed in range(12):
        text = ""
        try:
            check_runner(Waits, {"x": 1}, seed=seed)
        except ConformanceError as error:
            text = str(error)
            check_runner(Waits, {"x": 1}, seed=seed, expect="fails")
        expected[seed] = text.partition("fails: ")[2][:7]
    assert set(expected.values()) == {"", "no luck"}


def test_one_that_holds_a_resource_may_fail_but_not_mix_up() -> None:
    provider = Provider("demo/Arm", "demo/Arm", resources=("arm",))
    assert check_runner(OneAtATime, {"x": 1}, provider=provider).succeeded
    with_x = Provider("demo/Arm", "demo/Arm", resources=("arm",), outputs=())
    assert "declared" in breach(MixesUp, provider=with_x)


def test_parameters_with_which_it_never_ends_say_nothing() -> None:
    assert check_runner(OnlyOnes, {"x": 1}, timeout_s=20).succeeded
