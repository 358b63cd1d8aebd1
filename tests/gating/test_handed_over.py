"""What a worker tells comes back as it was, and nothing else comes back."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.api import check_options
from gpsfsm.gating import GateOptions, Verdict, gate_text
from gpsfsm.gating.gate_process import MOST_FINDINGS, verdict_of, written
from gpsfsm.model.finding import Severity
from tests.report.samples import SAMPLES

RUNNER = '<Runner interface="a/Go" provider="a/Go"/>'
PLANS = (
    f"<Plan>{RUNNER}</Plan>",
    f'<Plan><Control type="parallel_all">{RUNNER}{RUNNER}</Control></Plan>',
    f'<Plan><Control type="recovery">{RUNNER}</Control></Plan>',
    "<Plan>",
    "\ud800",
    f'<Plan><Runner interface="nav2_capabilities/WaypointRunner" x="1" y="2"/>{RUNNER}</Plan>',
)


@pytest.mark.parametrize("text", PLANS)
@pytest.mark.parametrize("engine", ["paper", "fabric-v2"])
def test_a_verdict_comes_back_as_it_was(text: str, engine: str) -> None:
    check = replace(check_options(engine=engine), trees=False)
    verdict = gate_text(text, "plän.xml", GateOptions(check=check))
    assert verdict_of(written(verdict)) == verdict


@pytest.mark.parametrize("sample", SAMPLES)
def test_every_report_comes_back_as_it_was(sample: str) -> None:
    verdict = gate_text(PLANS[0], "plan.xml")
    for plan in SAMPLES[sample].plans:
        kept = plan if plan.findings else replace(plan, source=None)
        assert verdict_of(written(replace(verdict, report=plan))).report == kept


def test_of_very_many_findings_the_worst_are_kept() -> None:
    verdict = gate_text(PLANS[2], "plan.xml")
    (bad,) = verdict.findings
    mild = replace(bad, severity=Severity.INFO)
    many = (*(mild,) * MOST_FINDINGS, bad, mild)
    actual = verdict_of(written(replace(verdict, findings=many)))
    assert len(actual.findings) == MOST_FINDINGS
    assert actual.findings[-1] == bad
    assert not actual


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths of all values in a JSON value."""
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value if type(value) is list else ())
    )
    return [at, *(place for key, each in inner for place in places(each, (*at, key)))]


WHOLE = json.loads(written(gate_text(PLANS[1], "plan.xml")))
STRANGE = (None, True, -1, 1.5, "", "accepted", [], [1], {}, {"a": 1})


@given(st.sampled_from(places(WHOLE)), st.sampled_from(STRANGE))
@example(("Verdict", 5, "PlanReport", 3), [])  # without findings no text goes along
def test_what_does_not_fit_is_no_verdict(place: tuple[Any, ...], strange: Any) -> None:
    """One value replaced: it is refused, or it fits and all else stays as it is."""
    changed = json.loads(json.dumps(WHOLE))
    if not place:
        changed = strange
    else:
        target = changed
        for key in place[:-1]:
            target = target[key]
        target[place[-1]] = strange
    try:
        verdict = verdict_of(json.dumps(changed).encode())
    except ValueError:
        return
    assert isinstance(verdict, Verdict)
    assert json.loads(written(verdict)) == changed


@given(st.binary(max_size=40))
def test_noise_is_no_verdict(noise: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        verdict_of(noise)


def test_a_deep_nest_is_no_verdict() -> None:
    with pytest.raises(ValueError, match="nested too deeply"):
        verdict_of(b"[" * 100_000)
