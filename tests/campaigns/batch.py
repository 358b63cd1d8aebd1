"""One batch: cases drawn from one seed, each put to a judge; the first that fails is made small."""

from __future__ import annotations

import hashlib
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.campaigns.base import Pair, UnknownError
from tests.campaigns.registry import all_pairs

__all__ = ["Batch", "Failure", "play", "seed_of"]


@dataclass(frozen=True, slots=True)
class Failure:
    """The smallest case found on which answers differ: its text and what was said."""

    text: str
    said: str


@dataclass(slots=True)
class Batch:
    """What came of a batch. ``cases`` were judged and agreed; ``unknown`` got no answer."""

    pair: str
    seed: int
    number: int
    cases: int = 0
    unknown: int = 0
    seconds: float = 0.0
    labels: Counter[str] = field(default_factory=Counter)
    failure: Failure | None = None


def seed_of(name: str, campaign: int, number: int) -> int:
    """The seed of a batch: a function of the comparison, the campaign's seed and its number."""
    digest = hashlib.sha256(f"{name}:{campaign}:{number}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


def play(name: str, campaign: int, number: int, cases: int) -> Batch:
    """Judge up to ``cases`` cases of a comparison."""
    pair = all_pairs()[name]
    batch = Batch(name, campaign, number)
    began = time.monotonic()
    batch.failure = _played(pair, batch, seed_of(name, campaign, number), cases)
    batch.seconds = time.monotonic() - began
    return batch


def _played(pair: Pair, batch: Batch, start: int, cases: int) -> Failure | None:
    failing: list[Any] = []

    @seed(start)
    @settings(
        max_examples=cases,
        database=None,
        deadline=None,
        derandomize=False,
        print_blob=False,
        report_multiple_bugs=False,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(pair.cases())
    def judged(case: Any) -> None:
        try:
            labels = list(pair.judge(case))
        except UnknownError:
            batch.unknown += 1
        except Exception:
            failing.append(case)
            raise
        else:
            if not failing:
                batch.cases += 1
                batch.labels.update(labels)

    try:
        judged()
    except Exception:
        if not failing:
            raise  # the drawing itself is wrong
        # Hypothesis plays the smallest failing case last.
        return Failure(pair.text(failing[-1]), traceback.format_exc())
    return None
