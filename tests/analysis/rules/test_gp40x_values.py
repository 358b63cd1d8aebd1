"""GP402 to GP405: values that are lost, overwritten, read by nobody or of another type."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.model.capability import Input, Output, Parameter, Source, ValueType
from gpsfsm.model.event import Event
from tests.analysis.rules.support import (
    control,
    findings,
    library,
    messages,
    places,
    provider,
    runner,
    story,
)

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

TEXT = ValueType.STRING
LIBRARY = library(
    provider("eye/Look", outputs=(Output("text", TEXT), Output("ok", status=True))),
    provider("eye/Glance", outputs=(Output("text", TEXT, optional=True),)),
    provider("eye/Try", outputs=(Output("seen", TEXT), Output("text", TEXT, event=Event.FAILED))),
    provider("eye/Sniff", outputs=(Output("text", TEXT),)),
    provider("eye/Status", outputs=(Output("text", status=True),)),
    provider(
        "eye/Measure",
        outputs=(Output("text", ValueType.DOUBLE), Output("list", ValueType.STRINGS)),
    ),
    provider("base/Drive"),
    provider(
        "voice/Tell",
        configuration=(Parameter("text", TEXT, required=True),),
        inputs=(
            Input(
                "text",
                TEXT,
                required=True,
                satisfiable_from=(Source.UPSTREAM, Source.CONFIGURATION),
            ),
        ),
    ),
    provider("mind/Keep", inputs=(Input("text", TEXT, required=True),)),
    provider("mind/Alias", configuration=(Parameter("words", TEXT, aliases=("text",)),)),
    provider(
        "mind/Want",
        configuration=(Parameter("text", ValueType.INT), Parameter("list", TEXT)),
    ),
)
LOOK, DRIVE = runner("eye/Look"), runner("base/Drive")
ASK, SAY = runner("voice/Tell", 'text="$text"'), runner("voice/Tell", 'text="hello"')
SNIFF, GLANCE, TRY = runner("eye/Sniff"), runner("eye/Glance"), runner("eye/Try")


def findings_of(code: str, *steps: str, **options: Any) -> list[Finding]:
    return findings(code, *steps, library=LIBRARY, **options)


def only(code: str, *steps: str, **options: Any) -> Finding:
    (finding,) = findings_of(code, *steps, **options)
    return finding


# -- GP402 ----------------------------------------------------------------------------------


def test_a_lost_value() -> None:
    assert messages("GP402", LOOK, DRIVE, ASK, library=LIBRARY) == [
        (
            4,
            "error",
            "'$text' is taken literally: the output 'text' of Look at line 2 "
            "does not reach this step, because an output reaches only the direct "
            "successor, here Drive at line 3",
            "put the runner that needs the value right after the one that outputs it",
        )
    ]
    finding = only("GP402", LOOK, DRIVE, ASK)
    assert (finding.location.column, finding.length) == (54, 4)
    assert finding.location.element == "/Plan/Runner[3]"
    assert places(finding) == [(2, "outputs 'text'")]


RECOVERY = "no value passes the end of the recovery at line 3"
PARALLEL = "no value passes the end of the parallel_all at line 2"


@pytest.mark.parametrize(
    ("steps", "giver", "reason"),
    [
        ([LOOK, control("recovery", DRIVE), ASK], "Look at line 2", RECOVERY),
        ([control("parallel_all", LOOK, DRIVE), ASK], "Look at line 3", PARALLEL),
        ([control("parallel_all", LOOK, ASK)], "Look at line 3", PARALLEL),
        (
            [TRY, control("recovery", DRIVE), ASK],
            "Try at line 2",
            "an output reaches only the direct successor, here Drive at line 4",
        ),
        (
            [LOOK, SNIFF, control("recovery", ASK)],
            "Sniff at line 3",
            "it is output only on success, and this step runs after a failure",
        ),
        (
            [LOOK, SNIFF, DRIVE, ASK],
            "Sniff at line 3",
            "an output reaches only the direct successor, here Drive at line 4",
        ),
        (
            [GLANCE, DRIVE, ASK],
            "Glance at line 2",
            "an output reaches only the direct successor, here Drive at line 3",
        ),
    ],
)
def test_where_a_value_gets_lost(steps: list[str], giver: str, reason: str) -> None:
    (finding,) = findings_of("GP402", *steps)
    assert f"the output 'text' of {giver} does not reach this step" in finding.message
    assert finding.message.partition(", because ")[2] == reason


def test_the_giver_that_the_placeholder_names_is_meant() -> None:
    named = runner("voice/Tell", 'text="${eye/Look.text}"')
    assert "of Look at line 2 does" in only("GP402", LOOK, SNIFF, DRIVE, named).message
    assert "of Look at line 4 does" in only("GP402", LOOK, SNIFF, LOOK, DRIVE, named).message


def test_the_giver_right_before_is_meant_before_the_nearest() -> None:
    steps = TRY, control("sequential", SNIFF, control("recovery", DRIVE)), ASK
    assert "of Sniff at line 4 does" in only("GP402", *steps).message
    assert only("GP402", SNIFF, DRIVE, TRY, ASK).message.endswith(
        "the output 'text' of Try at line 4 does not reach this step, because it "
        "is output only on failure, and this step runs after a success"
    )


def test_a_placeholder_with_another_name_is_not_looked_up() -> None:
    assert findings_of("GP402", LOOK, DRIVE, runner("voice/Tell", 'text="{name}"')) != []
    assert findings_of("GP402", LOOK, DRIVE, runner("mind/Alias", 'text="$text"')) == []
    assert findings_of("GP402", LOOK, DRIVE, runner("mind/Want", 'size="$text"')) == []


def test_the_chain_of_starts_loses_what_else_arrives() -> None:
    steps = LOOK, control("parallel_all", DRIVE, ASK)
    assert findings_of("GP402", *steps) == []
    assert only("GP402", *steps, faults=("no-start",)).location.line == 5


@pytest.mark.parametrize(
    "steps",
    [
        [LOOK, ASK],
        [GLANCE, ASK],
        [LOOK, DRIVE, SAY],
        [LOOK, DRIVE, runner("voice/Tell")],  # GP401
        [LOOK, DRIVE, runner("mind/Keep", 'text="$text"')],  # GP401
        [LOOK, runner("lift/Go"), ASK],
        [ASK, LOOK],
        [LOOK, control("recovery", ASK)],  # if it runs, nothing was given
        [LOOK, control("recovery", DRIVE, ASK)],
        [runner("lift/Look"), DRIVE, ASK],
    ],
)
def test_no_value_gets_lost(steps: list[str]) -> None:
    assert findings_of("GP402", *steps) == []


def test_values_of_runs_that_cannot_be_are_not_lost() -> None:
    steps = LOOK, DRIVE, ASK
    for line in (2, 3):
        assert findings_of("GP402", *steps, assumptions=(f"always fails: line {line}",)) == []


# -- GP403 ----------------------------------------------------------------------------------


def test_an_overwritten_literal() -> None:
    assert messages("GP403", LOOK, SAY, library=LIBRARY) == [
        (
            3,
            "warning",
            "the value written for 'text' is always replaced by the output of Look at line 2",
            "remove the attribute if the incoming value is the right one; "
            "otherwise put a step that outputs no such value between the two",
        )
    ]
    finding = only("GP403", LOOK, SAY)
    assert (finding.location.column, finding.length) == (54, 4)
    assert places(finding) == [(2, "outputs 'text'")]
    assert finding.scenario is None


def test_a_literal_that_is_overwritten_sometimes() -> None:
    assert only("GP403", GLANCE, SAY).message.startswith(
        "the value written for 'text' is sometimes replaced by the output of Glance at line 2"
    )


def test_several_values_that_are_overwritten_are_one_finding() -> None:
    steps = runner("eye/Measure"), runner("mind/Want", 'text="1" list="a"')
    finding = only("GP403", *steps)
    assert finding.message == (
        "the values written for 'text' and 'list' are always replaced by the "
        "outputs of Measure at line 2"
    )
    assert places(finding) == [(2, "outputs 'text' and 'list'")]


def test_a_failure_overwrites_too() -> None:
    finding = only("GP403", TRY, control("recovery", SAY))
    assert finding.message.startswith(
        "the value written for 'text' is always replaced by the output of Try at"
    )
    assert story(finding) == [
        "COMPLETED",
        "Try at line 2 fails",
        "Tell (text=hello) at line 4 is running",
    ]


def test_each_unit_of_a_parallel_gets_the_value() -> None:
    steps = LOOK, control("parallel_all", SAY, SAY)
    assert [finding.location.line for finding in findings_of("GP403", *steps)] == [4, 5]
    (finding,) = findings_of("GP403", *steps, faults=("no-start",))
    assert finding.location.line == 4


@pytest.mark.parametrize(
    "steps",
    [
        [LOOK, ASK],
        [LOOK, DRIVE, SAY],
        [LOOK, control("recovery", DRIVE), SAY],
        [LOOK, control("recovery", SAY)],
        [LOOK, runner("mind/Alias", 'text="hello"')],
        [LOOK, runner("lift/Go", 'text="hello"')],
        [runner("lift/Look"), SAY],
        [control("recovery", control("sequential", LOOK, SAY))],
    ],
)
def test_no_literal_is_overwritten(steps: list[str]) -> None:
    assert findings_of("GP403", *steps) == []


def test_a_literal_that_is_never_used_is_not_overwritten() -> None:
    assert findings_of("GP403", LOOK, SAY, assumptions=("always fails: line 2",)) == []


# -- GP404 ----------------------------------------------------------------------------------


def test_an_unused_output() -> None:
    assert messages("GP404", LOOK, library=LIBRARY) == [
        (
            2,
            "info",
            "nothing uses the output of Look at line 2: 'text'",
            "put a runner that uses the value right after it; nothing if only its success matters",
        )
    ]


def test_unused_outputs_are_told_once_per_interface() -> None:
    first, second = findings_of("GP404", LOOK, SNIFF, LOOK, DRIVE, LOOK)
    assert first.message == "nothing uses the output of Look at line 2: 'text' (2 more like this)"
    assert [line for line, _ in places(first)] == [4, 6]
    assert second.message == "nothing uses the output of Sniff at line 3: 'text'"


@pytest.mark.parametrize(
    "steps",
    [
        [LOOK, SAY],
        [LOOK, runner("mind/Keep")],
        [LOOK, control("parallel_all", DRIVE, SAY)],
        [LOOK, runner("lift/Go")],
        [LOOK, DRIVE, ASK],  # GP402
        [LOOK, DRIVE, runner("mind/Keep")],  # GP401
        [TRY, control("recovery", SAY)],
        [TRY, runner("lift/Go")],
        [runner("eye/Status")],
        [DRIVE],
        [runner("lift/Look"), DRIVE],
        [control("recovery", LOOK)],
    ],
)
def test_an_output_is_used_or_cannot_be(steps: list[str]) -> None:
    assert findings_of("GP404", *steps) == []


@pytest.mark.parametrize("faults", [(), ("no-start",)])
def test_who_starts_beside_a_runner_reads_nothing(faults: tuple[str, ...]) -> None:
    # With faults=no-start the second one is triggered by STARTED of the first.
    stranger = runner("lift/Go")
    finding = only("GP404", control("parallel_all", LOOK, stranger), faults=faults)
    assert finding.message == "nothing uses the output of Look at line 3: 'text'"
    assert findings_of("GP404", TRY, control("recovery", stranger), faults=faults) == []
    assert findings_of("GP404", LOOK, stranger, faults=faults) == []


def test_an_alias_reads_nothing() -> None:
    assert only("GP404", LOOK, runner("mind/Alias")).location.line == 2
    assert "'text' and 'list'" in only("GP404", runner("eye/Measure"), DRIVE).message
    # One output that is read is enough.
    assert findings_of("GP404", runner("eye/Measure"), SAY) == []


# -- GP405 ----------------------------------------------------------------------------------


def test_a_mismatched_value() -> None:
    measure, want = runner("eye/Measure"), runner("mind/Want")
    hint = "put a step that outputs no value of this name between the two"
    assert messages("GP405", measure, want, library=LIBRARY) == [
        (
            3,
            "error",
            f"Want at line 3 expects '{name}' of type {wanted}, but Measure at line 2 outputs "
            f"it as {value}",
            hint,
        )
        for name, wanted, value in (("list", "string", "string[]"), ("text", "int", "double"))
    ]
    finding, _ = findings_of("GP405", measure, want)
    assert places(finding) == [(2, "outputs 'list'")]


def test_a_mismatch_behind_a_failure_has_a_scenario() -> None:
    both = control("sequential", LOOK, runner("mind/Want"))
    finding = only("GP405", DRIVE, control("recovery", both))
    assert finding.message == (
        "Want at line 6 expects 'text' of type int, but Look at line 5 outputs it as string"
    )
    assert story(finding) == [
        "COMPLETED",
        "Drive at line 2 fails",
        "Look at line 5 succeeds",
        "Want at line 6 is running",
    ]


@pytest.mark.parametrize(
    ("written", "wanted", "fits"),
    [
        ("double", "string", True),
        ("bool", "string", True),
        ("string[]", "string", False),
        ("int", "double", True),
        ("double", "int", False),
        ("int[]", "double[]", True),
        ("double[]", "int[]", False),
        ("string", "double", False),
        ("bool", "int", False),
        ("", "int", True),
        ("int", "", True),
        ("double[]", "double[]", True),
    ],
)
def test_which_types_fit(written: str, wanted: str, fits: bool) -> None:
    small = library(
        provider("a/Give", outputs=(Output("n", ValueType(written)),)),
        provider("a/Take", inputs=(Input("n", ValueType(wanted)),)),
        provider("a/Set", configuration=(Parameter("n", ValueType(wanted)),)),
        provider("a/Other", inputs=(Input("m", ValueType(wanted)),)),
    )
    give = runner("a/Give")
    for taker in ("a/Take", "a/Set"):
        assert bool(findings("GP405", give, runner(taker), library=small)) != fits
    assert findings("GP405", give, runner("a/Other"), library=small) == []


def test_a_value_that_does_not_arrive_has_no_type() -> None:
    measure, want = runner("eye/Measure"), runner("mind/Want")
    assert findings_of("GP405", measure, control("recovery", DRIVE), want) == []
    assert findings_of("GP405", measure, want, assumptions=("always fails: line 2",)) == []
