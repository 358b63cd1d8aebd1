"""On an engine the declared outcomes hold as they do on paper: what never fails hangs nothing."""

from __future__ import annotations

import pytest

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.report import Frequency

GO = "nav2_capabilities/WaypointRunner"
NOTE = "prompt_capabilities/PromptTextRunner"
DRIVE = f'<Runner interface="{GO}" provider="{GO}" x="1.5" y="2.5"/>'
SURE = {
    "note": f'<Runner interface="{NOTE}" provider="{NOTE}" text="a" uuid="b" flush="false"/>',
    "wait": '<Runner interface="generic_capabilities/WaitRunner" '
    'provider="generic_capabilities/WaitRunner" seconds="1.5"/>',
    "log": '<Runner interface="generic_capabilities/LogRunner" '
    'provider="generic_capabilities/LogRunner" text="a"/>',
}


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
@pytest.mark.parametrize("name", SURE)
@pytest.mark.parametrize("many", [1, 60])
def test_what_never_fails_hangs_nothing(engine: str, name: str, many: int) -> None:
    """Sixty steps are more than z3 gets: there the decisions are those of the paper."""
    sure = SURE[name]
    recovery = f'<Control type="recovery">{sure}</Control>'
    for text in (f"<Plan>{sure * many}</Plan>", f"<Plan>{(DRIVE + recovery) * many}</Plan>"):
        report = check_text(text, "", CheckOptions(engine=engine))
        assert report.facts is not None
        assert report.facts.engine is not None
        if "GP704" in {finding.rule for finding in report.findings}:
            continue  # another cause
        assert report.facts.completes is Frequency.ALWAYS
        assert report.facts.engine.hangs is Frequency.NEVER
        assert all(each.effect == "dont_care" for each in report.facts.dangling)
        assert "GP302" not in {finding.rule for finding in report.findings}


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_what_can_fail_still_hangs(engine: str) -> None:
    flushed = SURE["note"].replace("false", "true")
    for text in (f"<Plan>{DRIVE}</Plan>", f"<Plan>{flushed}</Plan>"):
        report = check_text(text, "", CheckOptions(engine=engine))
        assert report.facts is not None
        assert report.facts.engine is not None
        assert report.facts.engine.hangs is Frequency.SOMETIMES
