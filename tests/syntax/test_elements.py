"""GP104 to GP109 and GP111 to GP114: what may stand where."""

from __future__ import annotations

import pytest

from gpsfsm.model.plan import ControlType, Kind
from gpsfsm.syntax import parse
from tests.syntax.support import GO, problems, rules, the_only, underlined


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("", "the text is empty: there is no <Plan>", "write a plan as <Plan>…</Plan>"),
        (" \n\t", "the text is empty: there is no <Plan>", "write a plan as"),
        ("<!-- only this -->", "the text contains no <Plan>", "write a plan as"),
        (
            "Drive to the dock.",
            "the text contains no <Plan> and no other element",
            "write a plan as",
        ),
        ("Use:\n```\nnothing\n```", "the text contains no <Plan>", "if this is a model's answer"),
        ("&lt;Plan&gt;", "the text contains no <Plan>", "the plan is written with '&lt;'"),
        ("< Plan>", "the text contains no <Plan>", "remove the space after '<'"),
        (
            '<root main_tree_to_execute="Main"><BehaviorTree/></root>',
            "the outermost element is <root>: this is a BehaviorTree.CPP behaviour tree",
            "write a plan as <Plan>…</Plan> with <Control> and <Runner>",
        ),
        (
            f"<answer><Plan>{GO}</Plan></answer>",
            "the outermost element is <answer>, but a plan is one <Plan> element",
            "make the <Plan> on line 1 the outermost element; if this is a model's answer",
        ),
        (
            f'<Control type="sequential">{GO}</Control>',
            "the outermost element is <Control>",
            "put <Plan> before it and </Plan> after it",
        ),
        (f"<plan>{GO}</plan>", "the outermost element is <plan>", "write <Plan>"),
        ("<html/>", "the outermost element is not <Plan>: a plan is", "write a plan as"),
        ("<html><runner/></html>", "the outermost element is <html>", "write a plan as"),
    ],
)
def test_missing_plan(text, message, hint):
    parsed = parse(text)
    (problem,) = parsed.problems
    assert problem.rule == "GP104"
    assert problem.message.startswith(message)
    assert problem.hint.startswith(hint)
    assert parsed.plan is None


@pytest.mark.parametrize(
    "inside", ["", "<user>hunter2</user>", "&hunter2;", "<a b='hunter2'", "\0"]
)
def test_nothing_of_a_text_that_is_not_about_plans_is_told(inside):
    """The path may be a link to anything, also to what begins with a name that is secret."""
    parsed = parse(f"<hunter2-is-my-password name='hunter2'>{inside}")
    assert parsed.foreign
    assert {problem.rule for problem in parsed.problems} <= {"GP104", "GP116"}
    assert "hunter2" not in repr(parsed.problems)


def test_what_is_inside_a_wrong_root_is_checked_nevertheless():
    text = '<answer><Plan><Runner interface="a"/></Plan></answer>'
    assert [(p.rule, p.location.element) for p in problems(text)] == [
        ("GP104", "/answer"),
        ("GP107", "/answer/Plan[1]/Runner[1]"),
    ]


@pytest.mark.parametrize(
    ("tag", "hint"),
    [
        ("runner", "write <Runner>: names of elements are case-sensitive"),
        ("CONTROL", "write <Control>: names of elements are case-sensitive"),
        ("Runer", "write <Runner>"),
        ("Event", '<Event name="…" provider="…"/> is the notation of 2024'),
        ("Sequence", 'this is a behaviour tree element; write <Control type="sequential">'),
        ("Fallback", 'this is a behaviour tree element; write <Control type="recovery">'),
        ("Parallel", 'this is a behaviour tree element; write <Control type="parallel_all">'),
        ("RetryUntilSuccesful", "this is a behaviour tree element, and plans have no loops"),
        ("SubTree", "this is a behaviour tree element, and plans have nothing like it"),
        ("Action", "this is a behaviour tree element; write <Runner"),
        ("MoveBase", "write <Runner interface=…".replace("=…", '="…"')),
        ("Dance", "a plan contains only <Control> and <Runner> elements"),
    ],
)
def test_unknown_element(tag, hint):
    parsed = parse(f"<Plan>{GO}<{tag}/></Plan>")
    (problem,) = parsed.problems
    assert problem.rule == "GP105"
    assert problem.message == f"<{tag}> is not an element of a plan"
    assert problem.hint.startswith(hint)
    assert problem.location.element == f"/Plan/{tag}[1]"
    assert underlined(parsed, problem) == f"<{tag}"
    assert parsed.plan is None


