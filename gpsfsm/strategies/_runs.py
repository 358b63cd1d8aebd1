"""Runs: what befalls each runner instance of a plan, and world files as texts (docs/worlds.md)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

from gpsfsm.execution.runner import seeded
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
    always_alike = seeded(0)  # hypothesis has drawn already
    return subject.mended(TimedScenario(tuple(acts)), always_alike)


_FREE = ((2.0, -0.5), (0.0, 2.0), (-2.0, 0.0), (3.0, 3.0), (-3.0, 3.0), (-3.0, -3.0))
"""Places that no obstacle covers; the robot begins at the origin."""
_NAMES = ("kitchen", "desk", "door", "lab", "store", "office")
_CRATES = ((1.0, 1.0), (-1.5, 1.5), (1.5, -2.0), (-1.0, -2.0), (3.0, 0.5))
_PEOPLE = ("Ada", "Ben", "Cleo")
_THINGS = ("cup", "box")


@st.composite
def worlds(draw: DrawFn) -> str:
    """Draw the content of a world file that reads without an error.

    A field of 10 by 10 metres with the robot in the middle, and perhaps crates, places, people that
    answer, things, sounds, and runners that fail by chance. Shrinks to an empty field.

    >>> from hypothesis import find, settings
    >>> from gpsfsm.simulation.load import read_world
    >>> text = find(worlds(), lambda text: "people" in text, settings=settings(database=None))
    >>> world = read_world(text.encode())
    >>> [person.name for person in world.people], world.places
    (['Ada'], ())
    """
    world: dict[str, Any] = {
        "world": "drawn",
        "map": {"x": [-5, 5], "y": [-5, 5]},
        "robot": {"x": 0, "y": 0, "speed": draw(st.sampled_from([0.5, 0.3, 1.0]))},
    }
    crates = draw(st.lists(st.sampled_from(_CRATES), unique=True, max_size=3))
    if crates:
        world["map"]["obstacles"] = [
            {"name": f"crate {number}", "x": [x - 0.3, x + 0.3], "y": [y - 0.3, y + 0.3]}
            for number, (x, y) in enumerate(crates, start=1)
        ]
    spots = st.sampled_from(_FREE)
    lists = {
        "places": st.lists(st.tuples(st.sampled_from(_NAMES), spots), unique_by=_name, max_size=4),
        "people": st.lists(st.tuples(st.sampled_from(_PEOPLE), spots), unique_by=_name, max_size=2),
        "things": st.lists(st.tuples(st.sampled_from(_THINGS), spots), unique_by=_name, max_size=2),
    }
    for key, entries in lists.items():
        places = [{"name": name, "x": x, "y": y} for name, (x, y) in draw(entries)]
        if places:
            world[key] = places
    for person in world.get("people", ()):
        if draw(st.booleans()):
            person["replies"] = [{"says": draw(st.sampled_from(["Yes.", "No, thank you."]))}]
    if draw(st.booleans()):
        world["sounds"] = [{"text": "a bell rings", "from": draw(st.integers(0, 60))}]
    fails = draw(st.sampled_from([0.0, 0.1, 0.5, 1.0]))
    if fails:
        world["runners"] = {"nav2_capabilities/WaypointRunner": {"fails": fails}}
    return _written(world)


def _name(entry: tuple[str, tuple[float, float]]) -> str:
    return entry[0]


def _written(world: dict[str, Any]) -> str:
    """YAML: one line for each entry, which is JSON and therefore YAML too."""
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in world.items())
