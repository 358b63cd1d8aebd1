"""Scenarios with times: what befalls each runner instance of a plan."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.fuzzing.subject import Subject, TimedScenario, subject_of

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

    from gpsfsm.fuzzing.subject import Act
    from gpsfsm.model.plan import Plan

_SECONDS = (1, 2, 3, 5, 8, 20)


def scenarios(
    plan: str | Plan | Subject, *, max_faults: int | None = None
) -> SearchStrategy[TimedScenario]:
    """Draw what ``gpsfsm.fuzzing.play`` plays.

    A ``Subject`` (``gpsfsm.fuzzing.subject_of``) says which faults there are, what an action may
    take, what is known of the runners, and what is assumed; a plan alone stands for its subject by
    default. Shrinks to a scenario in which everything succeeds and takes a second.

    >>> from hypothesis import find, settings
    >>> from gpsfsm.fuzzing import play, subject_of
    >>> go = '<Runner interface="a/Go" provider="a/Go"/>'
    >>> subject = subject_of(f'<Plan>{go}{go}</Plan>')
    >>> stops = lambda scenario: play(subject, scenario).status == "GAVE_UP"
    >>> found = find(scenarios(subject), stops, settings=settings(database=None))
    >>> [(str(act.fate), act.duration_ms) for act in found.acts].count(("SUCCEEDED", 1000))
    1
    """
    subject = plan if isinstance(plan, Subject) else subject_of(plan)
    return _scenarios(subject, max_faults)


@st.composite
def _scenarios(draw: DrawFn, subject: Subject, max_faults: int | None) -> TimedScenario:
    left = len(subject.fates) if max_faults is None else max_faults
    acts: list[Act] = []
    for number, fates in enumerate(subject.fates):
        fate = draw(st.sampled_from(fates)) if left else fates[0]
        left -= fate is not fates[0]
        # within what is declared
        acts.append(subject.act(number, fate, draw(st.sampled_from(_SECONDS)) * 1_000))
    always_alike = random.Random(0)  # noqa: S311  (hypothesis has drawn already)
    return subject.mended(TimedScenario(tuple(acts)), always_alike)
