"""Which capabilities a task is likely to need, for models that cannot read about all of them.

Words of the task are compared with the names and descriptions of the capabilities. That is crude
and needs no model: it decides what is left out when there is no room, and nothing else.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.generation.prompts.offer import Offer

__all__ = ["ranked"]

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[^\W\d_a-zA-Z]+")
_PLACE = re.compile(r"\(\s*[-+]?\d+(?:\.\d*)?\s*,\s*[-+]?\d+(?:\.\d*)?\s*[,)]")
_STEM = 5
_IN_NAME, _IN_TEXT = 3.0, 1.0
_COORDINATES = 5.0

_ALIKE = (
    "move go drive travel navigate visit return bring waypoint position place location reach",
    "say speak speech tell announce greet inform voice talk",
    "listen hear transcribe audio speech ask answer",
    "look see watch image picture camera photo inspect view describe find detect recognise",
    "wait pause sleep delay second minute",
    "plan replan generate",
    "pose orientation where",
    "map occupancy grid obstacle",
    "mood sentiment feeling happy sad",
    "prompt ask think decide reason model",
    "web http url request server",
    "program command script process run",
)
_GROUPS = tuple(frozenset(word[:_STEM] for word in words.split()) for words in _ALIKE)
_COMMON = frozenset(
    word
    for words in (
        "a an the to of and or in on at it is be then if not can cannot for with from this that",
        "all as by runner robot capabilities",
    )
    for word in words.split()
)


def ranked(task: str, offered: Sequence[Offer]) -> tuple[Offer, ...]:
    """The offers, what fits the task best first; by name where nothing tells them apart."""
    names = [Counter(_stems(offer.name)) for offer in offered]
    texts = [Counter(_stems(_text(offer))) for offer in offered]
    rarity = _rarity([{*name, *text} for name, text in zip(names, texts, strict=True)])
    wanted = _wanted(task)
    coordinates = _PLACE.search(task) is not None

    def score(place: int) -> float:
        found = sum(
            rarity[stem] * (_IN_NAME * (stem in names[place]) + _IN_TEXT * (stem in texts[place]))
            for stem in wanted
            if stem in rarity
        )
        if coordinates and _has_coordinates(offered[place]):
            found += _COORDINATES
        return found

    order = sorted(
        range(len(offered)), key=lambda place: (-round(score(place), 9), offered[place].name, place)
    )
    return tuple(offered[place] for place in order)


def _text(offer: Offer) -> str:
    provider = offer.provider
    parameters = (f"{found.name} {found.description}" for found in provider.configuration)
    return " ".join((offer.interface.description, provider.description, *parameters))


def _stems(text: str) -> Iterable[str]:
    for match in _WORD.finditer(text):
        word = match.group().lower()
        if word not in _COMMON:
            yield word[:_STEM]


def _wanted(task: str) -> list[str]:
    """The words of the task and what means about the same, sorted so that sums are reproducible."""
    found = set(_stems(task))
    for group in _GROUPS:
        if found & group:
            found |= group
    return sorted(found)


def _rarity(documents: Sequence[set[str]]) -> dict[str, float]:
    """A word that few descriptions have tells more."""
    counts = Counter(stem for stems in documents for stem in stems)
    return {stem: math.log(1 + len(documents) / count) for stem, count in counts.items()}


def _has_coordinates(offer: Offer) -> bool:
    names = {found.name for found in offer.provider.configuration if found.required}
    return {"x", "y"} <= names
