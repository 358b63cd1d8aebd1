"""What other packages add: of several with one name always the same one, and all names on offer."""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass
from itertools import permutations

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.plugins import find_plugin


@dataclass(frozen=True)
class Entry:
    name: str
    value: str
    loaded: object

    def load(self) -> object:
        return self.loaded


ENTRIES = (Entry("a", "two:A", 2), Entry("b", "x:B", 3), Entry("a", "one:A", 1))


@pytest.mark.parametrize("entries", list(permutations(ENTRIES)))
def test_the_order_of_installation_does_not_matter(
    entries: tuple[Entry, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: entries)
    assert find_plugin("g", "a", int, noun="thing", expected="number") == (1, ("a", "b"))
    assert find_plugin("g", "c", int, noun="thing", expected="number") == (None, ("a", "b"))
    with pytest.raises(UsageError, match=r"^the thing 'b' \(x:B\) is not a text$"):
        find_plugin("g", "b", str, noun="thing", expected="text")
