"""The language of --assume: what it means, what it refuses, and how it says so."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis import assume_ast as ast
from gpsfsm.analysis.assume import parse_assumption
from gpsfsm.errors import AssumptionError
from gpsfsm.model.event import Outcome
from gpsfsm.model.plan import Attribute, ControlType, Element, Kind, Plan, Value

S, F, N, H = Outcome
Scenario = Sequence[Outcome]
Predicate = Callable[[Scenario], bool]
NAV, TALK = "nav2_capabilities/WaypointRunner", "fp_capabilities/SpeechRunner"


def plan_of(*rows: tuple[int, str, int, int, dict[str, Value]], spread: int = 0) -> Plan:
    """A plan from (depth, interface or "", line, column, attributes); "" makes a control.

    ``spread``: the last attribute stands that many lines below the tag's first line.
    """
    rows = ((0, "", 1, 1, {}), *rows)
    parents: list[int] = []
    for place, (depth, *_) in enumerate(rows):
        before = [other for other in range(place) if rows[other][0] == depth - 1]
        parents.append(before[-1] if before else -1)
    elements: list[Element] = []
    for place, (_, interface, line, column, values) in enumerate(rows):
        kind = Kind.RUNNER if interface else Kind.CONTROL if place else Kind.PLAN
        same = [other for other in range(place) if parents[other] == parents[place]]
        texts = {"interface": interface, **values} if interface else values
        elements.append(
            Element(
                index=place,
                kind=kind,
                parent=parents[place],
                ordinal=1 + sum(elements[other].kind is kind for other in same),
                children=tuple(n for n, parent in enumerate(parents) if parent == place),
                attributes=tuple(
                    Attribute(name, str(value).lower() if value is True else str(value), value,
                              line + spread, column)
                    for name, value in texts.items()
                ),
                line=line,
                column=column,
                start=0,
                end=0,
                control_type=ControlType.SEQUENTIAL if kind is Kind.CONTROL else None,
            )
        )  # fmt: skip
    return Plan("plan.xml", tuple(elements))


PLAN = plan_of(
    (1, NAV, 2, 3, {"x": 1.0, "y": 3}),
    (1, "", 3, 3, {"name": "greet the guest"}),
    (2, TALK, 4, 5, {"name": "greet", "loud": True}),
    (2, NAV, 5, 5, {"x": 2, "goal": "dock"}),
    (2, "line", 5, 60, {}),
    (1, "", 6, 3, {}),
)


def bind(text: str, plan: Plan = PLAN) -> ast.Formula:
    return parse_assumption(text).bind(plan).formula


def scenarios(size: int) -> list[tuple[Outcome, ...]]:
    return list(itertools.product(Outcome, repeat=size))


def failed(outcome: Outcome) -> bool:
    return outcome in (F, N)


def refusal(text: str, plan: Plan | None = None) -> str:
    if plan is None:
        with pytest.raises(AssumptionError) as caught:
            parse_assumption(text)
    else:
        assumption = parse_assumption(text)
        with pytest.raises(AssumptionError) as caught:
            assumption.bind(plan)
    return str(caught.value)


MEANINGS: list[tuple[str, Predicate]] = [
    ("never fails: SpeechRunner", lambda o: not failed(o[1])),
    ("SpeechRunner never fails", lambda o: not failed(o[1])),
    ("NEVER FAILS SpeechRunner", lambda o: not failed(o[1])),
    ("never fails: WaypointRunner, line 4", lambda o: not any(map(failed, o[:3]))),
    ("always succeeds: WaypointRunner", lambda o: o[0] is S and o[2] is S),
    ("always fails: line 2", lambda o: failed(o[0])),
    ("never succeeds: /Plan/Control[1]", lambda o: S not in o[1:]),
    ("never hangs: *", lambda o: H not in o),
    ("always starts: *Runner", lambda o: N not in o[:3]),
    ("line 2 does not start", lambda o: o[0] is N),
    ("line 2 no-start", lambda o: o[0] is N),
    ("line 2 starts", lambda o: o[0] is not N),
    ("line 2 doesn't fail", lambda o: not failed(o[0])),
    ("line 2 hangs", lambda o: o[0] is H),
    ("line 2 fails implies line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("if line 2 fails then line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("line 2 fails => line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("line 2 fails only if line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("line 2 fails iff line 4 fails", lambda o: failed(o[0]) == failed(o[1])),
    ("line 2 fails if and only if line 4 fails", lambda o: failed(o[0]) == failed(o[1])),
    ("line 2 fails xor line 4 fails", lambda o: failed(o[0]) != failed(o[1])),
    ("!line 2 fails & line 4 hangs", lambda o: not failed(o[0]) and o[1] is H),
    (
        "line 2 fails or line 4 fails and line 5:5 fails",
        lambda o: failed(o[0]) or (failed(o[1]) and failed(o[2])),
    ),
    (
        "line 2 fails -> line 4 fails -> line 5:5 fails",
        lambda o: not failed(o[0]) or not failed(o[1]) or failed(o[2]),
    ),
    ("any WaypointRunner fails", lambda o: failed(o[0]) or failed(o[2])),
    ("every WaypointRunner fails", lambda o: failed(o[0]) and failed(o[2])),
    ("no WaypointRunner fails", lambda o: not failed(o[0]) and not failed(o[2])),
    ("all line 5 fail", lambda o: failed(o[2]) and failed(o[3])),
    ("at most one of * fails", lambda o: sum(map(failed, o)) <= 1),
    ("at least 2 * fail", lambda o: sum(map(failed, o)) >= 2),
    ("exactly two of (line 2, line 4, line 5:5) hang", lambda o: o[:3].count(H) == 2),
    ("exactly one of (line 2 fails, not line 4 hangs)", lambda o: failed(o[0]) != (o[1] is not H)),
    ("none of (line 2 fails, line 4 hangs)", lambda o: not failed(o[0]) and o[1] is not H),
    ("same: WaypointRunner", lambda o: o[0] is o[2]),
    ("same: line 2, line 4, line 5:60", lambda o: o[0] is o[1] is o[3]),
    ("if line 4 fails then WaypointRunner agree", lambda o: not failed(o[1]) or o[0] is o[2]),
    ('"line" fails', lambda o: failed(o[3])),
    ("/Plan/Control[1]/Runner[2] fails", lambda o: failed(o[2])),
    ("nav2_*/Way* never fails", lambda o: not failed(o[0]) and not failed(o[2])),
    ('name "greet" fails', lambda o: failed(o[1])),
    ("all named 'greet the guest' fail", lambda o: all(map(failed, o[1:]))),
]  # fmt: skip


@pytest.mark.parametrize(("text", "meaning"), MEANINGS, ids=[text for text, _ in MEANINGS])
def test_meaning(text: str, meaning: Predicate) -> None:
    formula = bind(text)
    for scenario in scenarios(4):
        assert ast.holds(formula, scenario) == meaning(scenario), scenario


@pytest.mark.parametrize(
    ("selector", "chosen"),
    [
        ("WaypointRunner(x=1.0, y=3)", {0}),
        ("WaypointRunner(x=1)", {0}),
        ('WaypointRunner(y="3.0")', {0}),
        ("WaypointRunner(x=2.0)", {2}),
        ("WaypointRunner(goal=dock)", {2}),
        ("WaypointRunner(goal='dock')", {2}),
        ("WaypointRunner(x=3)", set()),
        ("WaypointRunner(z=1)", set()),
        ("SpeechRunner(loud=true)", {1}),
        ("SpeechRunner(loud=1)", set()),
        ("SpeechRunner(name=greet)", {1}),
        ("WaypointRunner()", {0, 2}),
    ],
)
def test_parameters_compare_as_typed(selector: str, chosen: set[int]) -> None:
    assert ast.runners(bind(f"never fails: {selector}")) == chosen


def test_a_line_in_the_middle_of_a_start_tag_selects_it() -> None:
    plan = plan_of((1, NAV, 2, 3, {}), (1, TALK, 7, 3, {}), spread=3)
    assert ast.runners(bind("line 4 fails", plan)) == {0}
    assert ast.runners(bind("line 10 fails", plan)) == {1}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("never fails: Gripper*", True),
        ("all GripperRunner fail", True),
        ("any GripperRunner fails", False),
        ("at most 1 GripperRunner fails", True),
        ("at least 1 GripperRunner fails", False),
        ("GripperRunner fails", True),  # speaks of an instance that is not there: does not apply
        ("not GripperRunner fails", True),
        ("GripperRunner fails or not GripperRunner fails and any GripperRunner fails", True),
        ("same: GripperRunner", True),
    ],
)
def test_interfaces_that_match_nothing(text: str, value: bool) -> None:
    bound = parse_assumption(text).bind(PLAN)
    assert bound.formula == ast.Constant(value)
    assert len(bound.unmatched) == 1
    assert bound.unmatched[0].startswith("Gripper")


def test_unmatched_is_empty_where_all_match() -> None:
    bound = parse_assumption("never fails: *").bind(PLAN)
    assert (bound.text, bound.unmatched) == ("never fails: *", ())


def test_the_empty_plan() -> None:
    empty = plan_of()
    assert bind("never fails: *", empty) == ast.Constant(True)
    assert "nor does any other line" in refusal("line 9 fails", empty)
    assert "there is no runner inside /Plan" in refusal("all /Plan fail", empty)


# --- errors ---

SYNTAX_ERRORS = {
    "line 7 fials implies line 9 succeeds": """\
