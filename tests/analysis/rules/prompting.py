"""What the tests of the rules on prompt buffers share: a library, steps over it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.model.capability import (
    Effects,
    Input,
    Outcomes,
    Output,
    Parameter,
    PromptBuffer,
    ValueType,
)
from tests.analysis.rules.support import findings, library, provider, runner

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

TEXT = ValueType.STRING
BUFFER = (Parameter("uuid", TEXT, default=""), Parameter("flush", ValueType.BOOL, default=False))
LIBRARY = library(
    provider(
        "model/Note",
        configuration=BUFFER,
        outcomes=Outcomes(never_fails=True, unless=(("flush", True),)),
        effects=Effects(prompt_buffer=PromptBuffer("uuid", "flush")),
    ),
    provider(
        "model/Plan",
        configuration=BUFFER,
        outputs=(Output("plan", TEXT),),
        effects=Effects(prompt_buffer=PromptBuffer("uuid", "flush", "plan")),
    ),
    provider(
        "robot/Follow",
        inputs=(Input("plan", TEXT, required=True),),
        effects=Effects(sets_plan="plan"),
    ),
    provider("robot/Read", inputs=(Input("plan", TEXT),)),
    provider("robot/Drive"),
    provider("eye/Name", outputs=(Output("uuid", TEXT),)),
    provider("eye/Key", outputs=(Output("flush", ValueType.BOOL),)),
)
DRIVE, FOLLOW, READ = runner("robot/Drive"), runner("robot/Follow"), runner("robot/Read")
NAME, KEY, STRANGER = runner("eye/Name"), runner("eye/Key"), runner("lift/Go")
FILL, FILL_B = runner("model/Note", 'uuid="a"'), runner("model/Note", 'uuid="b"')
FLUSH = runner("model/Plan", 'uuid="a" flush="true"')
FLUSH_B = runner("model/Plan", 'uuid="b" flush="true"')
LONE = runner("model/Plan", 'flush="true"')
ASK = runner("model/Plan")  # neither uuid nor flush


def findings_of(code: str, *steps: str, **options: Any) -> list[Finding]:
    return findings(code, *steps, library=LIBRARY, **options)


def only(code: str, *steps: str, **options: Any) -> Finding:
    (finding,) = findings_of(code, *steps, **options)
    return finding


def lines(code: str, *steps: str, **options: Any) -> list[int]:
    return [finding.location.line for finding in findings_of(code, *steps, **options)]
