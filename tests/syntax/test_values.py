"""Attribute values are typed as Fabric types them."""

from __future__ import annotations

import ctypes
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.syntax.values import typed


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("true", True),
        ("false", False),
        ("True", "True"),
        (" true", " true"),
        ("7", 7),
        ("007", 7),
        ("+5", 5),
        ("-0", 0),
        ("  12", 12),
        ("12 ", "12 "),
        ("9223372036854775807", 2**63 - 1),
        ("9223372036854775808", 2.0**63),
        ("-9223372036854775808", -(2**63)),
        ("1.5", 1.5),
        (".5", 0.5),
        ("1.", 1.0),
        (".", "."),
        ("-", "-"),
        ("+", "+"),
        ("1e3", 1000.0),
        ("1e", "1e"),
        ("1e400", "1e400"),
        ("1e-400", 0.0),
        ("0x1F", 31.0),
        ("0x1.8p1", 3.0),
        ("0x", "0x"),
        ("0x1p99999", "0x1p99999"),
        ("inf", math.inf),
        ("-Infinity", -math.inf),
        ("infinit", "infinit"),
        ("1_000", "1_000"),
        ("1,5", "1,5"),
        ("\u0663", "\u0663"),
        ("", ""),
        (" ", " "),
        ("dock", "dock"),
    ],
)
def test_typed(text, value):
    completed = typed(text)
    assert type(completed) is type(value)
    assert completed == value


@pytest.mark.parametrize("text", ["nan", "NaN", "-nan", "nan(0x1)"])
def test_not_a_number(text):
    value = typed(text)
    assert isinstance(value, float)
    assert math.isnan(value)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("9" * 5000, str),
        ("-" + "0" * 5000 + "1", int),
        ("1" * 60_000 + "x", str),
        ("0x" + "f" * 60_000, str),
        ("1." * 30_000, str),
    ],
    ids=["nines", "zeros", "word", "hexadecimal", "dots"],
)
def test_no_length_is_too_much(text, kind):
    assert type(typed(text)) is kind


def test_leading_zeros_do_not_count():
    assert typed("0" * 5000 + "1") == 1


_STRTOD = ctypes.CDLL(None).strtod
_STRTOD.restype = ctypes.c_double
_STRTOD.argtypes = [ctypes.c_char_p, ctypes.POINTER(ctypes.c_char_p)]


def c_reads(text: str) -> float | None:
    """What the C library makes of ``text``; None if it does not read all of it."""
    buffer = ctypes.create_string_buffer(text.encode())
    end = ctypes.c_char_p()
    value = _STRTOD(ctypes.cast(buffer, ctypes.c_char_p), ctypes.byref(end))
    rest = ctypes.cast(end, ctypes.c_void_p).value
    assert rest is not None
    read_all = rest - ctypes.addressof(buffer) == len(buffer) - 1
    return value if read_all and text else None


@given(st.text("0123456789+-.eExXpPaf infnatyN()_ \t", max_size=12))
def test_numbers_are_those_of_the_c_library(text):
    value = typed(text)
    reference = c_reads(text)
    if reference is None or (math.isinf(reference) and "n" not in text.lower()):
        assert value == text
    elif math.isnan(reference):
        assert isinstance(value, float)
        assert math.isnan(value)
    else:
        assert not isinstance(value, str)
        assert value == reference