expected what happens ('succeeds', 'fails', 'hangs' or 'does not start'), found 'fials'
    line 7 fials implies line 9 succeeds
           ^
did you mean 'fails'?
for example: line 7 fails implies line 9 succeeds""",
    "never fails:": """\
expected what to select, such as 'line 7', '/Plan/Runner[2]' or 'SpeechRunner', found the end
    never fails:
                ^
for example: never fails: SpeechRunner""",
    "line 7 fails\n\tline 9 fails": """\
expected a word such as 'and' or 'implies', or the end, found 'line'
    line 7 fails  line 9 fails
                  ^
for example: line 7 fails implies line 9 succeeds""",
    "line x fails": """\
expected a line number such as 7 or 7:12, found 'x'
    line x fails
         ^
for example: line 7 fails implies line 9 succeeds""",
    "if line 7 fails line 9 fails": """\
expected 'then', or a word such as 'and' or 'implies', found 'line'
    if line 7 fails line 9 fails
                    ^
for example: if line 7 fails then line 9 succeeds""",
    "line 7 fails and": """\
expected a claim such as 'line 7 fails', found the end
    line 7 fails and
                    ^
for example: line 7 fails implies line 9 succeeds""",
    '"Speech fails': """\
this quote is never closed
    "Speech fails
    ^""",
    "not /Plan/Runner[0] fails": """\
