"""How long is waited."""

from __future__ import annotations

from email.utils import formatdate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.generation.providers.transport import pause_s, requested_wait_s

NOW_S = 1_800_000_000.0


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({}, None),
        ({"retry-after": "7"}, 7.0),
        ({"retry-after": " 0.5 "}, 0.5),
        ({"retry-after": "-1"}, None),
        ({"retry-after": "nan"}, None),
        ({"retry-after": "inf"}, None),
        ({"retry-after": "soon"}, None),
        ({"retry-after": ""}, None),
        ({"retry-after": "9" * 500}, 1e100 - 1),
        ({"retry-after-ms": "250", "retry-after": "7"}, 0.25),
        ({"retry-after-ms": "x", "retry-after": "7"}, 7.0),
        ({"retry-after": formatdate(NOW_S + 90, usegmt=True)}, 90.0),
        ({"retry-after": formatdate(NOW_S - 90, usegmt=True)}, 0.0),
        ({"retry-after": "Wed, 99 Oct 2015 07:28:00 GMT"}, None),
        ({"retry-after": "Wed, 21 Oct 99999 07:28:00 GMT"}, None),
    ],
)
def test_what_the_server_asks_for(headers: dict[str, str], expected: float | None) -> None:
    waits = requested_wait_s(headers, NOW_S)
    assert waits == (None if expected is None else pytest.approx(expected))


@given(st.text(max_size=200))
def test_no_header_is_too_odd(text: str) -> None:
    wait_s = requested_wait_s({"retry-after": text, "retry-after-ms": text}, NOW_S)
    assert wait_s is None or wait_s >= 0


@given(
    st.integers(1, 10_000),
    st.none() | st.floats(0, 1e300),
    st.floats(0, 3600),
    st.binary(max_size=20),
)
def test_a_pause_is_bounded_and_always_the_same(
    attempt: int, wanted_s: float | None, longest_s: float, seed: bytes
) -> None:
    seconds = pause_s(attempt, requested_s=wanted_s, longest_s=longest_s, seed=seed)
    assert 0 <= seconds <= longest_s
    assert seconds == pause_s(attempt, requested_s=wanted_s, longest_s=longest_s, seed=seed)
    if wanted_s is not None:
        assert seconds == min(wanted_s, longest_s)


def test_pauses_grow_and_differ() -> None:
    pauses = [pause_s(n, requested_s=None, longest_s=60.0, seed=b"a") for n in range(1, 9)]
    for number, pause in enumerate(pauses, start=1):
        full = min(0.5 * 2**number, 30.0)
        assert full / 2 <= pause <= full
    others = {pause_s(1, requested_s=None, longest_s=60.0, seed=bytes([n])) for n in range(20)}
    assert len(others) == 20
