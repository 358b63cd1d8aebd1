"""The judge of damaged journals: it excuses no more than what only the witness can know."""

from __future__ import annotations

import struct

import pytest

from tests.attacks.journals import NAME, PAGE, Case, Damage, judge, whole

LOG, WITNESS = 0, 2
"""Where a flipped bit of the log goes."""


def _last_frame() -> int:
    """The first byte of the last frame of the log that belongs to it."""
    log = (whole("crashed") / f"{NAME}-wal").read_bytes()
    salts, size = log[16:24], 24 + PAGE
    places = range(32, len(log) - size + 1, size)
    actual = [place for place in places if log[place + 8 : place + 16] == salts]
    assert struct.unpack(">I", log[actual[-1] + 4 : actual[-1] + 8])[0]  # it ends a transaction
    return actual[-1]


def _flipped(place: int, where: int) -> Damage:
    return Damage("a bit of the log flipped", (place, 0, where, 0))


@pytest.mark.parametrize("first", [LOG, WITNESS])
def test_the_end_of_a_log_without_its_witness(first: int) -> None:
    log, witness = _flipped(_last_frame() + 100, LOG), _flipped(20, WITNESS)
    damages = (log, witness) if first == LOG else (witness, log)
    assert list(judge(Case("crashed", damages)))


def test_with_its_witness_it_is_missed() -> None:
    damages = (_flipped(_last_frame() + 100, LOG), Damage("files beside it gone", (0, 1, 0, 0)))
    for case in (damages[:1], damages[1:], damages):
        assert "events: noticed" in list(judge(Case("crashed", case)))
