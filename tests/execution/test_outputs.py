"""Outputs of runners, also hostile ones."""

from __future__ import annotations

import pytest

from gpsfsm.execution.runner import invalid, taken


class Dictionary(dict[str, str]):
    def items(self) -> object:  # type: ignore[override]
        raise RuntimeError("no")


class Text(str):
    __slots__ = ()

    def __str__(self) -> str:
        raise RuntimeError("no")


def test_values_are_copied() -> None:
    numbers = [1, 2.5, ["a", True]]
    copied = taken({"numbers": numbers})
    numbers.append(3)
    assert copied == {"numbers": [1, 2.5, ["a", True]]}


@pytest.mark.parametrize("outputs", [Dictionary(a="b"), {"a": Text("b")}])
def test_what_breaks_when_it_is_read_is_refused(outputs: object) -> None:
    assert invalid(outputs) == "its outputs cannot be read (RuntimeError)"


@pytest.mark.parametrize("outputs", [5, "a", [1], {1: 2}, {"a": object()}, {"a": float("nan")}])
def test_rubbish_is_refused(outputs: object) -> None:
    assert invalid(outputs)
