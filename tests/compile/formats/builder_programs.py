"""Random programs that build machines of SMACH and FlexBE, and a judge that runs them.

The judge (``stand_ins``) is a process of its own. What the reader accepts has to be what the
program builds in every world in which it builds anything.
"""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.formats.python_source import FLEXBE, SMACH, Source
from gpsfsm.model.precision import Cause
from gpsfsm.syntax.source import DEFAULT_LIMITS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile.formats.states import State

TARGETS = ["'succeeded'", "'aborted'", "'A'", "'B'", "k", "m", "way[0]", "way[1]", "t['succeeded']"]
TARGETS += ["pick(way)", "pick(('A',))", "way[n]", "'%s' % k", "f'{k}'", "k if n else m", "fs[0]()"]
TARGETS += ["t.get('failed')", "names[0] if names else k", "None", "box.k", "max(way)"]
CONDITIONS = [
    "n",
    "not n",
    "k == 'A'",
    "rospy.get_param('x')",
    "foo()",
    "'A' in way",
    "len(way) > 1",
]
CONDITIONS += ["common.FLAG", "n or foo()", "n and foo(way)", "k is None", "box", "True", "way"]
SIMPLE = [
    *("k = 'A'", "k = m", "m = 'aborted'", "k, m = m, k", "n = 1 - n", "n += 1", "way.reverse()"),
    *("way = ['A', 'B']", "way[0] = 'A'", "way = way[:1] + ['aborted']", "way.append('A')"),
    *(
        "way = sorted(way)",
        "way.insert(0, k)",
        "way.pop()",
        "del way[0]",
        "way += ['A']",
        "way = w2",
    ),
    *("w2 = way", "w2.reverse()", "w2 = list(way)", "w2 = way.copy()", "w2.remove('A')"),
    *("t['failed'] = 'A'", "t = dict(t)", "t.update(failed='B')", "t |= {'failed': 'A'}"),
    *(
        "t.pop('failed')",
        "t.setdefault('reached', 'A')",
        "t = {**t, 'failed': k}",
        "del t['failed']",
    ),
    *("t2 = t", "t2['succeeded'] = 'B'", "t2 = t.copy()", "t.clear()", "t = {}", "turn(way)"),
    *(
        "turn(t)",
        "k = pick(way)",
        "k = foo()",
        "foo(way)",
        "foo(t)",
        "foo(turned)",
        "foo(k)",
        "foo(box)",
    ),
    *(
        "common.helper(t)",
        "m = common.helper(way)",
        "k = rospy.get_param('x')",
        "rospy.loginfo(way)",
    ),
    *("way = [e for e in way]", "t = {e: 'A' for e in t}", "k = (lambda: 'A')()", "box.k = 'B'"),
    *(
        "fs.append(lambda: k)",
        "fs[0] = turned",
        "k = next(iter(way))",
        "names.append(k)",
        "change()",
    ),
    *("(k := 'B')", "assert n < 9", "global k", "print(k)", "k = str(n)", "del k", "import my_pkg"),
    *(
        "from my_pkg.common import helper",
        "k = box.k",
        "box.way = way",
        "box.way.reverse()",
        "pass",
    ),
    *(
        "way = [f for e in way for f in (e, k) if f != 'A']",
        "way = [turn(way) for e in way]",
        "t = {e: k for e in t if e != 'succeeded'}",
        "t = {pick(way): e for e in way}",
        "[k := e for e in way]",
        "way = [m := e for e in way]",
        "k = [*(m := e for e in way)]",
        "fs = [lambda: e for e in way]",
        "k = [e for e in foo()]",
        "way = [way.pop() for e in t]",
        "way = {e: [k] for e in names}.get('A', way)",
    ),
    *(
        "match k:\n    case 'A': k = 'B'\n    case 'B': way.reverse()",
        "match 1:\n    case 2: k = 'B'\n    case 1: way = ['A']",
        "match way:\n    case 'A': k = 'B'\n    case _: m = 'A'",
        "match k:\n    case 'A' if foo(): k = 'B'\n    case _: m = 'A'",
        "try:\n    k = 'B'\n    t = {'succeeded': 'A'}\nexcept Exception:\n    k = 'A'",
        "try:\n    t['failed'] = 'A'\nexcept Exception:\n    k = 'A'",
        "try:\n    pass\nexcept Exception:\n    k = 'A'\nelse:\n    k = foo()\nfinally: m = 'B'",
    ),
    *(
        "exec(\"k = 'B'\")",
        "globals()['k'] = 'B'",
        "setattr(box, 'k', 'A')",
        "k = getattr(box, 'k')",
    ),
    *(
        "add = sm.add",
        "StateMachine.add = turn",
        "k = {'A': 'B'}.get(k, 'A')",
        "k = way.index('A')",
    ),
    *("k = vars()['m']", "first, *way = ['A', 'B', 'A']", "k = ''.join(way)", "k = 'B'.lower()"),
    *("class Box:\n    k = 'aborted'\nbox = Box()", "def pick(row): return row[-1]"),
    *(
        "def change():\n    global k\n    k = 'B'",
        "def turned():\n    way.reverse()\n    return 'A'",
    ),
    *("async def late(): pass", "def gen():\n    yield way.reverse()", "list(gen())"),
    *("@foo\ndef pick(row): return 'B'", "sm = None", "StateMachine = foo", "sys.exit()"),
]
LATER = [
    *("sm.set_initial_state(['B'])", "sm.set_initial_state([k])", "sm._transitions['A'] = {}"),
    *("sm._states.clear()", "t['failed'] = 'B'", "foo(sm)", "sm.register_outcomes(['B'])"),
    *(
        "sm.userdata.x = way",
        "sm.execute()",
        "with sm: StateMachine.add('Z', X(), {'failed': 'A'})",
    ),
    *(
        "sm.open()\nStateMachine.add('Z', X())\nsm.close()",
        "sm2 = sm\nsm2.set_initial_state(['A'])",
    ),
    *("if rospy.get_param('x'): sm.set_initial_state(['B'])", "t.clear()", "way.reverse()"),
    *(
        "for e in t: t[e] = 'A'",
        "box.sm = sm\nbox.sm.set_initial_state(['B'])",
        "foo(t)",
        "turn(t)",
    ),
]
PROLOGUE = """\
import sys
import rospy
from contextlib import suppress
from my_pkg import common
k, m, n = 'succeeded', 'aborted', 1
way = ['succeeded', 'A']
w2 = ['A', 'B', 'succeeded']
t = {'succeeded': 'A', 'failed': 'aborted'}
t2 = {'succeeded': 'B'}
fs, names = [lambda: 'succeeded'], []
def pick(row): return row[0]
def turn(x):
    if isinstance(x, list): x.reverse()
    else: x['failed'] = 'A'
def turned(): t['succeeded'] = 'succeeded'
def change(): way.reverse()
class Box:
    def __init__(self): self.k = 'A'
box = Box()
"""


