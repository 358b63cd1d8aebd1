"""Suppression comments and what they cover."""

from __future__ import annotations

import pytest

from gpsfsm.syntax import parse
from gpsfsm.syntax.token_reader import read_suppression
from tests.syntax.support import GO


@pytest.mark.parametrize(
    ("body", "rules", "reason"),
    [
        (" gpsfsm: ignore GP302 ", ("GP302",), ""),
        ("gpsfsm:ignore[GP302]", ("GP302",), ""),
        (
            "gpsfsm: ignore [GP302, dangling-failure] the dock",
            ("GP302", "dangling-failure"),
            "the dock",
        ),
        ("gpsfsm: ignore GP302, GP303 GP3", ("GP302", "GP303", "GP3"), ""),
        ("gpsfsm: ignore GP302 because it is fine", ("GP302",), "it is fine"),
        ("gpsfsm: ignore GP302: it is fine", ("GP302",), "it is fine"),
        ("gpsfsm: ignore[GP302] because it is fine", ("GP302",), "it is fine"),
        ("GPSFSM: Ignore stuck", ("stuck",), ""),
        ("gpsfsm: ignore", (), ""),
        ("gpsfsm: ignore[]", (), ""),
        ("gpsfsm: ignore[GP302", (), ""),
        ("gpsfsm: ignore GP302!", (), ""),
        ("gpsfsm: off", (), ""),
        ("gpsfsm: ignored GP302", (), ""),
    ],
)
def test_words(body, rules, reason):
    assert read_suppression(body) == (rules, reason)


@pytest.mark.parametrize(
    "body", [" patrol ", "", "see gpsfsm: ignore GP302", "gpsfsm ignore GP302"]
)
def test_ordinary_comments(body):
    assert read_suppression(body) is None


def test_a_comment_covers_the_element_that_follows():
    parsed = parse(
        "<!-- gpsfsm: ignore GP109 -->\n<!-- and -->\n<Plan>\n"
        f"<!-- gpsfsm: ignore GP302 --> <!-- gpsfsm: ignore GP303 -->\n{GO}"
        f'<!-- gpsfsm: nonsense --><Control type="recovery">{GO}'
        "<!-- gpsfsm: ignore GP304 --></Control></Plan><!-- gpsfsm: ignore GP305 -->"
    )
    assert [
        (s.rules, s.scope, s.location.line, s.location.column) for s in parsed.suppressions
    ] == [
        (("GP109",), "/Plan", 1, 1),
        (("GP302",), "/Plan/Runner[1]", 4, 1),
        (("GP303",), "/Plan/Runner[1]", 4, 31),
        ((), "/Plan/Control[1]", 5, len(GO) + 1),
        (("GP304",), "", 5, 2 * len(GO) + 51),
        (("GP305",), "", 5, 2 * len(GO) + 97),
    ]
    assert not parsed.problems
