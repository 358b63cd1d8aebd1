"""A language model's raw answer: which plan is taken, and what is said about the rest."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.syntax import parse
from tests.syntax.support import GO, underlined

PLAN = f"<Plan>\n{GO}\n</Plan>"
OTHER = '<Plan name="other"><Runner interface="x" provider="x"/></Plan>'


def taken(answer: str) -> str | None:
    """The plan that was taken, as it stands in the answer."""
    parsed = parse(answer, from_response=True)
    if parsed.plan is None:
        return None
    end = answer.find("</Plan>", parsed.plan.elements[-1].end) + len("</Plan>")
    return answer[parsed.plan.elements[0].start : end]


@pytest.mark.parametrize(
    ("answer", "left_out"),
    [
        (f"Sure!\n{PLAN}", "text before the plan"),
        (f"{PLAN}\nEnjoy & drive < 1 m/s.", "text after the plan"),
        (f"```xml\n{PLAN}\n```", "a Markdown fence"),
        (f'```xml\n<?xml version="1.0"?>\n{PLAN}\n```', "a Markdown fence, an XML declaration"),
        (f'\n<?xml version="1.0"?>\n{PLAN}', "an XML declaration"),
        (f"First:\n{OTHER}\nBetter:\n{PLAN}", "text before the plan, 1 earlier plan"),
        (f"{OTHER}{OTHER}{PLAN}", "2 earlier plans"),
        (f"<think>Maybe {OTHER}?</think>{PLAN}", "the model's reasoning with 1 plan in it"),
        (f"Maybe {OTHER}?</think>\n{PLAN}", "the model's reasoning with 1 plan in it"),
        (f"<thinking>Hm.</thinking>{PLAN}", "the model's reasoning"),
        (f"{PLAN}\n<think>Was {OTHER} right?", None),
        (f"<!-- {OTHER} -->Sure: {PLAN}", "text before the plan"),
        (f"{PLAN}\n<!-- not {OTHER} --> end", "text after the plan"),
        (f"Sure: {PLAN}\nIt has a `<Plan>` and a `</Plan>` tag.", None),
        (f"{PLAN}\nAll is between <Plan> and </Plan> tags.", None),
        (f"{PLAN}\nThe tag <Plan> opens it.", "text after the plan"),
        (f"<Plan> I start over.\n{PLAN}", None),
        (f"<root>{PLAN}</root>", None),
        (f'It is <b title="{OTHER.replace(chr(34), chr(39))}">this</b>: {PLAN}', None),
    ],
)
def test_the_last_complete_plan_is_taken(answer, left_out):
    assert taken(answer) == PLAN
    parsed = parse(answer, from_response=True)
    (problem,) = parsed.problems
    assert problem.rule == "GP115"
    assert underlined(parsed, problem) == "<Plan"
    assert problem.message == parsed.notes[0]
    assert parsed.text == answer
    if left_out:
        assert problem.message.endswith(f"left out: {left_out}")


@pytest.mark.parametrize(
    "answer",
    [PLAN, f"\n{PLAN}\n", f'<?xml version="1.0"?>\n<!-- patrol -->\n{PLAN}\n<!-- end -->'],
)
def test_a_clean_answer_is_just_a_plan(answer):
    parsed = parse(answer, from_response=True)
    assert not parsed.problems
    assert not parsed.notes
    assert parsed.plan is not None


def test_the_note_names_lines_and_places_stay_those_of_the_answer():
    answer = 'Hi\n\n```\n<Plan>\n  <Runner interface="a" provider="&"/>\n</Plan>\n```'
    parsed = parse(answer, from_response=True)
    assert parsed.notes == (
        "took lines 4 to 6 of the answer as the plan; left out: text before the plan, "
        "a Markdown fence",
    )
    assert [(p.rule, p.location.line, p.location.column) for p in parsed.problems] == [
        ("GP115", 4, 1),
        ("GP101", 5, 35),
    ]


def test_a_plan_in_an_attribute_does_not_count():
    inner = '<Runner interface="a" provider="b" task="then <Plan><Runner/></Plan> it"/>'
    parsed = parse(f"Sure: <Plan>{inner}</Plan>", from_response=True)
    assert [p.rule for p in parsed.problems] == ["GP115", "GP101", "GP101", "GP101"]
    assert parsed.problems[0].location.column == 7
    assert parsed.plan is not None
    assert len(parsed.plan.runners) == 1


def test_an_incomplete_plan_is_taken_if_there_is_no_other():
    parsed = parse(f"Sure:\n```\n<Plan>\n{GO}\n```\nDone.", from_response=True)
    assert [p.rule for p in parsed.problems] == ["GP115", "GP101"]
    assert parsed.problems[1].message.startswith("the text ends too early: <Plan> (line 3)")
    assert parsed.plan is None


def test_a_complete_plan_is_better_than_a_later_incomplete_one():
    assert taken(f"{PLAN}\nOr rather:\n<Plan><Control") == PLAN


@pytest.mark.parametrize(
    "answer",
    ["", "I cannot do that.", f"<!-- {PLAN} -->", f"<think>{PLAN}", "```\n<root/>\n```"],
)
def test_no_plan_at_all(answer):
    parsed = parse(answer, from_response=True)
    assert "GP104" in [p.rule for p in parsed.problems]
    assert parsed.plan is None


@given(
    st.lists(
        st.sampled_from(
            [
                *("<Plan>", "</Plan>", "<Plan/>", '<Plan name="', PLAN, "<!--", "-->", "```", "\n"),
                *("<think>", "</think>", '"', "'", "=", "<a b=", "`", " text ", "<![CDATA[", "]]>"),
            ]
        ),
        max_size=12,
    )
)
def test_any_answer_is_read_and_cut_inside_itself(pieces):
    answer = "".join(pieces)
    parsed = parse(answer, from_response=True)
    assert parsed.text == answer
    for problem in parsed.problems:
        if problem.rule == "GP115":
            assert underlined(parsed, problem) == "<Plan"


COMMAND = "@ros2 launch fabric fabric.launch.py filename:=plan.xml"
PREFIX = "[fabric_server-1] "


def logged(text: str) -> str:
    return "".join(f"{PREFIX}{line}\n" for line in text.splitlines())


@pytest.mark.parametrize(
    ("answer", "left_out"),
    [
        (f"{COMMAND}\n{PLAN}", "a ros2 command"),
        (f"  $ ros2 run fabric fabric\n{PLAN}", "a ros2 command"),
        (f"me@robot:~/ws$ ros2 launch fabric all.py\nDone:\n{PLAN}", None),
        (f"{COMMAND} plan:='{PLAN}'", "a ros2 command, text after the plan"),
        (f"The ros2 launch file:\n{PLAN}", "text before the plan"),
    ],
)
def test_a_command_before_the_plan_is_left_out(answer, left_out):
    assert taken(answer) == PLAN
    (problem,) = parse(answer, from_response=True).problems
    if left_out:
        assert problem.message.endswith(f"left out: {left_out}")


@pytest.mark.parametrize(
    "answer",
    [
        logged(PLAN),
        COMMAND + "\n" + logged(f"[INFO] [1784]: response received : {PLAN}\n[INFO] done"),
        logged(f"[INFO] <Plan> comes:\n{OTHER}\n\n{PLAN}\n[INFO] <Plan> element extracted"),
        logged(PLAN).replace(PREFIX, "[a.b-c-12] "),
    ],
)
def test_the_prefixes_of_a_log_are_left_out(answer):
    parsed = parse(answer, from_response=True)
    assert parsed.plan is not None
    (problem,) = parsed.problems
    assert problem.rule == "GP115"
    assert "; left out: the prefixes of a log" in problem.message
    (runner,) = parsed.plan.runners
    assert answer[runner.start : runner.end] == GO
    assert "-1]" not in parsed.body


@pytest.mark.parametrize("answer", [f"[1-1] see:\n{PLAN}", f"{PREFIX}<Plan>\n{GO}\n</Plan>"])
def test_a_plan_of_which_not_all_lines_have_a_prefix_is_no_log(answer):
    (problem,) = parse(answer, from_response=True).problems
    assert problem.message.endswith("left out: text before the plan")


def test_a_value_keeps_what_looks_like_a_prefix():
    value = 'text="one\n[note-1] two"'
    parsed = parse(f"Sure:\n{PLAN.replace('/>', f' {value}/>')}", from_response=True)
    (runner,) = parsed.plan.runners
    assert any("[note-1]" in attribute.text for attribute in runner.attributes)
