"""GP101, GP102, GP110, GP116: errors of the text, each with place, words and repair."""

from __future__ import annotations

import pytest

from gpsfsm.syntax import Limits, parse
from tests.syntax.support import GO, problems, rules, the_only, underlined


def runner(attributes: str) -> str:
    return f'<Plan><Runner interface="a/B" provider="a/B" {attributes}/></Plan>'


# text, message, what is underlined, value of the attribute "t" after the repair
REPAIRS = [
    ('t="a & b"', "a lone '&' is not allowed in XML", "&", "a & b"),
    ('t="&ltname"', "'&lt' lacks its semicolon", "&lt", "&ltname"),
    (
        't="x&nbsp;y"',
        "unknown entity '&nbsp;': only &lt; &gt; &amp; &quot; &apos; are defined",
        "&nbsp;",
        "x&nbsp;y",
    ),
    ('t="&#0;"', "'&#0;' does not denote a character that XML allows", "&#0;", "&#0;"),
    ('t="&#xD800;"', "'&#xD800;' does not denote a character that XML allows", "&#xD800;", None),
    ('t="&#99999999999;"', "'&#99999999999;' does not denote", "&#99999999999;", None),
    ('t="if x < 3"', "'<' is not allowed in the value of 't'", "<", "if x < 3"),
    ("t=north", "the value of 't' is not in quotes", "north", "north"),
    ("t=a/b", "the value of 't' is not in quotes", "a/b", "a/b"),
    ('t=="1"', "'t' is followed by more than one '='", "==", "1"),
    ('t = = "1"', "'t' is followed by more than one '='", " = = ", "1"),
    ('t "1"', "'=' is missing after 't'", "t", "1"),
    ("t", "the attribute 't' has no value", "t", None),
    ("t=", "the attribute 't' has no value", "t", None),
    ('t="1"u="2"', "a space is missing before the attribute 'u'", "u", "1"),
    ('t="1" "2"', '"2" does not belong in the tag <Runner>', '"2"', "1"),
    ('t="1" 2u="3"', "'2u' is not a valid attribute name", "2u", "1"),
    ('t="1" /', "a stray '/' in the tag <Runner>", "/", "1"),
    (
        "t=\u201cnorth\u201d",
        "the value of 't' is written with typographic quotes",
        "\u201cnorth\u201d",
        "north",
    ),
    ('t=\\"north\\"', "the value of 't' is written with backslashes", '\\"north\\"', "north"),
    ('t="north u="1"', "the value of 't' has no closing \"", '"north', "north"),
]


@pytest.mark.parametrize(("attributes", "message", "shown", "value"), REPAIRS)
def test_an_error_in_a_tag_is_named_and_repaired(attributes, message, shown, value):
    parsed = parse(runner(attributes))
    (problem,) = parsed.problems
    assert problem.rule == "GP101"
    assert problem.message.startswith(message)
    assert underlined(parsed, problem) == shown
    assert problem.location.element == "/Plan/Runner[1]"
    assert problem.hint
    assert parsed.plan is not None
    assert len(parsed.plan.runners) == 1
    if value is not None:
        assert parsed.plan.runners[0].text("t") == value


def test_an_attribute_without_a_value_leaves_the_next_one_alone():
    parsed = parse(runner('t= u="2"'))
    assert [p.message for p in parsed.problems] == ["the attribute 't' has no value"]
    assert parsed.plan is not None
    assert parsed.plan.runners[0].text("u") == "2"
    assert parsed.plan.runners[0].text("t") is None


def test_a_missing_quote_does_not_swallow_the_next_runner():
    text = f'<Plan>\n<Runner interface="a/B" provider="a/B />\n{GO}\n</Plan>'
    parsed = parse(text)
    (problem,) = parsed.problems
    assert problem.message == "the value of 'provider' has no closing \""
    assert (problem.location.line, problem.location.column) == (2, 34)
    assert parsed.plan is not None
    assert [r.provider for r in parsed.plan.runners] == ["a/B", "nav2/Go"]


