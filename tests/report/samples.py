"""Reports made by hand, which the tests of all formats share."""

from __future__ import annotations

from dataclasses import replace

from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Confidence, Finding, Related, Scenario, Severity, TraceStep
from gpsfsm.model.plan import Location
from gpsfsm.model.report import (
    Dangling,
    Facts,
    Frequency,
    JoinDeadlock,
    PlanReport,
    Report,
    Verdict,
)
from gpsfsm.model.story import remark

PATROL = """\
<Plan>
  <Control type="sequential" name="patrol">
    <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2" x="1.0" y="2.0"/>
    <Control type="parallel_all">
\t<Runner interface="speech/SayRunner" provider="tts" text="guten Tag, 世界"/>
      <Runner interface="camera/PhotoRunner" provider="cam"/>
    </Control>
  </Control>
</Plan>
"""
GO = "/Plan/Control[1]/Runner[1]"
BLOCK = "/Plan/Control[1]/Control[1]"
SAY = f"{BLOCK}/Runner[1]"
PHOTO = f"{BLOCK}/Runner[2]"

DANGLING = Finding(
    rule="GP302",
    name="dangling-failure",
    severity=Severity.WARNING,
    message="if WaypointRunner fails, nothing takes over and the plan gives up",
    location=Location(3, 5, GO),
    hint="put a recovery control right after it",
    length=7,
    scenario=Scenario(
        outcomes=((GO, Outcome.FAILED),),
        ends=End.GAVE_UP,
        trace=(TraceStep(Event.STARTED, GO, 3), TraceStep(Event.FAILED, GO, 3)),
        sentences=tuple(
            map(remark, ("WaypointRunner (line 3) starts.", "It fails.", "The plan gives up."))
        ),
    ),
)
DEADLOCK = Finding(
    rule="GP303",
    name="join-deadlock",
    severity=Severity.WARNING,
    message="this parallel_all waits for ever if one of its units fails",
    location=Location(4, 5, BLOCK),
    hint="guard its units",
    length=8,
    related=(
        Related(Location(5, 2, SAY), "its FAILED is not handled"),
        Related(Location(6, 7, PHOTO)),
    ),
    scenario=Scenario(
        outcomes=((GO, Outcome.SUCCEEDED), (SAY, Outcome.FAILED)),
        ends=End.GAVE_UP,
        trace=(
            TraceStep(Event.STARTED, GO, 3),
            TraceStep(Event.SUCCEEDED, GO, 3),
            TraceStep(Event.STARTED, SAY, 5),
            TraceStep(Event.FAILED, SAY, 5),
        ),
    ),
)
TRUNCATED = Finding(
    rule="GP306",
    name="stuck",
    severity=Severity.ERROR,
    message="the plan can get stuck",
    location=Location(6, 7, PHOTO),
    length=7,
    scenario=Scenario(
        outcomes=((PHOTO, Outcome.HANG),),
        ends=End.STUCK,
        trace=(TraceStep(Event.SUCCEEDED, GO, 3), TraceStep(Event.STARTED, PHOTO, 6)),
        trace_truncated=True,
        sentences=(remark("PhotoRunner (line 6) hangs."),),
    ),
)
GUESSED = Finding(
    rule="GP310",
    name="recovery-holds-goal",
    severity=Severity.WARNING,
    message="the recovery holds what the plan is for",
    location=Location(5, 2, SAY),
    length=7,
    confidence=Confidence.HEURISTIC,
)
MALFORMED = Finding(
    rule="GP101",
    name="malformed-xml",
    severity=Severity.ERROR,
    message="a stray '&' in an attribute value",
    location=Location(1, 24),
    hint="write &amp;",
    length=1,
)
PACKED = Finding(
    rule="GP111",
    name="packed-coordinates",
    severity=Severity.WARNING,
    message="the attribute 'goal' packs two numbers",
    location=Location(1, 15, "/Plan/Runner[1]"),
)
UNREADABLE = Finding(
    rule="GP901",
    name="unreadable-input",
    severity=Severity.ERROR,
    message="no such file",
    location=Location(1, 1),
    hint="check the path",
)

GIVES_UP = PlanReport(
    path="plans/patrol.xml",
    verdict=Verdict.ACCEPTED,
    facts=Facts(
        runners=3,
        completes=Frequency.SOMETIMES,
        gives_up=Frequency.SOMETIMES,
        stuck=Frequency.NEVER,
        dangling=(
            Dangling(GO, Event.FAILED, "give_up"),
            Dangling(SAY, Event.FAILED, "give_up"),
            Dangling(PHOTO, Event.FAILED, "give_up"),
        ),
        join_deadlocks=(JoinDeadlock(BLOCK, "give_up"),),
        fewest_failures_to_give_up=1,
    ),
    findings=(DANGLING, DEADLOCK, GUESSED),
    suppressed=(replace(PACKED, suppressed_by="option"),),
    source=PATROL,
    notes=("took lines 1 to 9",),
)
BROKEN = PlanReport(
    path="plans/über plan.xml",
    verdict=Verdict.REJECTED,
    facts=None,
    findings=(MALFORMED, PACKED),
    source='<Plan><Runner text="tea & cake"></Plan>\n',
)
MISSING = PlanReport(
    path="/absolute/missing.xml",
    verdict=Verdict.UNDECIDED,
    facts=None,
    findings=(UNREADABLE,),
)
SUPPRESSED = replace(
    GIVES_UP,
    findings=(),
    suppressed=(
        replace(PACKED, suppressed_by="comment", justification="the goal {1, 2} is fixed"),
        replace(GUESSED, suppressed_by="option"),
        replace(DEADLOCK, suppressed_by="baseline"),
    ),
)
CLEAN = PlanReport(
    path="-",
    verdict=Verdict.ACCEPTED,
    facts=Facts(
        runners=0,
        completes=Frequency.ALWAYS,
        gives_up=Frequency.NEVER,
        stuck=Frequency.UNKNOWN,
        unreachable=(GO,),
        orphans=(SAY, PHOTO),
    ),
    findings=(),
    source="<Plan/>\n",
)

SAMPLES = {
    "mixed": Report((GIVES_UP, BROKEN, MISSING, CLEAN)),
    "accepted": Report((CLEAN,)),
    "empty": Report(),
    "suppressed": Report((SUPPRESSED,)),
    "truncated": Report((replace(GIVES_UP, findings=(TRUNCATED,), suppressed=()),)),
}