def test_each_unknown_name_is_reported_once_with_its_other_places():
    problem = the_only(f"<Plan>\n<Sequence>{GO}\n<Sequence/></Sequence>\n<Sequence/></Plan>")
    assert problem.message == "<Sequence> is not an element of a plan (3 times)"
    assert [(r.location.line, r.location.element) for r in problem.related] == [
        (3, "/Plan/Sequence[1]/Sequence[1]"),
        (4, "/Plan/Sequence[2]"),
    ]


TREE = """<Plan ID="MainTree">
<Sequence><MoveBase/><Nav2PreCheck/>
<MoveBase/></Sequence></Plan>"""


def test_a_behaviour_tree_inside_a_plan_is_one_problem():
    problem = the_only(TREE)
    assert (problem.rule, problem.location.line) == ("GP118", 2)
    assert problem.message == (
        "this is a behaviour tree inside a <Plan>; "
        "a plan has no <Sequence>, <MoveBase> (2 times) or <Nav2PreCheck>"
    )
    assert [(r.location.line, r.message) for r in problem.related] == [
        (1, "'ID' on <Plan>"),
        (2, "<MoveBase>"),
        (2, "<Nav2PreCheck>"),
        (3, "<MoveBase>"),
    ]
    assert problem.hint == (
        'write <Sequence> as <Control type="sequential">; <MoveBase> and '
        '<Nav2PreCheck> as <Runner interface="…" provider="…"/>. To have it '
        "checked as a tree, put it into <root>"
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<Plan><Sequence><MoveBase/></Sequence></Plan>", ["GP118"]),
        ('<Plan ID="t"><Sequence/></Plan>', ["GP118"]),
        ('<Plan ID="t" x="1"><Sequence/></Plan>', ["GP112", "GP118"]),
        (f"<Plan><Sequence>{GO}</Sequence></Plan>", ["GP105"]),
        # places to drive to, and steps of one's own: nothing that gives a tree its form
        ("<Plan><MoveBase/><GoTo/></Plan>", ["GP105", "GP105"]),
        (f'<Plan ID="t">{GO}<Dance/></Plan>', ["GP112", "GP105"]),
        # what has its own remedy stays apart
        ("<Plan><Sequence><MoveBase/></Sequence><Contrl/></Plan>", ["GP118", "GP105"]),
        ('<Plan><Fallback><Step interface="a"/></Fallback></Plan>', ["GP105", "GP105"]),
        ("<Control><Sequence/><MoveBase/></Control>", ["GP104", "GP105", "GP105", "GP107"]),
        (f'<Plan ID="t">{GO}</Plan>', ["GP112"]),
    ],
)
def test_what_is_a_tree_inside_a_plan(text, expected):
    assert sorted(rules(text)) == sorted(expected)


def test_of_many_elements_of_a_tree_some_are_named():
    names = "".join(f"<Step{number}/>" for number in range(9))
    problem = the_only(f"<Plan><Fallback>{names * 30}</Fallback></Plan>")
    assert problem.message.endswith("<Step3> (30 times) or 5 others")
    assert "<Step0>, <Step1> and the like as <Runner" in problem.hint
    assert len(problem.related) == 100


def test_rules_hold_inside_unknown_elements_too():
    text = '<Plan><Sequence>text<Runner interface="a"/></Sequence></Plan>'
    assert rules(text) == ["GP105", "GP107"]


def test_a_plan_inside_a_plan_is_unknown():
    problem = the_only(f"<Plan>{GO}<Plan>{GO}</Plan></Plan>")
    assert (problem.rule, problem.message) == ("GP105", "a plan must not contain a <Plan>")