an element path is written like /Plan/Control[1]/Runner[2], counting from 1
    not /Plan/Runner[0] fails
        ^""",
    "any line 7 agree": """\
'agree' is said of all instances, not of 'any'
    any line 7 agree
        ^""",
    "  ": """\
the assumption is empty
for example: line 7 fails implies line 9 succeeds""",
}


@pytest.mark.parametrize("text", SYNTAX_ERRORS)
def test_syntax_error(text: str) -> None:
    assert refusal(text) == SYNTAX_ERRORS[text]


BINDING_ERRORS = {
    "line 5 fails": """\
'line 5' selects 2 runner instances: write 'any line 5' (at least one of them) or 'all line 5' \
(each of them), or select one: 'line 5:5', 'line 5:60'
    line 5 fails
    ^""",
    "line 2 fails implies WaypointRunner fails": """\
'WaypointRunner' selects 2 runner instances: write 'any WaypointRunner' (at least one of them) or \
'all WaypointRunner' (each of them), or select one: 'line 2:3', 'line 5:5'
    line 2 fails implies WaypointRunner fails
                         ^""",
    "never fails: line 9": """\
line 9 holds no runner; the nearest are on line 5, 4, 2
    never fails: line 9
                 ^""",
    "never fails: line 3": """\
line 3 holds no runner; to speak of those inside, write /Plan/Control[1]
    never fails: line 3
                 ^""",
    "line 5:7 fails": """\
no runner starts at 5:7; near it: 5:5, 5:60
    line 5:7 fails
    ^""",
    "/Plan/Control[3] fails": """\
there is no /Plan/Control[3]; /Plan holds Runner[1], Control[1], Control[2]
    /Plan/Control[3] fails
    ^""",
    "never fails: /Plan/Control[2]": """\