def test_all_errors_are_reported_at_once_and_in_order():
    text = (
        "<Plan>\n"
        '<Runner interface="a & b" provider=c/>\n'
        '<Runner interface="a/B" provider="a/B" x="1" x="2"/>\n'
        "oops\n"
        '<Control type="parallel">\n'
        "</Plan>"
    )
    actual = [(p.rule, p.location.line) for p in problems(text)]
    assert actual == [
        ("GP101", 2),
        ("GP101", 2),
        ("GP110", 3),
        ("GP108", 4),
        ("GP101", 5),
        ("GP106", 5),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<?xml version="1.0">\n<Plan>{}</Plan>', "the XML declaration does not end in '?>'"),
        (
            ' <?xml version="1.0"?>\n<Plan>{}</Plan>',
            "an XML declaration is allowed only at the very start of the text",
        ),
        (
            '<Plan><?xml version="1.0"?>{}</Plan>',
            "an XML declaration is allowed only at the very start of the text",
        ),
        ('<?xml vers="1.0"?><Plan>{}</Plan>', "this XML declaration is malformed"),
        ('<!xml version="1.0"?><Plan>{}</Plan>', "'<!xml version=\"1.0\"?>' is not XML"),
        ("<Plan>{}<? run ?></Plan>", "'<? run ?>' is not XML"),
        ("<Plan>{}<?run</Plan>", "'<?run' is never closed with '?>'"),
        ("<Plan>{}<!-- a -- b --></Plan>", "'--' is not allowed inside a comment"),
        ("<Plan>{}<!-- a ---></Plan>", "'--' is not allowed inside a comment"),
        ("<Plan>{}</Plan><!-- a", "a comment is never closed with '-->'"),
        ("<Plan>{}</Plan x>", "an end tag contains only a name: '</Plan x>'"),
        ("<Plan>{}</ Plan>", "an end tag contains only a name: '</ Plan>'"),
        ("<Plan>{}</Plan", "the end tag '</Plan' has no '>'"),
    ],
)
def test_errors_with_one_repair_keep_the_plan(text, message):
    parsed = parse(text.replace("{}", GO))
    (problem,) = parsed.problems
    assert problem.rule == "GP101"
    assert problem.message.startswith(message)
    assert parsed.plan is not None
    assert len(parsed.plan.runners) == 1


@pytest.mark.parametrize(
    ("text", "message", "place"),
    [
        (
            '<Plan>\n<Control type="sequential">\n{}\n</Plan>',
            "<Control> is never closed; </Plan> on line 4 comes first",
            (2, 1),
        ),
        (
            '<Plan>\n<Runner interface="a" provider="b">\n</Plan>',
            "<Runner> is never closed; </Plan> on line 3 comes first",
            (2, 1),
        ),
        (
            "<Plan>{}\n</Control></Plan>",
            "</Control> closes nothing: no <Control> is open here",
            (2, 1),
        ),
        ("<Plan>{}\n</plan>", "</plan> does not match <Plan> on line 1", (2, 1)),
        ("<Plan>{}\n</>", "'</>' is an end tag without a name", (2, 1)),
        (
            '<Plan>\n<Control type="recovery">{}',
            "the text ends too early: <Control> (line 2) and <Plan> (line 1) are never closed",
            (2, 26 + len(GO)),
        ),
        ("<Plan>\n<Runner interface", "the tag <Runner is never closed with '>'", (2, 1)),
        ("<Plan>{}\n<!-- and then", "a comment is never closed with '-->'", (2, 1)),
        ("<Plan>{}\n<![CDATA[ and then", "a CDATA section is never closed with ']]>'", (2, 1)),
        (
            "<Plan>{}</Plan>\n<Plan>{}</Plan>",
            "a plan is a single <Plan>, but <Plan> comes after its end",
            (2, 1),
        ),
        ("</Control>\n<Plan>{}</Plan>", "</Control> closes nothing", (1, 1)),
        ("<Plan>\n< Runner/></Plan>", "this '<' does not begin a tag: '< Runner/></'", (2, 1)),
    ],
)
def test_errors_of_nesting_leave_no_plan(text, message, place):
    parsed = parse(text.replace("{}", GO))
    problem = next(p for p in parsed.problems if p.message.startswith(message))
    assert problem.rule == "GP101"
    assert (problem.location.line, problem.location.column) == place
    assert parsed.plan is None


def test_a_second_plan_is_underlined_with_its_bracket_and_a_third_shown():
    parsed = parse("\n".join([f"<Plan>{GO}</Plan>"] * 3))
    (problem,) = parsed.problems
    assert underlined(parsed, problem) == "<Plan"
    assert [(each.location.line, each.message) for each in problem.related] == [(3, "<Plan>")]


def test_one_forgotten_end_tag_is_one_problem():
    assert rules(f'<Plan><Control type="sequential">{GO}</Plan>') == ["GP101"]
    assert rules(f'<Plan><Control type="sequential">{GO}') == ["GP101"]


