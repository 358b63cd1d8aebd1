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
            Provider(f"a/{name}", implements=f"a/{name}", described=True, **library)
            for name, library in providers.items()
        ),
    )


def subject(*children: str, described: Library = FREE, **options: Any) -> Subject:
    return subject_of(plan(*children), library=described, **options)


def acts(subject: Subject, **fates: tuple[Fate, int] | Fate) -> TimedScenario:
    """A scenario: ``n0=Fate.FAILED``, ``n2=(Fate.SUCCEEDED, 3000)``; the rest is plain."""
    acts_ = list(subject.plain.acts)
    for name, fate_ in fates.items():
        fate, duration_ms = fate_ if isinstance(fate_, tuple) else (fate_, 1_000)
        acts_[int(name[1:])] = Act(fate, duration_ms)
    return TimedScenario(tuple(acts_))


def strange(failure: Failure) -> dict[int, tuple[str, int]]:
    """What is not plain in a scenario that was found."""
    plain = failure.run.subject.plain.acts
    return {
        number: (act.fate.value, act.duration_ms)
        for number, act in enumerate(failure.run.scenario.acts)
        if act != plain[number]
    }


def messages(campaign: Campaign) -> Sequence[tuple[str, str]]:
    return [(failure.broken.name, failure.breach.message) for failure in campaign.failures]
