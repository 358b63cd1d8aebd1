"""Whether the rows of a journal are as they were written: followed one by one as they are read."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.journal_rows import chained, wall_chained

if TYPE_CHECKING:
    from gpsfsm.execution.journal_marks import Ending, Mark

__all__ = ["ANY", "Chain", "Recorded"]

ANY = sys.maxsize


@dataclass(slots=True)
class Chain:
    """The chains of hashes of one run, or of the plan queue, up to some row.

    ``path`` and ``what`` are for messages: what a row is called and of what it is one. ``count`` is
    the number of the last row, ``link`` and ``wall_link`` are the links there. Rows up to ``bare``
    may be of the first form, without a second chain.
    """

    path: str
    what: tuple[str, str]
    link: bytes
    wall_link: bytes
    bare: int = 0
    count: int = 0
    ended: str = ""

    def take(
        self,
        seq: int,
        text: str,
        wall_us: int,
        hashes: tuple[bytes, bytes],
        provider: str | None = None,
    ) -> None:
        """Go on to the next row; ``provider`` is what its line leaves out, None for nothing.

        Raises DamagedJournalError if it is not as it was written.
        """
        self.count += 1
        if seq != self.count:
            raise self.missing(self.count, seq - 1)
        self.link = chained(self.link, text)
        if self.link != hashes[0]:
            raise DamagedJournalError(f"{self._row()} is not as it was written")
        if not hashes[1] and not self.wall_link and seq <= self.bare:
            return
        self.wall_link = wall_chained(self.wall_link, seq, wall_us, provider)
        if self.wall_link != hashes[1]:
            what = "its date and time" if provider is None else "its date and time, or its provider"
            raise DamagedJournalError(f"{self._row()} is not as it was written: {what}")

    def missing(self, first: int, last: int) -> DamagedJournalError:
        """The error that rows are not there."""
        one, of = self.what
        which = f"{one} {first:,}" if last <= first else f"{one}s {first:,} to {last:,}"
        are = "is" if last <= first else "are"
        return DamagedJournalError(
            f"{self.path}: {which} of {of} {are} missing: the journal is damaged"
        )

    def _row(self) -> str:
        return f"{self.path}: {self.what[0]} {self.count:,} of {self.what[1]}"


class Recorded(NamedTuple):
    """What a journal has recorded of the end of a run, or of the queue, and its last mark.

    Both are None in the first form.
    """

    ending: Ending | None
    mark: Mark | None

    def check(self, chain: Chain, now: Mark | None) -> None:
        """Compare it with a chain that was followed to its end.

        ``now`` is the last mark after that; while it is the same, nobody can have written. Raises
        DamagedJournalError.
        """
        ending, same = self.ending, self.mark is not None and self.mark == now
        if ending is None:
            if same and self.mark is not None and self.mark.closed and chain.count:
                raise DamagedJournalError(
                    f"{chain.path}: the end of {chain.what[1]} is not recorded, though the journal "
                    "was closed: it is damaged"
                )
            return
        if chain.count < ending.rows:
            raise chain.missing(chain.count + 1, ending.rows)
        if chain.count > ending.rows:
            if same and self.mark is not None and self.mark.closed:
                raise DamagedJournalError(
                    f"{chain.path}: {chain.what[1]} has more {chain.what[0]}s than the "
                    f"{ending.rows:,} that were written: the journal is damaged"
                )
            return
        link = chain.link if chain.count else b""
        if (chain.count, chain.ended, link, chain.wall_link) != ending:
            raise DamagedJournalError(
                f"{chain.path}: the end of {chain.what[1]} is not as it was recorded: the journal "
                "is damaged"
            )