there is no runner inside /Plan/Control[2]
    never fails: /Plan/Control[2]
                 ^""",
}


@pytest.mark.parametrize("text", BINDING_ERRORS)
def test_binding_error(text: str) -> None:
    assert refusal(text, PLAN) == BINDING_ERRORS[text]


def test_the_excerpt_of_a_long_text_is_short() -> None:
    lines = refusal("line 2 fails and " * 300 + "line 2 oops\x1b[31m").splitlines()
    assert all(len(line) < 120 and line.isprintable() for line in lines)
    assert lines[1][lines[2].index("^") :].startswith("oops")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("!" * 51 + "line 2 fails", "nests at most 50 levels"),
        ("line 2 fails => " * 51 + "line 2 fails", "nests at most 50 levels"),
        ("x" * 10_001, "at most 10000 characters"),
        ("(" * 9_000, "expected"),
        ("line " + "9" * 9_000 + " fails", "line number"),
        ("line 2 fails iff " * 500, "nests at most 50 levels"),
    ],
)
def test_hostile_text_ends_in_a_message(text: str, said: str) -> None:
    assert said in refusal(text)


def test_limits_admit_what_is_just_inside() -> None:
    assert ast.runners(bind("!" * 50 + "line 2 fails")) == {0}
    assert ast.runners(bind("(" * 4_000 + "line 2 fails" + ")" * 4_000)) == {0}
    assert ast.runners(bind(" or ".join(["line 2 fails"] * 600))) == {0}


PIECES = (
    "line 2 7:1 fails succeed never always not and or implies iff if then any all at most one of"
    ' ( ) , : => ! "a" SpeechRunner /Plan/Runner[1] (x=1) same xor agree name does start'
)


@given(st.lists(st.sampled_from(PIECES.split()), max_size=12).map(" ".join) | st.text(max_size=40))
def test_any_text_parses_or_is_refused(text: str) -> None:
    try:
        parse_assumption(text).bind(PLAN)
    except AssumptionError as error:
        assert str(error)  # noqa: PT017  (any other exception fails the test)


# --- properties of the written form ---

SELECTORS = {
    "line 2": 0, "/Plan/Runner[1]": 0, "SpeechRunner": 1, 'name "greet"': 1, "line 5:5": 2,
    "nav2_capabilities/Way*(x=2)": 2, '"line"': 3,
}  # fmt: skip
VERBS: dict[str, Callable[[Outcome], bool]] = {
    "fails": failed,
    "succeeds": lambda outcome: outcome is S,
    "hangs": lambda outcome: outcome is H,
    "does not start": lambda outcome: outcome is N,
    "does not fail": lambda outcome: not failed(outcome),
}
Level = tuple[int, str, Predicate]  # binding strength, text, meaning


def claim(selector: str, verb: str) -> Level:
    return 9, f"{selector} {verb}", lambda o: VERBS[verb](o[SELECTORS[selector]])


def within(level: Level, least: int) -> str:
    return level[1] if level[0] >= least else f"({level[1]})"


def combine(parts: tuple[str, Level, Level]) -> Level:
    """The text with as few parentheses as the precedences of the documentation need."""
    operator, one, two = parts
    p, q = one[2], two[2]
    if operator == "not":
        return 8, f"not {within(one, 8)}", lambda o: not p(o)
    if operator == "if":
        return 2, f"if {one[1]} then {within(two, 2)}", lambda o: not p(o) or q(o)
    if operator == "at most":
        return 9, f"at most 1 of ({one[1]}, {two[1]})", lambda o: not (p(o) and q(o))
    strength, left, right, meaning = {
        "and": (7, 8, 8, lambda o: p(o) and q(o)),
        "xor": (6, 7, 7, lambda o: p(o) != q(o)),
        "or": (5, 6, 6, lambda o: p(o) or q(o)),
        "implies": (2, 5, 2, lambda o: not p(o) or q(o)),
        "iff": (1, 1, 2, lambda o: p(o) == q(o)),
    }[operator]
    return strength, f"{within(one, left)} {operator} {within(two, right)}", meaning


CLAIMS = st.builds(claim, st.sampled_from(sorted(SELECTORS)), st.sampled_from(sorted(VERBS)))
OPERATORS = st.sampled_from(["not", "if", "at most", "and", "xor", "or", "implies", "iff"])
TEXTS = st.recursive(
    CLAIMS, lambda level: st.tuples(OPERATORS, level, level).map(combine), max_leaves=8
)


@given(TEXTS)
@settings(deadline=None)
def test_precedence_and_meaning_of_random_texts(level: Level) -> None:
    _, text, meaning = level
    assumption = parse_assumption(text)
    formula = assumption.bind(PLAN).formula
    assert all(ast.holds(formula, scenario) == meaning(scenario) for scenario in scenarios(4))
    assert parse_assumption(str(assumption)).statement == assumption.statement


@pytest.mark.parametrize("text", [text for text, _ in MEANINGS])
def test_the_canonical_form_parses_to_the_same(text: str) -> None:
    assumption = parse_assumption(text)
    assert parse_assumption(str(assumption)).statement == assumption.statement


LABELS = st.text(min_size=1, max_size=8)


@given(LABELS, LABELS, st.text("abz_09.-", min_size=1, max_size=5))
def test_any_name_can_be_quoted(interface: str, value: str, name: str) -> None:
    selector = ast.InterfaceSelector(interface, ((name, value),), literal=True)
    verb = ast.Verb("fail")
    statement = ast.Claim(ast.Quantifier("any"), (selector, ast.LabelSelector(value)), verb)
    assert parse_assumption(str(statement)).statement == statement


# --- formulas ---

SIZE = 3
ATOMS = st.builds(ast.Atom, st.integers(0, SIZE - 1), st.frozensets(st.sampled_from(list(Outcome))))
AGREES = st.lists(st.integers(0, SIZE - 1), unique=True).map(lambda n: ast.Agree(tuple(sorted(n))))


def branches(inner: st.SearchStrategy[ast.Formula]) -> st.SearchStrategy[ast.Formula]:
    parts = st.lists(inner, max_size=4).map(tuple)
    return st.one_of(
        inner.map(lambda part: ast.Not((part,))),
        parts.map(ast.And),
        parts.map(ast.Or),
        st.tuples(inner, inner).map(ast.Iff),
        st.builds(ast.Count, st.integers(-1, 5), st.integers(-1, 5), parts),
        inner.map(ast.negation),
        parts.map(ast.conjunction),
        parts.map(ast.disjunction),
        st.builds(ast.count, st.integers(-1, 5), st.integers(-1, 5), parts),
    )


FORMULAS = st.recursive(st.builds(ast.Constant, st.booleans()) | ATOMS | AGREES, branches)


KINDS = {S: "s", N: "n", H: "h"}


def symbolic(runner: int, outcomes: frozenset[Outcome]) -> str:
    """A term over s (succeeds), n (does not start), h (hangs); FAILED is none of these."""
    kinds = {outcome: f"{kind}{runner}" for outcome, kind in KINDS.items()}
    terms = {**kinds, F: f"(not (or {' '.join(kinds.values())}))"}
    return f"(or false {' '.join(terms[outcome] for outcome in sorted(outcomes))})"


@given(FORMULAS)
@settings(deadline=None)
def test_smt_agrees_with_evaluation(formula: ast.Formula) -> None:
    compare_with_z3(formula)


@pytest.mark.parametrize(("least", "most"), list(itertools.product(range(SIZE + 1), repeat=2)))
def test_smt_of_counts(least: int, most: int) -> None:
    atoms = tuple(ast.Atom(runner, frozenset({F, N})) for runner in range(SIZE))
    compare_with_z3(ast.Count(least, most, atoms))


@pytest.mark.parametrize("runners", [(), (1,), (0, 2), (0, 1, 2)])
def test_smt_of_agreement(runners: tuple[int, ...]) -> None:
    compare_with_z3(ast.Agree(runners))


def compare_with_z3(formula: ast.Formula) -> None:
    names = [f"{kind}{runner}" for runner in range(SIZE) for kind in "snh"]
    solver = z3.SolverFor("QF_FD")
    declarations = "".join(f"(declare-const {name} Bool)" for name in [*names, "q0"])
    solver.from_string(f"{declarations}(assert (= q0 {ast.to_smt(formula, symbolic)}))")
    for scenario in scenarios(SIZE):
        true = {f"{KINDS[o]}{n}" for n, o in enumerate(scenario) if o in KINDS}
        given_ = [z3.Bool(name) if name in true else z3.Not(z3.Bool(name)) for name in names]
        expected = ast.holds(formula, scenario)
        question = z3.Bool("q0") if expected else z3.Not(z3.Bool("q0"))
        assert solver.check(*given_, question) == z3.sat
        assert solver.check(*given_, z3.Not(question)) == z3.unsat


FEW: tuple[ast.Formula, ...] = (
    ast.Constant(True),
    ast.Constant(False),
    ast.Atom(0, frozenset({S})),
    ast.Atom(1, frozenset({S})),
)


@pytest.mark.parametrize("size", range(4))
def test_folding_changes_no_meaning(size: int) -> None:
    bounds = list(itertools.product(range(-1, 5), repeat=2))
    for parts in itertools.product(FEW, repeat=size):
        pairs: list[tuple[ast.Formula, ast.Formula]] = [
            (ast.conjunction(parts), ast.And(parts)),
            (ast.disjunction(parts), ast.Or(parts)),
            *((ast.negation(part), ast.Not((part,))) for part in parts),
            *((ast.count(n, m, parts), ast.Count(n, m, parts)) for n, m in bounds),
        ]
        for scenario in itertools.product((S, F), repeat=2):
            for folded, plain in pairs:
                assert ast.holds(folded, scenario) == ast.holds(plain, scenario), plain


@given(FORMULAS)
def test_unary_says_the_same_as_the_formula(formula: ast.Formula) -> None:
    allowed = ast.unary(formula)
    if allowed is not None:
        for scenario in scenarios(SIZE):
            single = all(scenario[runner] in outcomes for runner, outcomes in allowed.items())
            assert single == ast.holds(formula, scenario)


@given(st.lists(ATOMS, max_size=5), st.booleans())
def test_unary_splits_conjunctions_of_single_constraints(atoms: list[ast.Atom], flip: bool) -> None:
    formula: ast.Formula = ast.And(tuple(atoms))
    if flip:
        formula = ast.Not((ast.Or(tuple(map(ast.negation, atoms))),))
    assert ast.unary(formula) is not None


def test_unary_of_what_does_not_split() -> None:
    assert ast.unary(bind("line 2 fails or line 4 fails")) is None
    assert ast.unary(bind("same: line 2, line 4")) is None
    assert ast.unary(ast.Constant(False)) is None
    assert ast.unary(ast.Constant(True)) == {}
    assert ast.unary(bind("not line 2 fails and not line 2 hangs")) == {0: frozenset({S})}


def test_nested_counts_stay_small() -> None:
    text = "line 2 fails"
    for _ in range(40):
        text = f"exactly 1 of ({text}, line 4 hangs, line 5:5 fails)"
    assert len(ast.to_smt(bind(text), symbolic)) < 40 * 300


def test_wide_and_deep_formulas() -> None:
    atoms = tuple(ast.Atom(runner, frozenset({S})) for runner in range(100_000))
    deep: ast.Formula = ast.Count(1, 1, atoms)
    for _ in range(10_001):
        deep = ast.Not((deep,))
    scenario = [F] * 99_999 + [S]
    assert not ast.holds(ast.And(atoms), scenario)
    assert ast.holds(ast.Or(atoms), scenario)
    assert not ast.holds(deep, scenario)
    assert len(ast.runners(deep)) == 100_000
    assert len(ast.unary(ast.And(atoms)) or {}) == 100_000
    assert ast.to_smt(ast.Or(atoms), lambda runner, _: f"s{runner}").count(" ") == 100_000


def test_lark_is_imported_only_when_an_assumption_is_parsed() -> None:
    code = "import sys, gpsfsm.analysis.assume as a; assert 'lark' not in sys.modules;"
    code += "a.parse_assumption('line 7 fails'); assert 'lark' in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def examples_of_the_documentation() -> list[str]:
    text = (Path(__file__).parents[2] / "docs" / "assumptions.md").read_text(encoding="utf-8")
    section = text.partition("## Examples")[2].partition("\n## ")[0]
    return re.findall(r"^\| `([^`]+)`", section, flags=re.MULTILINE)


def test_the_examples_of_the_documentation_parse() -> None:
    examples = examples_of_the_documentation()
    assert len(examples) > 10
    for example in examples:
        assert str(parse_assumption(example))
