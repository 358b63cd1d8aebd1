"""GP207 to GP211, and what holds for all rules about names."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.rules.names import Names, Status, either, near
from gpsfsm.capabilities.library import FileDefect, Library
from gpsfsm.model.capability import Output
from gpsfsm.model.finding import Confidence, Severity
from tests.analysis.rules.support import (
    COMPLETE,
    GO_THERE,
    HEAR,
    HEAR_IT,
    LIBRARY,
    findings,
    messages,
    plan,
    runner,
)
from tests.support import plan_of

# -- GP207 ----------------------------------------------------------------------------------

WRITE = "write the value itself"
TRAVELS = (
    "write the value itself, or put a step that outputs {} right before this "
    "one: a value arrives only from there, and only under the parameter's own "
    "name"
)


def placeholders(*steps: str) -> list[tuple[int, str, str, str, str]]:
    return [
        (
            finding.location.line,
            str(finding.severity),
            str(finding.confidence),
            finding.message,
            finding.hint,
        )
        for finding in findings("GP207", *steps)
    ]


def test_a_placeholder_that_is_used_as_it_is_written() -> None:
    step = runner("voice/Say", 'text="${nav/Go.note}"')
    assert placeholders(GO_THERE, step) == [
        (
            3,
            "error",
            "proved",
            "the placeholder '${nav/Go.note}' is never filled in: Say takes 'text' literally",
            TRAVELS.format("'text'"),
        )
    ]
    number = runner("nav/Go", 'x="$x" y="&lt;the y you want&gt;"')
    assert [(severity, hint) for _, severity, _, _, hint in placeholders(number)] == [
        ("error", TRAVELS.format("'x'")),
        ("error", WRITE),  # nothing gives a y
    ]


def test_a_placeholder_in_longer_text_is_a_guess() -> None:
    assert placeholders(runner("voice/Say", 'text="Hello {name}, $a"')) == [
        (
            2,
            "warning",
            "heuristic",
            "'{name}' in 'text' looks like a placeholder, but is never filled in",
            TRAVELS.format("'text'"),
        )
    ]
    ((_, severity, confidence, _, _),) = placeholders(runner("voice/Say", 'text="Hello ${a}"'))
    assert (severity, confidence) == ("error", "proved")


def test_a_placeholder_that_is_always_overwritten_is_harmless() -> None:
    assert placeholders(HEAR_IT, runner("voice/Say", 'text="$text"')) == [
        (
            3,
            "info",
            "proved",
            "the placeholder '$text' in 'text' is harmless, because a value from "
            "Hear at line 2 always replaces it",
            "remove 'text': the value arrives by its name alone",
        )
    ]


def test_a_placeholder_that_may_be_overwritten() -> None:
    step = runner("nav/Go", 'x="1" y="1" note="$note"')
    expected = (
        "the placeholder '$note' is never filled in: Go takes 'note' literally, "
        "unless a value named 'note' arrives"
    )
    for first, advice in ((GO_THERE, WRITE), (runner("lift/Go"), TRAVELS.format("'note'"))):
        ((line, severity, _, message, hint),) = placeholders(first, step)
        assert (line, severity, message, hint) == (3, "warning", expected, advice)


def test_no_advice_for_a_value_that_cannot_arrive() -> None:
    """Neither what nothing gives, nor what counts only if the plan writes it."""
    outside = runner("voice/Say", 'text="a" mood="$mood"')
    giving = replace(HEAR, outputs=(*HEAR.outputs, Output("mood")))
    changed = replace(LIBRARY, providers=(*LIBRARY.providers[:-1], giving))
    for where in (LIBRARY, changed):
        assert [finding.hint for finding in findings("GP207", outside, library=where)] == [WRITE]


def test_a_placeholder_of_an_undescribed_runner() -> None:
    ((_, severity, confidence, message, hint),) = placeholders(runner("lift/Go", 'to="$floor"'))
    assert (severity, confidence, hint) == ("warning", "heuristic", WRITE)
    assert message == "the placeholder '$floor' is never filled in: Go takes 'to' literally"
    for before, advice in ((runner("nav/Crawl"), TRAVELS.format("'text'")), (HEAR_IT, WRITE)):
        ((*_, hint),) = placeholders(before, runner("lift/Go", 'text="$text"'))
        assert hint == advice


@pytest.mark.parametrize(
    "step",
    [
        runner("voice/Say", 'text="It costs $5." name="$name"'),
        runner("voice/Say", "text='{\"a\": 1}'"),
        runner("voice/Say", 'text="a" volume="$volume"'),
        '<Control type="recovery">' + runner("voice/Say", 'text="$a"') + "</Control>",
    ],
)
def test_no_placeholder_that_matters(step: str) -> None:
    assert placeholders(step) == []


# -- GP208, GP209 ---------------------------------------------------------------------------


def test_another_dialect_is_told_once_per_package() -> None:
    reported = findings(
        "GP208",
        GO_THERE,
        runner("old_voice/Say", 'text="a"'),
        runner("old_voice/Say", 'text="b"'),
        runner("old_voice/Listen"),
        runner("old_nav/Go"),
    )
    assert [(finding.severity, finding.location.line, finding.message) for finding in reported] == [
        (
            Severity.INFO,
            3,
            (
                "the plan mixes dialects: 'old_voice/Say' is another name of "
                "'voice/Say' (and 1 more of this package)"
            ),
        ),
        (Severity.INFO, 6, "the plan mixes dialects: 'old_nav/Go' is another name of 'nav/Go'"),
    ]
    (related,) = reported[0].related
    assert related.location.line == 5
    assert related.message == "'old_voice/Listen' is called 'voice/Hear'"


def test_no_other_dialect() -> None:
    assert messages("GP208", GO_THERE, runner("bot/Go"), runner("lift/Go")) == []


def test_what_is_deprecated_is_told_once() -> None:
    crawl, creep = runner("nav/Crawl"), runner("nav/Go", 'x="1" y="1"', "nav/Creep")
    reported = findings("GP209", GO_THERE, creep, crawl, creep, crawl, crawl)
    assert [(finding.severity, finding.location.line, finding.message) for finding in reported] == [
        (
            Severity.WARNING,
            3,
            "the provider 'nav/Creep' is deprecated: it scratches the floor (and 1 more runner)",
        ),
        (
            Severity.WARNING,
            4,
            "the interface 'nav/Crawl' is deprecated: use nav/Go with gait creep (and 2 more "
            "runners)",
        ),
    ]
    assert [len(finding.related) for finding in reported] == [1, 2]
    assert messages("GP209", GO_THERE) == []


# -- GP210, GP211 ---------------------------------------------------------------------------


def test_undescribed_runners_are_told_once() -> None:
    names = ["lift/Go", "nav/Locate", "bot/Fly", "voice/Sing", "lift/Stop"]
    (finding,) = findings("GP210", GO_THERE, *map(runner, names), runner("lift/Go"))
    assert (finding.severity, finding.location.line) == (Severity.INFO, 3)
    assert finding.message == (
        "no capability file describes 'lift/Go', 'nav/Locate', 'bot/Fly' and 2 "
        "more, so their parameters, outputs and effects are not checked"
    )
    assert [related.location.line for related in finding.related] == [4, 5, 6, 7]
    text = "pass the folder of the robot's capability files with --capabilities DIR"
    assert finding.hint == f"{text}, or write 'bot/Go' if that is what you mean"
    assert messages("GP210", runner("lift/Stop")) == [
        (
            2,
            "info",
            "no capability file describes 'lift/Stop', so its parameters, outputs and effects are "
            "not checked",
            text,
        )
    ]
    assert messages("GP210", GO_THERE, runner("old_nav/Go")) == []


def test_a_complete_library_knows_every_runner() -> None:
    assert messages("GP210", runner("lift/Go"), runner("nav/Go"), library=COMPLETE) == []


def test_defective_capability_files() -> None:
    defects = [f"a.yaml:{line}:1: wrong" for line in range(1, 6)]
    (finding,) = findings("GP211", GO_THERE, defects=defects)
    assert (finding.severity, finding.location.line) == (Severity.WARNING, 1)
    assert finding.message == (
        "the capability files have 5 defects: a.yaml:1:1: wrong; a.yaml:2:1: wrong; "
        "a.yaml:3:1: wrong; and 2 more"
    )
    (finding,) = findings("GP211", GO_THERE, defects=defects[:1])
    assert finding.message == "the capability files have a defect: a.yaml:1:1: wrong"
    assert findings("GP211", GO_THERE) == []


@pytest.mark.parametrize(
    ("file", "names", "concerned"),
    [
        ("", ("nav/Go",), True),  # the interface
        ("", ("Go",), True),  # a file that could not be read, and is called so
        ("", ("arm/Go",), False),
        ("", ("Move",), False),
        ("", (), True),  # nobody knows what it describes
    ],
)
def test_a_defect_that_concerns_a_runner_of_the_plan_is_an_error(
    file: str, names: tuple[str, ...], concerned: bool
) -> None:
    defect = FileDefect("a.yaml:1:1: wrong", file, names)
    (finding,) = findings("GP211", GO_THERE, defects=[defect])
    assert finding.severity is (Severity.ERROR if concerned else Severity.WARNING)
    whose = "of runners of this plan " if concerned else ""
    assert finding.message == f"the capability files {whose}have a defect: a.yaml:1:1: wrong"


# -- all of them ----------------------------------------------------------------------------

NAMES = [
    *("nav/Go", "nav/Run", "nav/Locate", "nav/Jump", "old_nav/Go", "voice/Say", "voice/Sing"),
    *("old_voice/Listen", "vocie/Say", "bot/Go", "bot/Fly", "lift/Go", "Go", "sea/Swim", "/"),
]


@st.composite
def libraries(draw: st.DrawFn) -> Library:
    """A part of the library, complete or not."""

    def some(entries: tuple[object, ...]) -> tuple[object, ...]:
        return tuple(entry for entry in entries if draw(st.booleans()))

    return Library(
        some(LIBRARY.interfaces),  # type: ignore[arg-type]
        some(LIBRARY.providers),  # type: ignore[arg-type]
        some(LIBRARY.semantic),  # type: ignore[arg-type]
        complete=draw(st.booleans()),
    )


@given(
    libraries(),
    st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), min_size=1, max_size=6),
)
def test_every_runner_is_bound_or_told_once(library: Library, pairs: list[tuple[str, str]]) -> None:
    steps = [runner(interface, provider=provider) for interface, provider in pairs]
    parsed = plan_of(plan(*steps))
    unbound = {each.line for each in parsed.runners if library.bind(each) is None}
    lines: list[int] = []
    for code in ("GP201", "GP202", "GP212"):
        for finding in findings(code, *steps, library=library):
            if "spellings of different dialects" not in finding.message:
                lines.append(finding.location.line)
                lines += [related.location.line for related in finding.related]
    names = Names(library)
    undescribed = {
        each.line
        for each in parsed.runners
        if each.line in unbound
        and names.status(each.interface, each.provider) is Status.UNDESCRIBED
    }
    listed = findings("GP210", *steps, library=library)
    assert len(listed) == bool(undescribed)
    for finding in listed:
        assert finding.location.line == min(undescribed)
    assert sorted([*lines, *undescribed]) == sorted(unbound)


def test_many_names_that_nobody_knows() -> None:
    steps = [runner(f"nav/Locate{number}", f'a{number}="1"') for number in range(300)]
    reported = findings("GP201", *steps)
    assert len(reported) == 300
    assert "did you mean" in reported[0].message
    assert reported[-1].message == "no file describes the interface 'nav/Locate299'"


def test_a_heuristic_finding_says_so() -> None:
    guesses = {
        finding.confidence for finding in findings("GP207", runner("voice/Say", 'text="a {b}"'))
    }
    assert guesses == {Confidence.HEURISTIC}


def test_words() -> None:
    assert [either(list("abcdefg")[:count]) for count in (0, 1, 2, 3)] == [
        "",
        "a",
        "a or b",
        "a, b or c",
    ]
    assert either(list("abcdefg")) == "a, b, c, d, e and 2 more"
    assert near("z" * 1000, ["text"]) == ""
    assert near("recievedplan", ["uuid", "ReceivedPlan"]) == "ReceivedPlan"