class Programs:
    """Programs of one random number generator."""

    def __init__(self, random: Random, *, flexbe: bool) -> None:
        self.random, self.flexbe = random, flexbe
        self.add = "OperatableStateMachine.add" if flexbe else "StateMachine.add"
        self.label = iter("ABCDEFGHIJKLMNOPQRSTUVW")

    def one_of(self, *rows: Any) -> Any:
        return self.random.choice(rows)

    def target(self) -> str:
        random = self.random
        return random.choice(TARGETS[:4] if random.random() < 0.5 else TARGETS)

    def added(self) -> list[str]:
        """Statements that add a state."""
        label = next(self.label)
        state = self.one_of("X()", "X()", "Y()", "W()", "V(['succeeded', 'failed'])", "made")
        if not self.flexbe and self.random.random() < 0.15:
            state = self.one_of("StateMachine(['succeeded'])", "smach.CBState(pick, outcomes=way)")
        rows = f"{{'succeeded': {self.target()}, 'failed': {self.target()}}}"
        rows = self.one_of(*[rows] * 7, "t", "t", "dict(t)", "t2", "None", "{}", "common.helper()")
        name = self.one_of(*[repr(label)] * 9, f"'{label}' + str(n)", "k", "way[0]", "names")
        call = f"{self.add}({name}, {state}, transitions={rows})"
        chance = self.random.random()
        if chance < 0.6:
            return [call]
        if chance < 0.68 and not self.flexbe:
            connectors = self.one_of("['succeeded']", "['succeeded', 'failed']", "way", "[k]")
            return [f"StateMachine.add_auto({name}, {state}, {connectors}, {rows})"]
        return self.one_of(
            [f"if {self.one_of(*CONDITIONS)}:", f"    {call}"],
            [f"for k in {self.one_of('way', '[]', 'foo()', 't')}:", f"    {call}"],
            [
                f"for e in {self.one_of('way', 'range(2)', 'w2')}:",
                f"    {self.add}('{label}' + str(e), {state}, transitions={rows})",
            ],
            [f"[{call} for e in way]"],
            [f"[{call} for k in ('A', 'B')]"],
            [f"{self.one_of('n', 'foo()', 'k')} and {call}"],
            [f"made = {state}", call],
            [f"args = [{name}, {state}]", f"{self.add}(*args, transitions={rows})"],
            [f"options = {{'transitions': {rows}}}", f"{self.add}({name}, {state}, **options)"],
            [f"getattr({self.add[:-4]}, 'add')({name}, {state}, transitions={rows})"],
            [f"def adder(): {call}", self.one_of("adder()", "foo(adder)", "n and adder()")],
            ["try:", f"    {call}", "except Exception:", "    pass"],
            ["with suppress(Exception):", "    k = foo()", f"    {call}"],
            [f"def adder(): {call.replace(self.add, 'place')}", "foo(lambda: adder())"],
            ["while n < 2:", f"    {call}", "    n += 1"],
            [f"(lambda: {call})()"],
            [f"sm.{self.add.rpartition('.')[2]}({name}, {state}, transitions={rows})"],
            [call.replace(self.add, "place")],
        )

    def statements(self, pool: list[str], depth: int = 2) -> list[str]:
        """A statement, perhaps of others."""
        random = self.random
        if not depth or random.random() < 0.65:
            return random.choice(pool).split("\n")
        inner = [f"    {line}" for line in self.statements(pool, depth - 1)]
        other = [f"    {line}" for line in self.statements(pool, depth - 1)]
        test = random.choice(CONDITIONS)
        return self.one_of(
            [f"if {test}:", *inner],
            [f"if {test}:", *inner, "else:", *other],
            [f"while n < {random.randrange(3)}:", *inner, "    n += 1"],
            [f"while {test}:", *inner, "    break"],
            [f"for e in {self.one_of('way', 't', 'range(2)', 'foo()')}:", *inner],
            ["for e in way:", *inner, f"    if {test}: {self.one_of('break', 'continue')}", *other],
            ["try:", *inner, *other, "except Exception:", *other],
            ["try:", *inner, "except KeyError:", "    pass", "else:", *other],
            ["try:", *inner, "finally:", *other],
            ["with suppress(Exception):", *inner, *other],
            [f"while {test}:", *inner, f"    if {test}: break", "    n += 1", "else:", *other],
            [f"match {self.one_of('n', 'k')}:", "    case 1:"]
            + [f"    {line}" for line in inner]
            + ["    case _:", *[f"    {line}" for line in other]],
            ["def run():", *inner, f"    if {test}: return", *other, "run()"],
            ["def run():", *inner, self.one_of("run()", "foo(run)", "pass")],
            [f"k = 'B' if {test} else k"],
        )

    def program(self) -> str:
        """A program."""
        random = self.random
        before = [line for _ in range(random.randrange(3)) for line in self.statements(SIMPLE)]
        during: list[str] = []
        for _ in range(random.choice((1, 2, 2, 3))):
            during += self.added()
            if random.random() < 0.2:
                during += self.statements(SIMPLE, 1)
        later = LATER if not self.flexbe else SIMPLE
        after = self.statements([*later, *SIMPLE], 1) if random.random() < 0.4 else []
        outcomes = self.one_of(
            *["['succeeded', 'aborted', 'A', 'B']"] * 5, "['succeeded', m]", "way + ['aborted']"
        )
        made = f"sm = {self.add[:-4]}({self.one_of('', 'outcomes=')}{outcomes})"
        body = [*before, made, "with sm:", *[f"    {line}" for line in during], *after]
        return self._whole(body)

    def _whole(self, body: list[str]) -> str:
        base = "EventState" if self.flexbe else "smach.State"
        states = (
            f"class W({base}):\n"
            "    def __init__(self, *args):\n"
            f"        {base}.__init__(self, outcomes=['succeeded', 'failed'])\n"
            f"class V({base}):\n"
            "    def __init__(self, rows):\n"
            "        super().__init__(outcomes=rows)\n"
            "made = W()\n"
        )
        if self.flexbe:
            head = "from flexbe_core import *\nplace = OperatableStateMachine.add\n"
            lines = [*body, "return sm"]
            inner = "".join(f"        {line}\n" for line in [*PROLOGUE.splitlines()[4:], *lines])
            text = f"class T(Behavior):\n    def create(self):\n{inner}"
            return head + "\n".join(PROLOGUE.splitlines()[:4]) + "\n" + states + text
        head = "import smach\nfrom smach import StateMachine\nplace = StateMachine.add\n"
        lines = body
        if self.random.random() < 0.3:
            inside = [*PROLOGUE.splitlines()[4:], *body, "sm.execute()"]
            lines = ["def main():", *[f"    {each}" for each in inside]]
            lines += self.one_of(["main()"], ["if __name__ == '__main__':", "    main()"])
            lines += [] if self.random.random() < 0.8 else self.statements(SIMPLE)
        return head + PROLOGUE + states + "\n".join(lines) + "\n"


