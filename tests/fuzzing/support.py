"""What the tests of fuzzing share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.library import Library
from gpsfsm.fuzzing import Act, Fate, Subject, TimedScenario, subject_of
from gpsfsm.model.capability import Interface, Provider

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.fuzzing import Campaign, Failure

FREE = Library()
"""Nothing is known of any runner."""


def go(name: str, **parameters: str) -> str:
    words = "".join(f' {key}="{value}"' for key, value in parameters.items())
    return f'<Runner interface="a/{name}" provider="a/{name}"{words}/>'


def control(word: str, *children: str) -> str:
    return f'<Control type="{word}">{"".join(children)}</Control>'


def plan(*children: str) -> str:
    return f"<Plan>{''.join(children)}</Plan>"


def library(**providers: dict[str, Any]) -> Library:
    """A library of runners that ``go`` names."""
    return Library(
        tuple(Interface(f"a/{name}") for name in providers),
        tuple(
            Provider(f"a/{name}", implements=f"a/{name}", described=True, **known)
            for name, known in providers.items()
        ),
    )


def subject(*children: str, known: Library = FREE, **options: Any) -> Subject:
    return subject_of(plan(*children), library=known, **options)


def acts(subject: Subject, **fates: tuple[Fate, int] | Fate) -> TimedScenario:
    """A scenario: ``n0=Fate.FAILED``, ``n2=(Fate.SUCCEEDED, 3000)``; the rest is plain."""
    found = list(subject.plain.acts)
    for name, given in fates.items():
        fate, duration_ms = given if isinstance(given, tuple) else (given, 1_000)
        found[int(name[1:])] = Act(fate, duration_ms)
    return TimedScenario(tuple(found))


def strange(found: Failure) -> dict[int, tuple[str, int]]:
    """What is not plain in a scenario that was found."""
    plain = found.run.subject.plain.acts
    return {
        number: (act.fate.value, act.duration_ms)
        for number, act in enumerate(found.run.scenario.acts)
        if act != plain[number]
    }


def messages(campaign: Campaign) -> Sequence[tuple[str, str]]:
    return [(found.broken.name, found.breach.message) for found in campaign.failures]
