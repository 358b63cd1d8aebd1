"""What the tests of the rules share: small libraries, plans over them, what a rule tells."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import Capabilities, FileDefect, Library
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.capability import (
    Input,
    Interface,
    Output,
    Parameter,
    Provider,
    SemanticInterface,
    Source,
    ValueType,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.finding import Finding

CONFIGURED = (Source.UPSTREAM, Source.CONFIGURATION)
GO = Provider(
    "nav/Go",
    "nav/Go",
    described=True,
    configuration=(
        Parameter("x", ValueType.DOUBLE, required=True, minimum=-10, maximum=10),
        Parameter("y", ValueType.DOUBLE, required=True),
        Parameter("speed", ValueType.DOUBLE, default=0.5, minimum=0, aliases=("velocity",)),
        Parameter("tries", ValueType.INT, default=1, maximum=3),
        Parameter("gait", ValueType.STRING, default="walk", choices=("walk", "creep")),
        Parameter("careful", ValueType.BOOL, default=False),
        Parameter("tags", ValueType.STRINGS, default=""),
        Parameter("note", default=""),
    ),
    outputs=(Output("x", ValueType.DOUBLE), Output("note", optional=True)),
)
SAY = Provider(
    "voice/Say",
    "voice/Say",
    described=True,
    configuration=(Parameter("text", ValueType.STRING, required=True),),
    inputs=(
        Input("text", required=True, satisfiable_from=CONFIGURED),
        Input("mood", satisfiable_from=(Source.EXTERNAL,), aliases=("feeling",)),
        Input("frame"),
    ),
)
HEAR = Provider(
    "voice/Hear", "voice/Hear", described=True, outputs=(Output("text", ValueType.STRING),)
)
LIBRARY = Library(
    interfaces=(
        Interface("nav/Go", formerly=("old_nav/Go", "older_nav/Go")),
        Interface("nav/Crawl", deprecated="use nav/Go with gait creep"),
        Interface("nav/Locate"),
        Interface("voice/Say", formerly=("old_voice/Say",)),
        Interface("voice/Hear", formerly=("old_voice/Hear", "old_voice/Listen")),
        Interface("voice/Sing"),
    ),
    providers=(
        GO,
        replace(GO, name="nav/Run"),
        replace(GO, name="nav/Creep", deprecated="it scratches the floor"),
        Provider("nav/Crawl", "nav/Crawl", described=True),
        Provider("nav/Locate", "nav/Locate"),
        SAY,
        HEAR,
    ),
    semantic=(
        SemanticInterface("bot/Go", "nav/Go"),
        SemanticInterface("bot/Fly", "air/Fly"),
    ),
)
COMPLETE = replace(LIBRARY, complete=True)


def runner(interface: str, words: str = "", provider: str = "") -> str:
    return f'<Runner interface="{interface}" provider="{provider or interface}" {words}/>'


def plan(*steps: str) -> str:
    return "<Plan>\n" + "\n".join(steps) + "\n</Plan>"


def findings(
    code: str,
    *steps: str,
    library: Library = LIBRARY,
    defects: Sequence[str | FileDefect] = (),
    **options: Any,
) -> list[Finding]:
    """What one rule finds in a plan; its first step stands in line 2.

    A defect that is a text concerns no runner.

    ``options`` are those of the analyses: solver, faults, consistent, assumptions.
    """
    check = CheckOptions(
        analysis=AnalysisOptions(**options),
        capabilities=Capabilities(
            library,
            tuple(
                FileDefect(each, "", ("-",)) if isinstance(each, str) else each for each in defects
            ),
        ),
    )
    report = check_text(plan(*steps), "plan.xml", check)
    assert report.facts is not None, report.findings
    return [finding for finding in report.findings if finding.rule == code]


def messages(code: str, *steps: str, library: Library = LIBRARY) -> list[tuple[int, str, str, str]]:
    """Line, severity, message and hint of what one rule finds."""
    return [
        (finding.location.line, str(finding.severity), finding.message, finding.hint)
        for finding in findings(code, *steps, library=library)
    ]


GO_THERE = runner("nav/Go", 'x="1.0" y="2.0"')
HEAR_IT = runner("voice/Hear")


def provider(name: str, *interfaces: str, **entry: Any) -> Provider:
    """A described provider of the interface of its name."""
    (implements,) = interfaces or (name,)
    return Provider(name, implements, described=True, **entry)


def library(*providers: Provider) -> Library:
    """A library of these providers and of the interfaces that they implement."""
    names = dict.fromkeys(provider.implements for provider in providers)
    return Library(interfaces=tuple(Interface(name) for name in names), providers=providers)


def control(control_type: str, *steps: str) -> str:
    """A control around steps, one line each."""
    return "\n".join([f'<Control type="{control_type}">', *steps, "</Control>"])


def story(finding: Finding) -> list[str]:
    """How the plan ends in the scenario of a finding, and the sentences that lead there."""
    assert finding.scenario is not None
    return [str(finding.scenario.ends), *finding.scenario.story]


def places(finding: Finding) -> list[tuple[int, str]]:
    """Line and text of the related places of a finding."""
    return [(related.location.line, related.message) for related in finding.related]
