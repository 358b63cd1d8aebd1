"""World files as texts (docs/worlds.md)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn

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
