"""Hostile input ends in a problem, and costs no more than its length."""

from __future__ import annotations

import tracemalloc

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.syntax import Limits, parse
from gpsfsm.syntax.tree import TreeBuilder
from tests.cases import ALL
from tests.syntax.support import GO, rules, the_only

SIZE = 66_000  # more than any limit of a length
SEQUENTIAL = '<Control type="sequential">'

REPEATED = [
    *("<", "<a ", "<a", "</", "</a", "<!", "<?", "<!--", "<![CDATA[", "<!DOCTYPE", "<!DOCTYPE["),
    *('<!DOCTYPE["', '<a b="', "<a b='<a b=\"", '<a b="\n', "<a='", "&", "&#1;", "&#65;", "x "),
    *("<a>", "<a/>", "</a>", "<!---->", "<?a?>", "<?a >", "<?xml ", "<?xml ?>", "<Plan>"),
    *("<Plan/>", "<Plan></Plan>", "<think>", "</think>", "`<Plan>`", "\n", "\r", "\r\n", "\0"),
    *("\0x", "\ud800", "``", "> ", "= ", '" ', "]]>", '<Plan a="', "<!ENTITY a 'b'>", "a:", "&a;"),
]
PREFIXES = ["", "<Plan>", "<Plan ", '<Plan a="', "<!DOCTYPE Plan [", "<Plan><!--"]


@pytest.mark.parametrize("from_response", [False, True])
@pytest.mark.parametrize("prefix", PREFIXES)
def test_repetitions_are_read(prefix, from_response):
    """So long that a pass of quadratic time would take hours: then this does not end.

    Every piece behind two of the six prefixes; CASES=all puts it behind each of them.
    """
    for piece in REPEATED if ALL else REPEATED[PREFIXES.index(prefix) % 3 :: 3]:
        text = prefix + piece * (SIZE // len(piece))
        parsed = parse(text, from_response=from_response)
        assert parsed.problems or prefix == "<Plan>"
        assert all(1 <= problem.location.line <= SIZE + 1 for problem in parsed.problems)
        assert parsed.plan is None or len(parsed.plan.elements) <= SIZE


@pytest.mark.parametrize(
    ("text", "limits", "message", "option"),
    [
        (
            "<Plan>" + SEQUENTIAL * 1000,
            Limits(),
            "elements are nested more than 200 deep",
            "--max-depth",
        ),
        ("<Plan>" + GO * 11, Limits(max_elements=10), "more than 10 elements", "--max-elements"),
        (
            "<Plan " + " ".join(f'a{i}="1"' for i in range(10_000)) + "/>",
            Limits(),
            "an element has more than 200 attributes",
            "--max-attributes",
        ),
        (
            "<Plan " + " ".join(f"a{i}=1" for i in range(10_000)) + "/>",
            Limits(),
            "an element has more than 200 attributes",
            "--max-attributes",
        ),
        (
            '<Plan a="' + "x" * 70_000 + '"/>',
            Limits(),
            "the attribute 'a' is longer than 65,536 characters",
            "--max-attribute-length",
        ),
        (
            "<Plan " + "x" * 70_000 + '="1"/>',
            Limits(),
            "is longer than 65,536 characters",
            "--max-attribute-length",
        ),
        (
            "<" + "x" * 70_000 + "/>",
            Limits(),
            "the name of an element is longer than 65,536 characters",
            "--max-attribute-length",
        ),
        (
            "<Plan>" + "<!---->" * 1100 + "</Plan>",
            Limits(max_elements=1),
            "the text has too many tags, comments and texts",
            "--max-elements",
        ),
    ],
)
def test_limits(text, limits, message, option):
    parsed = parse(text, limits=limits)
    problem = next(p for p in parsed.problems if p.rule == "GP103")
    assert message in problem.message
    assert option in problem.hint
    assert parsed.over_limit
    assert parsed.plan is None


def test_limits_are_met_exactly():
    limits = Limits(max_depth=2, max_elements=3, max_attributes=3, max_attribute_length=9)
    assert not parse(f"<Plan>{GO}{GO}</Plan>", limits=limits).problems
    assert rules(f"<Plan>{GO}{GO}{GO}</Plan>", limits=limits) == ["GP103"]


def test_the_rest_is_not_read_after_a_limit():
    text = f"<Plan><Dance/>{GO}{GO}</Plan> and so on"
    parsed = parse(text, limits=Limits(max_elements=2))
    assert [p.rule for p in parsed.problems] == ["GP105", "GP103"]


def test_limits_must_make_sense():
    with pytest.raises(UsageError, match="max_depth must be at least 1"):
        Limits(max_depth=0)


def test_billions_of_laughs_are_not_heard():
    entities = '<!ENTITY l0 "ha">' + "".join(
        f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12)
    )
    tracemalloc.start()
    parsed = parse(f"<!DOCTYPE Plan [{entities}]><Plan>{GO}&l11;</Plan>")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [p.rule for p in parsed.problems] == ["GP102", "GP108"]
    assert peak < 5_000_000