def program(seed: int) -> str:
    """A program that Python can parse."""
    for more in range(99):
        random = Random(seed * 101 + more)  # noqa: S311  (no secrets here)
        text = Programs(random, flexbe=random.random() < 0.3).program()
        try:
            compile(text, "program", "exec")
        except SyntaxError:
            continue
        return text
    raise AssertionError(seed)


@cache
def _process() -> subprocess.Popen[str]:
    file = str(Path(__file__).with_name("stand_ins.py"))
    return subprocess.Popen(
        [sys.executable, "-W", "ignore", file],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def ran(text: str) -> list[Any]:
    """The machines that a program builds in the worlds in which it builds any."""
    process = _process()
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps(text) + "\n")
    process.stdin.flush()
    return [each for each in json.loads(process.stdout.readline()) if each is not None]


def _shown(made: State, *, flexbe: bool) -> Any:
    """A machine as the stand-ins show it; outcomes that only a class tells are left out."""
    states = []
    for each in made.states:
        rows = {
            key: to
            for key, to in each.transitions.items()
            if to and (to != key or key not in each.undeclared)
        }
        if flexbe:
            rows.pop("preempted", None)
        inner = _shown(each, flexbe=flexbe) if each.container else None
        states.append([each.name, rows, inner])
    outcomes = sorted({*made.outcomes} - ({"preempted"} if flexbe else set()))
    ended = {"preempted"}  # FlexBE ends what has a preempted state, by a rule that none has written
    rules = [[key, each] for key, each in made.rules if {key, *each.values()} != ended]
    return [made.initial, outcomes, states, [rules[:: 1 if flexbe else -1], made.default]]


