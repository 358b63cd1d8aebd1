"""Admission: what a run refuses before it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.execution.journal import Heading
from gpsfsm.running.admission import Admission, Admitted
from gpsfsm.running.prepare import DRAWN, REAL
from gpsfsm.syntax import DEFAULT_LIMITS

if TYPE_CHECKING:
    from gpsfsm.execution.records import RunValue


def test_a_real_run_refuses_what_its_options_do_not_permit() -> None:
    """The gate says so before anything starts; a simulated run starts nothing."""
    name = "generic_capabilities/ProcessRunner"
    text = f'<Plan><Runner interface="{name}" provider="{name}" command="echo hi"/></Plan>'
    for mode, allowed, admitted in (
        (REAL, [], False),
        (REAL, ["echo"], True),
        (REAL, ["ls"], False),
        (DRAWN, [], True),
    ):
        options: dict[str, RunValue] = {"allow_program": allowed} if allowed else {}
        heading = Heading(b"", mode=mode, options=options)
        admission = Admission(heading, builtin_capabilities(), DEFAULT_LIMITS)
        decision = admission.decide(text, "plan.xml")
        assert isinstance(decision, Admitted) == admitted, (mode, allowed, decision)