def test_external_entities_are_not_read(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("TOP-SECRET")
    text = (
        f'<!DOCTYPE Plan [<!ENTITY x SYSTEM "{secret.as_uri()}">]>'
        '<Plan><Runner interface="&x;" provider="b"/></Plan>'
    )
    parsed = parse(text)
    assert parsed.plan is not None
    assert parsed.plan.runners[0].interface == "&x;"
    assert "TOP-SECRET" not in repr(parsed.problems)


def test_lxml_never_sees_a_doctype(monkeypatch):
    def refuse(_: str) -> None:
        raise AssertionError("lxml was asked")

    monkeypatch.setattr("gpsfsm.syntax.frontend.well_formedness_fault", refuse)
    assert rules(f"<!DOCTYPE Plan><Plan>{GO}</Plan>") == ["GP102"]
    with pytest.raises(AssertionError, match="lxml was asked"):
        parse(f"<Plan>{GO}<?what lxml judges?></Plan>")


def test_deeper_than_lxml_reads():
    depth = 3000
    text = "<Plan>" + SEQUENTIAL * depth + GO + "</Control>" * depth + "</Plan>"
    parsed = parse(text, limits=Limits(max_depth=10_000))
    assert not parsed.problems
    assert parsed.plan is not None
    assert len(parsed.plan.elements) == depth + 2


def test_a_text_of_errors_is_given_up():
    parsed = parse("<Plan>" + "<a b=c/>" * 1200 + "</Plan>", limits=Limits(max_problems=10))
    assert parsed.over_limit
    assert parsed.problems[-1].message == "the text has too many errors to be a plan"
    assert len(parsed.problems) < 30


def test_messages_are_short_whatever_the_text():
    long = "x" * 50_000
    for text in (
        f"<Plan><{long}/></Plan>",
        f'<Plan><Control type="{long}"/></Plan>',
        f"<Plan>{long}</Plan>",
        f'<Plan><Runner {long}="1"/></Plan>',
        f'<Plan><Runner interface="a" {long}/></Plan>',
        f"<Plan></{long}></Plan>",
        f'<Plan {long}="1">{GO}</Plan>',
        f"<{long}>",
        f"<Plan>&{long};</Plan>",
        f'<Plan><Runner interface="&{long};" provider="{long}"/></Plan>',
        f'<Plan><Runner interface={long} provider="&#{"1" * 5000};"/></Plan>',
    ):
        for problem in parse(text).problems:
            assert len(problem.message) < 300
            assert len(problem.hint) < 300
            assert len(problem.location.element) < 200


def test_a_large_plan_has_no_problem():
    runners = "".join(
        f'<Runner interface="nav2/Go" provider="nav2/Go" x="{i}" y="0.5"/>\n' for i in range(20_000)
    )
    parsed = parse(f"<Plan>\n{runners}</Plan>")
    assert not parsed.problems
    assert parsed.plan is not None
    assert len(parsed.plan.runners) == 20_000
    last = parsed.plan.runners[-1]
    assert (last.line, last.column, last.parameters) == (20_001, 1, {"x": 19_999, "y": 0.5})


def test_an_error_inside_the_front_end_would_be_seen(monkeypatch):
    """The tests above cannot pass because everything is caught."""
    monkeypatch.setattr(TreeBuilder, "_finish", lambda self: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        the_only(f"<Plan>{GO}")
