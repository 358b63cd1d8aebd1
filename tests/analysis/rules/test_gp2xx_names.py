"""GP201, GP202 and GP212: interfaces and providers that do not exist, or not together."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gpsfsm.model.capability import Provider
from tests.analysis.rules.support import COMPLETE, GO_THERE, LIBRARY, findings, messages, runner

# -- GP201 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interface", "message", "hint"),
    [
        (
            "nav/Say",
            "there is no interface 'nav/Say'; did you mean 'voice/Say'?",
            "write 'voice/Say'",
        ),
        (
            "nav/Goo",
            "there is no interface 'nav/Goo'; did you mean 'nav/Go' or 'bot/Go'?",
            "write 'nav/Go'",
        ),
        ("voice/say", "there is no interface 'voice/say'; did you mean 'voice/Say'?", None),
        (
            "nav/Teleport",
            "no file describes the interface 'nav/Teleport'",
            "use one of 'nav': nav/Crawl, nav/Go, nav/Locate",
        ),
        (
            "voice/Listen",
            "there is no interface 'voice/Listen'; did you mean 'voice/Hear'?",
            "write 'voice/Hear'",
        ),
        (
            "nav/&#x202e;",
            "no file describes the interface 'nav/\\u202e'",
            "use one of 'nav': nav/Crawl, nav/Go, nav/Locate",
        ),
    ],
)
def test_an_interface_that_does_not_exist(interface: str, message: str, hint: str | None) -> None:
    ((line, severity, text, advice),) = messages("GP201", runner(interface))
    library = "error" if text.startswith("there is no") else "warning"
    assert (line, severity, text) == (2, library, message)
    assert advice == (hint or advice)


def test_a_provider_that_is_written_as_an_interface() -> None:
    assert messages("GP201", runner("nav/Run", 'x="1" y="1"')) == [
        (
            2,
            "error",
            "there is no interface 'nav/Run'; that is a provider of 'nav/Go'",
            "write 'nav/Go'",
        )
    ]
    other = Provider("legs/Hop", "nav/Go", described=True)
    changed = replace(LIBRARY, providers=(*LIBRARY.providers, other))
    ((_, severity, message, _),) = messages("GP201", runner("legs/Hop"), library=changed)
    assert (severity, message) == (
        "error",
        "there is no interface 'legs/Hop'; that is a provider of 'nav/Go'",
    )


def test_an_interface_is_told_once() -> None:
    (finding,) = findings(
        "GP201",
        GO_THERE,
        runner("nav/Jump"),
        runner("nav/Jump", 'x="1"', provider="nav/Jumper"),
        runner("nav/Jump"),
    )
    assert finding.message == "no file describes the interface 'nav/Jump' (and 2 more runners)"
    assert (finding.location.line, finding.location.column, finding.length) == (3, 9, 9)
    assert [related.location.line for related in finding.related] == [4, 5]


def test_a_hint_comes_from_all_packages_of_a_complete_library() -> None:
    assert messages("GP201", runner("sea/Swim"), library=COMPLETE) == [
        (
            2,
            "error",
            "there is no interface 'sea/Swim'",
            "run 'gpsfsm capabilities list' to see all interfaces",
        )
    ]


@pytest.mark.parametrize("interface", ["vocie/Say", "Say", "voices/Hear", "old_vioce/Listen"])
def test_a_package_that_is_nearly_known(interface: str) -> None:
    ((_, severity, message, _),) = messages("GP201", runner(interface))
    assert severity == "warning"
    meant = "voice/Say" if interface.endswith("Say") else "voice/Hear"
    assert message == f"no file describes the interface '{interface}'; did you mean '{meant}'?"


@pytest.mark.parametrize(
    "interface", ["nav/Go", "old_nav/Go", "bot/Go", "bot/Fly", "lift/Go", "vocie/Shout", "Swim"]
)
def test_an_interface_that_may_exist(interface: str) -> None:
    assert messages("GP201", runner(interface)) == []


def test_a_missing_interface_is_left_to_gp107() -> None:
    step = '<Runner interface=" " provider="nav/Go"/>'
    assert [messages(code, step) for code in ("GP201", "GP202", "GP210")] == [[], [], []]
    step = '<Runner interface="nav/Go"/>'
    assert [messages(code, step) for code in ("GP201", "GP202", "GP210")] == [[], [], []]


# -- GP202 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interface", "provider", "severity", "message", "hint"),
    [
        (
            "nav/Go",
            "voice/Say",
            "error",
            "'voice/Say' implements 'voice/Say', not 'nav/Go'; 'nav/Go', 'nav/Creep' or 'nav/Run' "
            "does",
            "write 'nav/Go'",
        ),
        (
            "old_nav/Go",
            "old_voice/Listen",
            "error",
            "'old_voice/Listen' implements 'voice/Hear', not 'nav/Go'; 'nav/Go', 'nav/Creep' or "
            "'nav/Run' does",
            "write 'nav/Go'",
        ),
        (
            "voice/Say",
            "voice/Loud",
            "error",
            "there is no provider 'voice/Loud'; 'voice/Say' implements 'voice/Say'",
            "write 'voice/Say'",
        ),
        (
            "voice/Sing",
            "voice/Say",
            "error",
            "'voice/Say' implements 'voice/Say', not 'voice/Sing'",
            "name a provider of this interface; no capability file describes one",
        ),
        (
            "voice/Say",
            "voices/Say",
            "warning",
            "no file describes the provider 'voices/Say'; did you mean 'voice/Say'?",
            "write 'voice/Say'",
        ),
        (
            "nav/Go",
            "old_nav/Go",
            "warning",
            "the interface is 'nav/Go' but the provider is 'old_nav/Go': these "
            "names belong to different dialects",
            "write 'nav/Go'",
        ),
        (
            "old_nav/Go",
            "nav/Go",
            "warning",
            "the interface is 'old_nav/Go' but the provider is 'nav/Go': these "
            "names belong to different dialects",
            "write 'nav/Go'",
        ),
        (
            "old_nav/Go",
            "older_nav/Go",
            "warning",
            "the interface is 'old_nav/Go' but the provider is 'older_nav/Go': "
            "these names belong to different dialects",
            "write 'nav/Go'",
        ),
    ],
)
def test_a_wrong_provider(
    interface: str, provider: str, severity: str, message: str, hint: str
) -> None:
    step = runner(interface, 'x="1" y="2" text="a"', provider)
    assert messages("GP202", step) == [(2, severity, message, hint)]


@pytest.mark.parametrize(
    ("interface", "provider"),
    [
        ("nav/Go", "nav/Go"),
        ("nav/Go", "nav/Run"),
        ("old_nav/Go", "old_nav/Go"),
        ("bot/Go", "bot/Go"),
        ("nav/Go", "lift/Go"),
        ("nav/Locate", "nav/Locate"),
        ("voice/Sing", "voice/Sing"),
        ("voice/Hear", "old_voice/Listen"),
        ("lift/Go", "nav/Go"),
    ],
)
def test_a_provider_that_may_be_right(interface: str, provider: str) -> None:
    assert messages("GP202", runner(interface, provider=provider)) == []


def test_every_provider_of_a_complete_library_is_known() -> None:
    ((_, severity, message, _),) = messages(
        "GP202", runner("nav/Go", provider="lift/Go"), library=COMPLETE
    )
    assert severity == "error"
    assert message.startswith("there is no provider 'lift/Go'; ")
    assert [line for line, *_ in messages("GP202", runner("voice/Sing"), library=COMPLETE)] == [2]


def test_a_provider_is_told_once() -> None:
    steps = [runner("nav/Go", f'x="{number}"', "voice/Say") for number in range(30)]
    (finding,) = findings("GP202", *steps)
    assert finding.message.endswith(" (and 29 more runners)")
    assert [related.location.line for related in finding.related] == list(range(3, 23))


# -- GP212 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "interface",
    ["lift/Go", "nav/Go ", " nav/Go", "n\u0430v/Go", "nav/Jump", "vocie/Say", "bot/Fly", "NAV/GO"],
)
@pytest.mark.parametrize("provider", ["nav/Go", "nav/Locate", "old_nav/Go"])
def test_an_unknown_interface_with_the_provider_of_another_one(
    interface: str, provider: str
) -> None:
    """Also where the interface alone would be a guess (GP201) or be left unjudged (GP210)."""
    step = runner(interface, 'x="1" y="1"', provider=provider)
    actual = messages("GP201", step) + messages("GP202", step) + messages("GP212", step)
    assert len(actual) == 1
    assert actual[0][1] == "error"
    assert messages("GP210", step) == []


def test_what_the_provider_implements_is_told() -> None:
    step = runner("lift/Say", provider="nav/Run")
    (first,) = findings("GP212", GO_THERE, step, step)
    assert first.message == (
        "no file describes the interface 'lift/Say', but its provider 'nav/Run' "
        "implements 'nav/Go' (and 1 more runner)"
    )
    assert first.hint == "write 'nav/Go', or name a provider of 'lift/Say'"
    assert (first.location.line, first.location.column, first.length) == (3, 9, 9)
    assert [related.location.line for related in first.related] == [4]


@pytest.mark.parametrize(
    ("interface", "provider"),
    [("lift/Go", "lift/Go"), ("lift/Go", "lift/Motor"), ("nav/Go", "nav/Go"), ("lift/Go", " ")],
)
def test_names_that_nobody_knows_are_no_mismatch(interface: str, provider: str) -> None:
    assert messages("GP212", runner(interface, provider=provider)) == []


def test_a_provider_whose_interface_has_no_file() -> None:
    """Its own file says that it implements just this one: the file of that is what is missing."""
    lifts = Provider("lift/Motor", "lift/Go", described=True)
    changed = replace(LIBRARY, providers=(*LIBRARY.providers, lifts))
    step = runner("lift/Go", provider="lift/Motor")
    assert messages("GP212", step, library=changed) == []
    assert [severity for _, severity, _, _ in messages("GP201", step, library=changed)] == ["error"]