@pytest.mark.parametrize("root", ['<Plan xmlns="urn:x">', "<Plan>"])
def test_namespaces_hold_no_plan(root):
    inner = '<n:Runner xmlns:n="urn:x" interface="a" provider="b"/>' if root == "<Plan>" else GO
    parsed = parse(f"{root}{inner}</Plan>")
    assert [p.rule for p in parsed.problems] == ["GP105"]
    assert parsed.plan is None


def test_an_empty_namespace_is_none():
    assert not problems(f'<Plan xmlns="">{GO}</Plan>')


@pytest.mark.parametrize(
    ("written", "hint"),
    [
        ("parallel", 'write type="parallel_all" to wait for all children'),
        ("fallback", 'write type="recovery", with the goal right before it'),
        ("Sequence", 'write type="sequential"'),
        ("Parallel_any", 'write type="parallel_any": types are case-sensitive'),
        ("parallel-all", 'write type="parallel_all": types are case-sensitive'),
        ("sequental", 'write type="sequential"'),
        (" recovery ", 'remove the spaces: type="recovery"'),
        ("xyzzy", "use sequential, recovery, parallel_any or parallel_all"),
    ],
)
def test_unknown_control_type(written, hint):
    parsed = parse(f'<Plan><Control type="{written}">{GO}</Control></Plan>')
    (problem,) = parsed.problems
    assert problem.rule == "GP106"
    assert problem.message == f"'{' '.join(written.split())}' is not a type of control"
    assert problem.hint.startswith(hint)
    assert underlined(parsed, problem) == f'type="{written}"'
    assert parsed.plan is None


@pytest.mark.parametrize(
    ("element", "message", "hint", "kept"),
    [
        ('<Runner provider="a/B"/>', "this runner has no interface", 'add interface="a/B"', True),
        ('<Runner interface="a/B"/>', "this runner has no provider", 'add provider="a/B"', True),
        (
            '<Runner interface="a/B" provider="\t "/>',
            "the provider of this runner is empty",
            'add provider="a/B"',
            True,
        ),
        (
            '<Runner interface="a/B" Provider="a/B"/>',
            "this runner has no provider",
            "write 'provider' instead of 'Provider'",
            True,
        ),
        ("<Control>{}</Control>", "this control has no type", 'add type="…"', False),
        (
            '<Control name="recovery">{}</Control>',
            "this control has no type",
            'name="recovery" is the notation of 2024; write type="recovery"',
            False,
        ),
        ('<Control type=" ">{}</Control>', "the type of this control is empty", "add type", False),
        (
            '<Control Type="recovery">{}</Control>',
            "this control has no type",
            "write 'type' instead of 'Type'",
            False,
        ),
    ],
)
def test_missing_attribute(element, message, hint, kept):
    parsed = parse(f"<Plan>{GO}{element.replace('{}', GO)}</Plan>")
    (problem,) = parsed.problems
    assert problem.rule == "GP107"
    assert problem.message.startswith(message)
    assert problem.hint.startswith(hint)
    assert (parsed.plan is not None) is kept


def test_a_no_break_space_is_no_blank():
    assert not problems('<Plan><Runner interface="\u00a0" provider="b"/></Plan>')
    assert rules(f"<Plan>{GO}\u00a0</Plan>") == ["GP108"]


@pytest.mark.parametrize(
    ("text", "message", "shown"),
    [
        ("<Plan>{} then \n go</Plan>", "text is not allowed in <Plan>: then go", "then"),
        ("<Plan>{}x < y</Plan>", "text is not allowed in <Plan>: x < y", "x < y"),
        ("<Plan>{}<![CDATA[go]]></Plan>", "text is not allowed in <Plan>: <![CDATA[go]]>", None),
        ("Sure!\n<Plan>{}</Plan>", "text is not allowed around the plan: Sure!", "Sure!"),
        ("<Plan>{}</Plan>\nDone.", "text is not allowed around the plan: Done.", "Done."),
        ("<Plan>{}</Plan>&#32;", "text is not allowed around the plan: &#32;", "&#32;"),
        ("<Plan>{}Tom & Tina</Plan>", "text is not allowed in <Plan>: Tom & Tina", "Tom & Tina"),
    ],
)
def test_stray_text(text, message, shown):
    parsed = parse(text.replace("{}", GO))
    (problem,) = parsed.problems
    assert problem.rule == "GP108"
    assert problem.message == message
    if shown:
        assert underlined(parsed, problem).rstrip() == shown
    assert parsed.plan is not None


