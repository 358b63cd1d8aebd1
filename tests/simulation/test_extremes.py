"""Every built-in runner with the extremes that its file permits: the run is as it was checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.model.capability import ValueType
from gpsfsm.model.report import Frequency
from gpsfsm.simulation.makers import simulated_class
from tests.simulation.support import LIBRARY, field_of, run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.capability import Parameter, Provider
    from gpsfsm.model.report import PlanReport

PROVIDERS = [provider for provider in LIBRARY.providers if simulated_class(provider) is not None]
_GREAT = 2**63 - 1


def extremes(parameter: Parameter) -> list[str]:
    """The values of a parameter that lie at the edge of what the file permits."""
    if parameter.choices:
        return [parameter.choices[0], parameter.choices[-1]]
    if parameter.type is ValueType.BOOL:
        return ["true", "false"]
    if parameter.type not in (ValueType.INT, ValueType.DOUBLE):
        return ["x", "0", "true", "-1", "x" * 5_000]
    least = -_GREAT if parameter.minimum is None else parameter.minimum
    greatest = _GREAT if parameter.maximum is None else parameter.maximum
    results = [least, greatest, *(value for value in (0, 1) if least <= value <= greatest)]
    if parameter.type is ValueType.INT:
        return [str(int(value)) for value in results]
    inside = (
        [] if parameter.minimum is not None or parameter.maximum is not None else ["inf", "1e300"]
    )
    return [repr(float(value)) for value in results] + inside


def checked_as(text: str) -> PlanReport:
    return check_text(text, "plan.xml", check_options())


def plans_with(provider: Provider) -> Iterator[str]:
    """Plans of the runner alone: each parameter at each extreme, the others at their first."""
    parameters = [each for each in provider.configuration if each.name != "plan"]
    first = {each.name: extremes(each)[0] for each in parameters}
    needed = {each.name for each in parameters if each.required and each.default is None}
    needed |= {each.name for each in provider.inputs if each.required}
    for written in (first, {name: first.get(name, "x") for name in needed}):
        yield _plan(provider, written)
    for parameter in parameters:
        for value in extremes(parameter):
            yield _plan(
                provider, {**{name: first.get(name, "x") for name in needed}, parameter.name: value}
            )
            yield _plan(provider, {**first, parameter.name: value})


def _plan(provider: Provider, written: dict[str, str]) -> str:
    attributes = " ".join(f'{name}="{value}"' for name, value in written.items())
    return (
        f'<Plan><Runner interface="{provider.implements}" provider="{provider.name}" '
        f"{attributes}/></Plan>"
    )


@pytest.mark.parametrize("provider", PROVIDERS, ids=lambda actual: actual.name.rpartition("/")[2])
def test_a_run_is_as_it_was_checked(provider: Provider) -> None:
    checked = 0
    for text in dict.fromkeys(plans_with(provider)):
        report = checked_as(text)
        if {"GP205", "GP206"} & {finding.rule for finding in report.findings}:
            continue
        facts = report.facts
        assert facts is not None
        checked += 1
        completed = run(text, field_of())
        ends = {
            "COMPLETED": facts.completes,
            "GAVE_UP": facts.gives_up,
            "STUCK": facts.stuck,
        }
        assert ends[completed.status.value] is not Frequency.NEVER, (
            text,
            completed.status,
            completed.messages,
        )
        if facts.makespan is not None:
            assert facts.makespan.min - 1e-6 <= completed.seconds, text
            assert facts.makespan.max is None or completed.seconds <= facts.makespan.max + 1e-6, (
                text
            )
    assert checked


@pytest.mark.parametrize("seconds", ["inf", "nan", "1e12", "1.1e9", "-1", "-inf"])
def test_a_wait_that_no_run_could_keep_is_refused(seconds: str) -> None:
    wait = "generic_capabilities/WaitRunner"
    text = f'<Plan><Runner interface="{wait}" provider="{wait}" seconds="{seconds}"/></Plan>'
    rules = {finding.rule for finding in checked_as(text).findings}
    assert rules & {"GP205", "GP206"}  # GP205: not a finite number
    assert run(text, field_of()).status == "COMPLETED"  # and it never fails all the same


def test_the_longest_wait_is_waited_for() -> None:
    wait = "generic_capabilities/WaitRunner"
    text = f'<Plan><Runner interface="{wait}" provider="{wait}" seconds="1e9"/></Plan>'
    assert not [finding for finding in checked_as(text).findings if finding.rule == "GP206"]
    completed = run(text, field_of())
    assert (completed.status, completed.seconds) == ("COMPLETED", 1e9)
