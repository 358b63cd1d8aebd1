"""Nothing is dropped in silence: what is foreign in an input is told, refused or taken over."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from tests.campaigns.pairs.foreign import PAIRS
from tests.cases import many
from tests.compile.formats.foreign import inserted, judged, machines

if TYPE_CHECKING:
    from tests.campaigns.base import Pair


@pytest.mark.parametrize("text", machines(), ids=range(len(machines())))
def test_what_is_foreign_in_a_machine_is_told_or_refused(text: str) -> None:
    for seed in range(many(60)):
        judged(text, inserted(text, random.Random(seed)))  # noqa: S311


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.name)
def test_what_is_foreign_is_told_refused_or_taken_over(pair: Pair) -> None:
    """The first of 10,000; ``python -m tests.campaigns`` plays the others."""
    for seed in range(many(80)):
        assert list(pair.judge(seed)), pair.text(seed)


@pytest.mark.parametrize(
    ("inside", "rule"),
    [
        ("<Inverter><IsBatteryLow><Go/></IsBatteryLow></Inverter>", "GP805"),
        ('<SetBlackboard name="x"/>', "GP816"),  # it throws
        ("<RateController foo='1'><Go/></RateController>", "GP119"),
        ("<Go/>text", "GP119"),
    ],
)
def test_what_the_campaigns_have_found_in_trees(inside: str, rule: str) -> None:
    tree = f"<ReactiveSequence><Ok/>{inside}</ReactiveSequence>"
    text = f'<root BTCPP_format="4"><BehaviorTree ID="A">{tree}</BehaviorTree></root>'
    (report,) = gpsfsm.check(text).plans
    assert rule in {each.rule for each in report.findings}