def test_a_fence_around_the_plan_points_to_from_response():
    messages = problems(f"Here:\n```xml\n<Plan>{GO}</Plan>\n```")
    assert [p.rule for p in messages] == ["GP108", "GP108"]
    assert all("--from-response" in p.hint for p in messages)
    assert "--from-response" in the_only(f"<Plan>{GO}\n```\n</Plan>").hint
    assert "--from-response" not in the_only(f"<Plan>{GO}\nnow\n</Plan>").hint


@pytest.mark.parametrize("blank", ["&#32;", "&#x9;&#10;", "<![CDATA[ ]]>", "<!-- c -->", "<?p?>"])
def test_what_stands_for_white_space_is_none(blank):
    assert not problems(f"<Plan>{GO}{blank}</Plan>")
    assert not problems(f'<Plan><Runner interface="a" provider="b">{blank}</Runner></Plan>')


@pytest.mark.parametrize(
    ("text", "message", "path"),
    [
        ("<Plan/>", "this plan is empty", "/Plan"),
        ("<Plan><!-- later --></Plan>", "this plan is empty", "/Plan"),
        ('<Plan>{}<Control type="recovery"/></Plan>', "this control is empty", "/Plan/Control[1]"),
        (
            '<Plan>{}<Control type="recovery"> </Control></Plan>',
            "this control is empty",
            "/Plan/Control[1]",
        ),
    ],
)
def test_empty_control(text, message, path):
    parsed = parse(text.replace("{}", GO))
    (problem,) = parsed.problems
    assert (problem.rule, problem.location.element) == ("GP109", path)
    assert problem.message.startswith(message)
    assert parsed.plan is not None


def test_a_control_of_invalid_things_is_not_empty():
    assert rules('<Plan><Control type="sequential"><Dance/></Control></Plan>') == ["GP105"]


@pytest.mark.parametrize(
    "attribute",
    ['goal="2.0,-0.5"', 'position="2.0;-0.5"', 'pose="1 2 0"', 'goal="(1, .5)"', 'p="-1e3 , 2"'],
)
def test_packed_coordinates(attribute):
    parsed = parse(f'<Plan><Runner interface="a" provider="b" {attribute}/></Plan>')
    (problem,) = parsed.problems
    assert problem.rule == "GP111"
    assert problem.message.startswith(f"{attribute} packs several numbers into one attribute")
    assert underlined(parsed, problem) == attribute
    assert parsed.plan is not None


@pytest.mark.parametrize(
    "attribute",
    ['x="2.0"', 'text="1, 2"', 'task="1 2"', 'name="1 2"', 'q="1,2,3,4"', 'v="1.2.3"', 'r="-"'],
)
def test_these_are_no_packed_coordinates(attribute):
    assert not problems(f'<Plan><Runner interface="a" provider="b" {attribute}/></Plan>')


def test_foreign_attributes_are_one_problem_per_element():
    parsed = parse(
        f'<Plan ID="p"><Control type="recovery" x="1" name="n" y="2">{GO}</Control></Plan>'
    )
    first, second = parsed.problems
    assert {first.rule, second.rule} == {"GP112"}
    assert first.message == "the attribute 'ID' has no effect on <Plan>"
    assert second.message == "the attributes 'x', 'y' have no effect on <Control>"
    assert [r.message for r in second.related] == ["'y'"]
    assert parsed.plan is not None


def test_namespaced_parameters_are_foreign():
    text = '<Plan><Runner interface="a" provider="b" xmlns:n="urn:n" n:x="1"/></Plan>'
    assert rules(text) == ["GP112", "GP112"]


@pytest.mark.parametrize("name", ["fabric/FabricCompletionRunner", "CompletionRunner"])
def test_an_explicit_completion_is_dropped(name):
    end = f'<Runner interface="{name}" provider="{name}"/>'
    parsed = parse(f"<Plan>{GO}{GO}{end}<!-- end --></Plan>")
    (problem,) = parsed.problems
    assert (problem.rule, problem.location.element) == ("GP113", "/Plan/Runner[3]")
    plan = parsed.plan
    assert plan is not None
    assert len(plan.elements) == 3
    assert plan.elements[0].children == (1, 2)
    assert plan.dropped_completion is not None
    assert plan.dropped_completion.interface == name
    assert plan.path(plan.dropped_completion) == "/Plan/Runner[3]"


