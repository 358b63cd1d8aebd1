"""What a campaign has counted so far, in a file, so that it can go on another day."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from tests.campaigns.batch import Batch

__all__ = ["Counts", "Tally"]


@dataclass(slots=True)
class Tally:
    """The counts of one comparison; ``batches`` is the number of the next batch to draw."""

    batches: int = 0
    cases: int = 0
    unknown: int = 0
    disagreements: int = 0
    seconds: float = 0.0
    labels: Counter[str] = field(default_factory=Counter)

    def add(self, done: Batch) -> None:
        self.cases += done.cases
        self.unknown += done.unknown
        self.disagreements += done.failure is not None
        self.seconds += done.seconds
        self.labels.update(done.labels)


@dataclass(slots=True)
class Counts:
    """All tallies of a campaign with one seed."""

    seed: int
    of: dict[str, Tally] = field(default_factory=dict)

    def tally(self, name: str) -> Tally:
        return self.of.setdefault(name, Tally())

    @classmethod
    def load(cls, file: Path | None, seed: int) -> Counts:
        """The counts in a file, none if there is no file; a ValueError if of another seed."""
        if file is None or not file.exists():
            return cls(seed)
        document = json.loads(file.read_text(encoding="utf-8"))
        if document["seed"] != seed:
            raise ValueError(f"{file} holds the counts of seed {document['seed']}, not of {seed}")
        tallies = {
            name: Tally(**{**each, "labels": Counter(each["labels"])})
            for name, each in document["of"].items()
        }
        return cls(seed, tallies)

    def save(self, file: Path) -> None:
        """Write all counts; what was there is replaced at once or not at all."""
        of = {
            name: {
                "batches": each.batches,
                "cases": each.cases,
                "unknown": each.unknown,
                "disagreements": each.disagreements,
                "seconds": round(each.seconds, 1),
                "labels": dict(sorted(each.labels.items())),
            }
            for name, each in sorted(self.of.items())
        }
        file.parent.mkdir(parents=True, exist_ok=True)
        draft = file.with_suffix(".draft")
        draft.write_text(json.dumps({"seed": self.seed, "of": of}, indent=1), encoding="utf-8")
        draft.replace(file)