def test_a_cut_off_answer_lists_what_is_open():
    problem = the_only(f'<Plan>\n <Control type="sequential">\n  {GO}')
    assert [(r.location.line, r.message) for r in problem.related] == [
        (2, "<Control> opens"),
        (1, "<Plan> opens"),
    ]
    assert "</Control></Plan>" in problem.hint


@pytest.mark.parametrize(
    "doctype",
    [
        "<!DOCTYPE Plan>",
        '<!DOCTYPE Plan SYSTEM "http://example.org/plan.dtd">',
        '<!DOCTYPE Plan [<!ENTITY a "b"><!-- > ] -->]>',
        "<!DOCTYPE Plan [<!ENTITY a '>]'>]\n>",
        "<!doctype html>",
    ],
)
def test_a_doctype_is_refused_and_skipped_whole(doctype):
    parsed = parse(f"{doctype}<Plan>{GO}</Plan>")
    assert [p.rule for p in parsed.problems] == ["GP102"]
    assert parsed.problems[0].message.startswith("a DOCTYPE is not allowed")
    assert parsed.plan is not None
    assert len(parsed.plan.runners) == 1


def test_entities_are_never_expanded():
    text = '<!DOCTYPE Plan [<!ENTITY a "SECRET">]>' + runner('t="&a;"')
    parsed = parse(text)
    assert [p.rule for p in parsed.problems] == ["GP102", "GP101"]
    assert parsed.plan is not None
    assert parsed.plan.runners[0].text("t") == "&a;"


def test_definitions_outside_of_a_doctype_are_refused():
    assert the_only(f'<Plan>{GO}<!ENTITY a "b"></Plan>').rule == "GP102"


def test_an_endless_doctype_leaves_no_plan():
    parsed = parse(f"<!DOCTYPE Plan [ <Plan>{GO}</Plan>")
    assert [p.rule for p in parsed.problems] == ["GP102"]
    assert parsed.plan is None


def test_the_first_of_two_equal_attributes_counts():
    parsed = parse(runner('x="2" x="20"'))
    (problem,) = parsed.problems
    assert problem.rule == "GP110"
    assert problem.message == "<Runner> has the attribute 'x' more than once"
    assert underlined(parsed, problem) == 'x="20"'
    assert parsed.plan is not None
    assert parsed.plan.runners[0].parameters == {"x": 2}


def test_characters_that_xml_forbids_are_read_as_blanks():
    parsed = parse(runner('t="a\0b\0c"') + "\x01")
    assert [p.message for p in parsed.problems] == [
        "the text contains the control character U+0000 (NUL) 2 times, which XML does not allow",
        "the text contains the control character U+0001, which XML does not allow",
    ]
    assert {p.rule for p in parsed.problems} == {"GP116"}
    assert len(parsed.problems[0].related) == 1
    assert parsed.plan is not None
    assert parsed.plan.runners[0].text("t") == "a b c"


def test_prefixes_must_be_declared():
    parsed = parse(runner('nav:x="1"'))
    assert [(p.rule, p.message) for p in parsed.problems] == [
        ("GP101", "'nav:x' has a prefix that is not declared")
    ]
    assert parsed.plan is not None


def test_what_only_lxml_knows_is_reported_in_its_words():
    messages = problems(f'<Plan xmlns:a="not a uri">{GO}</Plan>')
    assert sorted(p.rule for p in messages) == ["GP101", "GP112"]
    assert [p.message for p in messages if p.rule == "GP101"] == [
        "the text is not well-formed XML: xmlns:a: 'not a uri' is not a valid URI"
    ]


def test_the_number_of_problems_is_capped_per_rule_and_the_rest_is_counted():
    text = "<Plan>" + runner('t="&"')[6:-7] * 30 + '<Runner interface="a"/></Plan>'
    parsed = parse(text, limits=Limits(max_problems=5))
    assert [p.rule for p in parsed.problems] == ["GP101"] * 5 + ["GP107"]
    assert parsed.notes == ("30 problems of rule GP101 were found; the first 5 are listed",)
    assert parsed.plan is not None
    assert len(parsed.plan.runners) == 31


@pytest.mark.parametrize(
    ("number", "what"),
    [
        (0x0B, "control character U+000B"),
        (0x1F, "control character U+001F"),
        (0xD800, "surrogate U+D800"),
        (0xDFFF, "surrogate U+DFFF"),
        (0xFFFE, "character U+FFFE"),
        (0xFFFF, "character U+FFFF"),
    ],
)
def test_what_kind_of_character_is_not_allowed(number, what):
    problem = the_only(runner(f't="{chr(number)}"'))
    assert problem.rule == "GP116"
    assert problem.message == f"the text contains the {what}, which XML does not allow"