def test_a_completion_elsewhere_is_an_ordinary_runner():
    end = '<Runner interface="f/CompletionRunner" provider="f/CompletionRunner"/>'
    for text in (f"{end}{GO}", f'<Control type="sequential">{end}</Control>'):
        parsed = parse(f"<Plan>{text}</Plan>")
        assert not parsed.problems
        assert parsed.plan is not None
        assert parsed.plan.dropped_completion is None


def test_a_runner_holds_nothing():
    open_tag = GO.replace("/>", ">")
    parsed = parse(f"<Plan>{open_tag}{GO}more</Runner>{open_tag}say</Runner>{GO}</Plan>")
    assert [(p.rule, p.location.element, p.message) for p in parsed.problems] == [
        ("GP114", "/Plan/Runner[1]", "a runner must be empty, but this one contains <Runner>"),
        ("GP114", "/Plan/Runner[2]", "a runner must be empty, but this one contains the text: say"),
    ]
    assert parsed.plan is not None
    assert [parsed.plan.path(r) for r in parsed.plan.runners] == [
        "/Plan/Runner[1]",
        "/Plan/Runner[2]",
        "/Plan/Runner[3]",
    ]


def test_a_forgotten_slash_is_not_called_content():
    open_tag = GO.replace("/>", ">")
    assert rules(f"<Plan>{open_tag}{GO}</Plan>") == ["GP101"]


def test_the_tree():
    parsed = parse(
        f'<?xml version="1.0"?><Plan name="p">{GO}'
        f'<Control type="parallel_any" name="c">{GO}<Control type="recovery">{GO}</Control>{GO}'
        f"</Control>{GO}</Plan>",
        file="patrol.xml",
    )
    assert not parsed.problems
    plan = parsed.plan
    assert plan is not None
    assert plan.file == "patrol.xml"
    assert [(e.index, e.kind, e.parent, e.ordinal, e.children) for e in plan.elements] == [
        (0, Kind.PLAN, -1, 1, (1, 2, 7)),
        (1, Kind.RUNNER, 0, 1, ()),
        (2, Kind.CONTROL, 0, 1, (3, 4, 6)),
        (3, Kind.RUNNER, 2, 1, ()),
        (4, Kind.CONTROL, 2, 1, (5,)),
        (5, Kind.RUNNER, 4, 1, ()),
        (6, Kind.RUNNER, 2, 2, ()),
        (7, Kind.RUNNER, 0, 2, ()),
    ]
    assert plan.elements[0].control_type is ControlType.SEQUENTIAL
    assert plan.elements[2].control_type is ControlType.PARALLEL_ANY
    assert plan.path(5) == "/Plan/Control[1]/Control[1]/Runner[1]"
    for element in plan.elements:
        source = parsed.text[element.start : element.end]
        assert source.startswith(f"<{element.kind}")
        assert source.endswith(">")
    assert [(a.name, a.text, a.value) for a in plan.elements[7].attributes] == [
        ("interface", "nav2/Go", "nav2/Go"),
        ("provider", "nav2/Go", "nav2/Go"),
        ("x", "1.5", 1.5),
    ]


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ('<Plan>< Nav2Action x="1"/></Plan>', "remove the space after '<'"),
        ("<Plan>1 < 2</Plan>", "remove it"),
        (f'<Plan ID="3">{GO}</Plan>', "remove it, or write name instead"),
        (f'<Plan x="3">{GO}</Plan>', "only runners take parameters: move it to the runner"),
        (f'<Plan x="3" y="4">{GO}</Plan>', "only runners take parameters: move them to"),
        (f'<Plan ID="3" y="4">{GO}</Plan>', "remove the ID, which only behaviour trees have"),
    ],
)
def test_the_advice_fits_what_was_written(text, hint):
    first = parse(text).problems[0]
    assert first.rule in ("GP108", "GP112")
    assert first.hint.startswith(hint)
