"""Numbers and types of parameters: against the C library where there is one, and by hand."""

from __future__ import annotations

import ctypes
import math
import platform
import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.compile.fabric_parameters import read_double, read_int, typed

GLIBC = platform.libc_ver()[0] == "glibc" and ctypes.sizeof(ctypes.c_long) == 8


@pytest.mark.parametrize(
    ("text", "kind", "passed_on"),
    [
        ("true", 0, "true"),
        ("false", 0, "false"),
        ("True", 3, "True"),
        ("", 2, "0"),
        (" ", 3, " "),
        ("007", 2, "7"),
        ("+4", 2, "4"),
        ("\n\t\v\f\r -3", 2, "-3"),
        ("1 ", 3, "1 "),
        ("2147483647", 2, "2147483647"),
        ("2147483648", 2, "-2147483648"),
        ("4294967296", 2, "0"),
        ("9223372036854775807", 2, "-1"),
        ("-9223372036854775808", 2, "0"),
        ("9223372036854775808", 1, "9223372036854775808.000000"),
        ("0" * 40 + "5", 2, "5"),
        (".5", 1, "0.500000"),
        ("1.", 1, "1.000000"),
        (".", 3, "."),
        ("-0", 2, "0"),
        ("-0.0", 1, "-0.000000"),
        ("0.1234566", 1, "0.123457"),
        ("0.0000005", 1, "0.000000"),
        ("1e3", 1, "1000.000000"),
        ("1e", 3, "1e"),
        ("1e400", 3, "1e400"),
        ("-1e400", 3, "-1e400"),
        ("1e-400", 3, "1e-400"),
        ("0e-400", 1, "0.000000"),
        ("1e-310", 3, "1e-310"),
        ("0x1p-1074", 1, "0.000000"),
        ("0x1p-1075", 3, "0x1p-1075"),
        ("0x1.8p-1074", 3, "0x1.8p-1074"),
        ("0x1F", 1, "31.000000"),
        ("0X.8P1", 1, "1.000000"),
        ("0x", 3, "0x"),
        ("0x.", 3, "0x."),
        ("0x1p", 3, "0x1p"),
        ("0x1p1024", 3, "0x1p1024"),
        ("0b1", 3, "0b1"),
        ("1_000", 3, "1_000"),
        ("1,5", 3, "1,5"),
        ("\u0661", 3, "\u0661"),
        ("NaN", 1, "nan"),
        ("-nan", 1, "-nan"),
        ("nan(x_1)", 1, "nan"),
        ("nan(", 3, "nan("),
        ("inf", 1, "inf"),
        ("-Infinity", 1, "-inf"),
        ("infin", 3, "infin"),
        ("1e22", 1, "1" + "0" * 22 + ".000000"),
    ],
)
def test_types(text: str, kind: int, passed_on: str) -> None:
    parameter = typed("k", text)
    assert (parameter.type, parameter.text) == (kind, passed_on)


def test_a_large_number_is_written_in_full() -> None:
    text = typed("k", "1e300").text
    assert text == f"{int(1e300)}.000000"


class CLibrary:
    """``strtol`` and ``strtod``, and whether they read a text to its end without an error."""

    def __init__(self) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._libc.strtol.restype = ctypes.c_long
        self._libc.strtod.restype = ctypes.c_double

    def read(self, function: str, text: str) -> float | int | None:
        buffer = ctypes.create_string_buffer(text.encode())
        begin, end = ctypes.addressof(buffer), ctypes.c_void_p()
        ctypes.set_errno(0)
        base = (ctypes.c_int(10),) if function == "strtol" else ()
        value: float | int = getattr(self._libc, function)(
            ctypes.c_void_p(begin), ctypes.byref(end), *base
        )
        if ctypes.get_errno() or end.value != begin + len(text.encode()):
            return None
        return value


@pytest.fixture(scope="module")
def c_library() -> CLibrary:
    if not GLIBC:
        pytest.skip("this is not a 64-bit machine with glibc")
    return CLibrary()


digits = st.text("0123456789", min_size=1, max_size=24)
signs = st.sampled_from(["", "+", "-", " ", "\t-", "- "])
# Of subnormal numbers this tries few: releases of glibc before 2.41 lose a bit of them.
exponents = st.sampled_from(
    ["", *(f"e{n}" for n in (0, 5, -7, 307, 308, 309, -300, -307, -325, -400, 10**20, -(10**20)))]
)
numbers = st.one_of(
    st.text("0123456789abcdefxXpPeE.+-infnaity() _\t\n", max_size=8),
    st.builds("{}{}".format, signs, digits),
    st.builds("{}{}.{}{}".format, signs, digits, digits, exponents),
    st.builds("{}{}{}".format, signs, digits, exponents),
    st.builds("{}{!r}".format, signs, st.floats(min_value=2.3e-308, allow_nan=False)),
    st.builds("{}0x{}.{}p{}".format, signs, digits, digits, st.integers(-1000, 1100)),
    st.integers(-(2**64), 2**64).map(str),
)


@given(numbers)
@example("0x1.fffffffffffff8p-1023")
@example("0x1.fffffffffffff7p-1023")
@example("0x1.fffffffffffff7p1023")
@example("0x1.fffffffffffff8p1023")
@example("0x0p99999999999999999999")
@example("0x1p-99999999999999999999")
@example("2.2250738585072014e-308")
@example("4.9e-324")
@example("nan()")
def test_numbers_are_those_of_c(c_library: CLibrary, text: str) -> None:
    whole = c_library.read("strtol", text)
    expected = None if whole is None else ctypes.c_int(int(whole)).value
    assert read_int(text) == expected
    real, ours = c_library.read("strtod", text), read_double(text)
    if not text or real is None or ours is None:
        assert (real is None or not text) == (ours is None)
    elif math.isnan(real):
        assert math.isnan(ours)
        assert math.copysign(1.0, ours) == math.copysign(1.0, real)
    else:
        assert struct.pack("d", real) == struct.pack("d", ours)