def _wanted(row: Any, *, flexbe: bool) -> Any:
    initial, outcomes, states, rules = row
    outcomes = [each for each in outcomes if each != "preempted" or not flexbe]
    rows = [
        [name, to, None if inner is None else _wanted(inner, flexbe=flexbe)]
        for name, to, _, inner in states
    ]
    return [initial, outcomes, rows, rules]


def judged(text: str) -> Iterator[str]:
    """Refused, or the machine that the program builds, unless a note says what it rests on."""
    flexbe = "flexbe_core" in text
    plan, problems = (FLEXBE if flexbe else SMACH).read(text, "m.py", DEFAULT_LIMITS)  # type: ignore[misc]
    assert (plan is None) == bool(problems)
    worlds = ran(text)
    if plan is None:
        yield "refused" if worlds else "refused, fails"
        return
    if not worlds:
        yield "read, fails"  # no machine: whatever is said of it is true
        return
    source = Source(text)
    top = source._top()
    assert top is not None
    shown = _shown(source.state_of(top), flexbe=flexbe)
    told = {each.cause for each in plan.approximations}
    label = "read"
    for each in worlds:
        wanted = _wanted(each, flexbe=flexbe)
        adds = Cause.ADDS_NOTHING in told and "HELP" in str(wanted)
        if shown != wanted and (adds or Cause.ANOTHER_MACHINE in told):
            label = "read, told"
            continue
        assert shown == wanted, (shown, wanted)
    yield label
