"""Programs that build machines: read as they run, marked, or refused at the line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import gpsfsm
from gpsfsm.compile.formats.python_source import FLEXBE, SMACH
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import many
from tests.compile.formats.builder_programs import judged, program

CASES = Path(__file__).with_name("builders")
REFUSED = {
    "flexbe_ret_sm.py": 14,
    "smach_add_auto.py": 10,  # the documentation and the code of SMACH say the opposite
    "smach_cfg.py": 8,
    "smach_dupadd.py": 6,
    "smach_exec1.py": 5,
    "smach_getattr1.py": 5,
    "smach_helper.py": 6,
    "smach_later.py": 7,
    "smach_matchs.py": 7,
    "smach_pop.py": 6,
    "smach_shadow.py": 1,
    "smach_tryelse.py": 8,
    "smach_tryx.py": 6,
}
"""The line of the refusal. All other programs are read as they run."""


def result(text: str, tool: Any = SMACH) -> Any:
    return tool.read(text, "m.py", DEFAULT_LIMITS)


def causes(text: str, tool: Any = SMACH) -> set[Cause]:
    """The causes of the marks on nodes."""
    plan, problems = result(text, tool)
    assert plan is not None, problems
    rows = {each.cause for each in plan.approximations if each.reading is Reading.OVER}
    assert bool(rows) == bool(plan.inexact)
    return rows


def lines(text: str, tool: Any = SMACH) -> list[int]:
    plan, problems = result(text, tool)
    assert plan is None
    return [each.location.line for each in problems]


@pytest.mark.parametrize("file", sorted(CASES.glob("*.py")), ids=lambda file: file.name)
def test_a_program_is_read_as_it_runs_or_refused_at_its_line(file: Path) -> None:
    text = file.read_text()
    if file.name in REFUSED:
        assert REFUSED[file.name] in lines(text, FLEXBE if "flexbe_core" in text else SMACH)
    else:
        assert list(judged(text)) == ["read"]


@pytest.mark.parametrize("seed", range(many(120)))
def test_random_programs_are_read_as_they_run(seed: int) -> None:
    list(judged(program(seed)))


def test_random_programs_are_read_and_refused() -> None:
    labels = [label for seed in range(60) for label in judged(program(seed))]
    assert {"read", "refused"} <= {*labels}


HEAD = (
    "import smach\nfrom smach import *\nfrom smach_ros import *\nfrom somewhere import Elsewhere\n"
    "class Own(State):\n  def __init__(self):\n"
    "    State.__init__(self, outcomes=['ok', 'failed'])\n"
)
TOP = HEAD + "sm = StateMachine(outcomes=['done', 'aborted'])\nwith sm:\n"
LINE = HEAD.count("\n") + 3  # of what follows TOP


def test_a_state_of_another_file_may_end_as_its_container(tmp_path: Path) -> None:
    """So 'never gives up' is not proved; what its transitions say is."""
    text = TOP + "  StateMachine.add('A', Elsewhere(), {'ok': 'done'})\nsm.execute()\n"
    assert causes(text) == {Cause.UNDECLARED}
    (tmp_path / "m.py").write_text(text)
    (report,) = gpsfsm.check(tmp_path / "m.py").plans
    assert report.facts is not None
    assert str(report.facts.gives_up) == "sometimes"
    own = TOP + "  StateMachine.add('A', Own(), {'ok': 'done', 'failed': 'done'})\n"
    assert not causes(own)


def concurrence(arguments: str, states: str = "") -> str:
    return (
        HEAD + f"c = Concurrence(outcomes=['x', 'y'], default_outcome='y', {arguments})\nwith c:\n"
        "  Concurrence.add('A', Own())\n  Concurrence.add('B', Own())\n" + states
    )


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        ("outcome_map={'x': {'A': 'ok'}}", set()),
        ("outcome_map={'x': {'A': 'ok'}, 'y': {'A': 'failed'}}", set()),
        ("outcome_map={'x': {'A': 'ok', 'B': 'ok'}, 'y': {'A': 'ok'}}", {Cause.VERSION}),
        ("outcome_map={'x': {}}", {Cause.VERSION}),  # never chosen, or always
        ("outcome_cb=lambda each: 'x'", {Cause.CODE}),
        ("child_termination_cb=lambda each: True", {Cause.CODE}),
    ],
)
def test_how_a_concurrence_ends(arguments: str, wanted: set[Cause]) -> None:
    assert causes(concurrence(arguments)) == wanted


def test_a_concurrence_of_another_file_and_one_with_many_combinations() -> None:
    other = "  Concurrence.add('C', Elsewhere())\n"
    assert causes(concurrence("outcome_map={'x': {'C': 'ok'}}", other)) == {Cause.UNDECLARED}
    many_states = "".join(f"  Concurrence.add('C{n}', Own())\n" for n in range(6))
    rule = ", ".join(f"'C{n}': 'ok'" for n in range(6))
    text = concurrence(f"outcome_map={{'x': {{'A': 'ok', {rule}}}}}", many_states)
    assert causes(text) == {Cause.COMBINATIONS}


FLEX = "from flexbe_core import *\nfrom somewhere import Elsewhere\n"
ADD = "OperatableStateMachine.add"


def test_priority_is_marked_where_something_acts_beside_it() -> None:
    inner = (
        f"p = PriorityContainer(outcomes=['x'])\nwith p:\n  {ADD}('P', Elsewhere(), {{'o': 'x'}})\n"
    )
    alone = (
        f"sm = OperatableStateMachine(outcomes=['x'])\nwith sm:\n  {ADD}('A', p, {{'x': 'x'}})\n"
    )
    assert not causes(FLEX + inner + alone, FLEXBE)
    beside = (
        "sm = ConcurrencyContainer(outcomes=['x'], conditions=[('x', [('A', 'x'), ('B', 'x')])])\n"
        f"with sm:\n  {ADD}('A', p, {{'x': 'x'}})\n  {ADD}('B', Elsewhere(), {{'x': 'x'}})\n"
    )
    assert causes(FLEX + inner + beside, FLEXBE) == {Cause.PRIORITY}


def test_flexbe_ends_where_something_is_preempted() -> None:
    """Whatever its transition says; so what it names is never reached."""
    text = (CASES / "flexbe_preempted_outcome_sm.py").read_text()
    (report,) = gpsfsm.check(CASES / "flexbe_preempted_outcome_sm.py").plans
    assert report.facts is not None
    assert str(report.facts.gives_up) == "sometimes"
    assert [each.rule for each in report.findings if each.rule == "GP301"]
    plan, _ = result(text, FLEXBE)
    skipped = {(each.construct, each.cause) for each in plan.approximations}
    assert skipped == {("autonomy", Cause.NO_MEANING), ("preempted", Cause.PREEMPTION)}


def test_a_behaviour_of_another_file_is_marked() -> None:
    text = FLEX + (
        "class B(Behavior):\n  def create(self):\n"
        "    sm = OperatableStateMachine(outcomes=['x'])\n    with sm:\n"
        f"      {ADD}('A', self.use_behavior(Elsewhere, 'A'), {{'x': 'x'}})\n    return sm\n"
    )
    assert causes(text, FLEXBE) == {Cause.ELSEWHERE}


def test_add_auto_leads_to_the_next_state() -> None:
    text = TOP + (
        "  StateMachine.add_auto('A', Own(), ['ok'], {'failed': 'aborted'})\n"
        "  StateMachine.add('B', Own(), {'ok': 'done', 'failed': 'aborted'})\n"
    )
    plan, _ = result(text)
    rows = {plan.path(each.origin) for each in plan.automaton.runners}
    assert rows == {"/machine/A", "/machine/B"}
    assert not causes(text)


GOOD = "  StateMachine.add('A', Own(), {'ok': 'done', 'failed': 'aborted'})\n"


@pytest.mark.parametrize(
    "more",
    [
        "sm.register_outcomes(['x'])\n",
        "sm._states['A'] = None\n",
        "from somewhere import change\nchange(sm)\n",
        "sm.execute()\nwith sm: StateMachine.add('B', Own(), {'failed': 'aborted'})\n",
        "StateMachine.add = None\n",
        "State.get_registered_outcomes = None\n",
        "import sys\nsys.modules['smach'].StateMachine = change\n",
        "type(sm).add = change\n",
        "sm.__class__ = change\n",
        "sm.get_children()['A'].register_outcomes(['x'])\n",
        "def later():\n  with sm: StateMachine.add('B', Own())\nchange(later)\n",
        "def inner(): sm.set_initial_state(['A'])\nchange(lambda: inner())\n",
        "from contextlib import suppress\nwith sm, suppress(KeyError): change()\n",
        "def later(): sm.set_initial_state(['A'])\nimport rospy\nrospy.Timer(1, later)\n",
        "def later(): sm.register_outcomes(['x'])\nchange(later)\n",
        "exec('sm = None')\n",
        "Iterator(outcomes=['x'])\n",
        "try: pass\nexcept* ValueError: pass\n",
        "@change\nclass C(State): pass\nsm.set_initial_state(C)\n",
    ],
)
def test_what_changes_a_machine_otherwise_is_refused(more: str) -> None:
    assert any(line >= LINE + 1 for line in lines(TOP + GOOD + more))


@pytest.mark.parametrize(
    "ending",
    [
        "  except KeyError:\n    if foo(): return sm\n    raise\n",
        "  finally:\n    return sm\n",
    ],
)
def test_an_exception_that_a_statement_ends_may_leave_a_machine_half_built(ending: str) -> None:
    add = "    with sm:\n     StateMachine.add('A', Own(), {'ok': 'done', 'failed': 'aborted'})\n"
    built = f"{HEAD}def build():\n  sm = StateMachine(['done', 'aborted'])\n  try:\n{add}{ending}"
    whole = f"{built}  return sm\nbuild().execute()\n"
    assert lines(whole) == [HEAD.count("\n") + 5]
    raising = whole.replace(ending, "  except KeyError:\n    raise\n")
    assert result(raising)[0] is not None


def test_outcomes_that_only_a_run_decides_are_not_declared() -> None:
    text = TOP.replace("class Own", "import rospy\nclass Own").replace(
        "    State.__init__(self, outcomes=['ok', 'failed'])\n",
        (
            "    if rospy.get_param('x'): State.__init__(self, outcomes=['ok', 'aborted'])\n"
            "    else: State.__init__(self, outcomes=['ok'])\n"
        ),
    )
    assert causes(text + "  StateMachine.add('A', Own(), {'ok': 'done'})\n") == {Cause.UNDECLARED}


def test_who_preempts_is_assumed() -> None:
    text = TOP + GOOD + "sm.execute()\ndef stop(): sm.request_preempt()\n"
    plan, problems = result(text)
    assert plan is not None, problems
    assert {each.cause for each in plan.approximations} == {Cause.PREEMPTION}


def test_a_second_machine_and_names_of_other_files_are_listed() -> None:
    text = TOP + GOOD + "sm.execute()\nfrom somewhere import *\nother = StateMachine(['x'])\n"
    text += "with other:\n  StateMachine.add('A', Own(), {'ok': 'x', 'failed': 'x'})\n"
    plan, problems = result(text)
    assert plan is not None, problems
    assert {each.cause for each in plan.approximations} == {Cause.IMPORTS, Cause.ANOTHER_MACHINE}


@pytest.mark.parametrize("word", ["global", "nonlocal"])  # the parser takes both
def test_names_that_a_module_declares_as_its_own_are_looked_up(word: str) -> None:
    text = f"{word} print, nowhere, done\nprint(nowhere)\n{TOP}  done = 'done'\n"
    text += "  def add():\n    global done, X\n    print(done, X)\n"
    text += "    StateMachine.add('A', Own(), {'ok': done, 'failed': done})\n"
    plan, problems = result(text + "  add()\n")
    assert plan is not None, problems
