"""Foreign statements, arguments and keys in programs that build machines of SMACH and FlexBE.

A valid program gets a statement at any place of any block, an argument that a call does not know,
or a key in a dictionary. What it means is not argued about: the program is run with the stand-ins
(``stand_ins``), and it is refused, or read as exactly the machine that it builds in every world.
So no statement is held harmless beforehand; where a run raises an exception there is no machine.
"""

from __future__ import annotations

import ast
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

from tests.compile.formats import builder_programs
from tests.compile.formats.builder_programs import LATER, SIMPLE, judged

if TYPE_CHECKING:
    from collections.abc import Iterator
    from random import Random

_HARMLESS = [
    "x = 1",
    "print('a')",
    "'a text'",
    "...",
    "x = y = []",
    "x: int = 1",
    "x = k",
    "x: int",
]
_NAMES = [
    *("way, w2 = w2, way", "t, t2 = t2, t", "t2 = t\nt2['failed'] = 'A'", "k = k + ''", "n -= 1"),
    *(
        "a = [way]\na[0].reverse()",
        "a = {'x': t}\na['x'].clear()",
        "a = (t,)\na[0]['failed'] = 'A'",
    ),
    *("b = box\nb.k = 'B'", "way[:] = ['A']", "way *= 2", "way = way * 2", "t = {**t2}", "n = ~n"),
    *(
        "k = k[:1]",
        "k = way[-1]",
        "k = [*way][0]",
        "k = {*way}.pop()",
        "k = min(t)",
        "k = 1",
        "n = 2",
    ),
    *("k = t['succeeded'] or 'A'", "k = n and 'A'", "k = not n", "k = None", "k = b'A'", "n = -n"),
    *("del sm", "del t, k", "del way[:1]", "del box.k", "n = len(way)", "global m\nm = 'B'"),
    *("import smach as k", "import sys as sm", "smach = foo", "X = W", "W = X", "class X: pass"),
    *("from my_pkg import common as W", "def X(*a): return W()", "class StateMachine: pass"),
    *("import my_pkg.common as StateMachine", "k: str = 'B'", "k = (m := 'B')", "w2 = way = w2"),
    *("if 0:\n    global k\nk = 'B'", "if 0: k = 'B'", "k, (m, n) = 'B', ('A', 2)", "*way, k = w2"),
    *(
        "x = way[0] = 'A'",
        "t[way.pop()] = 'A'",
        "t[way.pop()] += 'A'",
        "way[way.pop() == 'A'] += 'B'",
    ),
    *("t['failed'] += ''", "box.k += 'A'", "k += 'A'", "way += 'A'", "t |= t2", "pick = turn"),
]
_CONTROL = [
    *(
        "return",
        "return sm",
        "return None",
        "yield",
        "break",
        "continue",
        "quit()",
        "raise KeyError",
    ),
    *("raise SystemExit", "assert n > 5", "assert turn(t) is None", "assert 0, turn(t)"),
    *("for k in way: pass", "for t['failed'] in way: pass", "for way[0], k in [('A', 'B')]: pass"),
    *("for sm in [sm]: pass", "while way: way.pop()", "while 1:\n    k = 'B'\n    break"),
    *(
        "for e in way: break\nelse: k = 'B'",
        "for e in (): pass\nelse: k = 'B'",
        "while 0: global k",
    ),
    *("if foo(): raise ValueError", "if n: raise ValueError(turn(t))", "with box: pass"),
    "try:\n    raise ValueError(turn(t))\nexcept ValueError: pass",
    "try:\n    k = 'B'\n    raise KeyError\nexcept KeyError: pass",
    "try:\n    if rospy.get_param('x'):\n        k = 'B'\n        raise KeyError\n"
    "except KeyError: pass",
    "try:\n    try: foo()\n    except ValueError:\n        k = 'B'\n        raise\n"
    "except ValueError: pass",
    "try:\n    try: foo()\n    finally: k = 'B'\nexcept ValueError: pass",
    "try:\n    if foo(): way.reverse()\n    raise KeyError\nexcept (turn(t), KeyError)[1]: pass",
    "try: del nothing\nexcept NameError: k = 'B'",
    "try: t['nothing']\nexcept KeyError: k = 'B'",
    "try: k = way[9]\nexcept IndexError: k = 'B'\nelse: k = 'A'",
    "try: import nothing\nexcept ImportError: k = 'B'",
    "with suppress(KeyError):\n    k = 'B'\n    raise KeyError",
    "with suppress(KeyError):\n    if foo():\n        k = 'B'\n        raise KeyError",
    "with suppress(turn(t)) as k: pass",
    "with suppress(KeyError) as k, suppress(KeyError) as way[0]: pass",
    "def late():\n    try: return 'A'\n    finally: way.reverse()\nk = late()",
    "def late():\n    for e in way:\n        if foo(): return e\n    return 'B'\nk = late()",
    "def late():\n    while n: return 'A'\n    return 'B'\nk = late()",
    "match k:\n    case x if turn(t): pass",
    "match n:\n    case 1 if (k := 'B'): pass",
    "match way:\n    case [k, *_]: pass",
    "match t:\n    case {'succeeded': k}: pass",
    "match way:\n    case [first, *way]: way.reverse()",
]
_HIDDEN = [
    *("[k := e for e in way]", "[0 for e in way if turn(t)]", "[e for e in way if (k := e)]"),
    *("{e: turn(t) for e in way}", "{turn(t) for e in way}", "any(turn(e) for e in [t])"),
    *("[turn(e) for e in [t] for _ in w2]", "[0 for e in w2 for _ in w2 if way.reverse()]"),
    *("def late(*, x=turn(t)): pass", "lambda x=turn(t): 0", "lambda *, x=turn(t): 0"),
    *("def late(x: turn(t)): pass", "def late() -> turn(t): pass", "x: turn(t) = 1", "x: turn(t)"),
    *("async def late(x=turn(t)): pass", "@foo\nasync def late(): pass", "f'{n:{turn(t)}}'"),
    *("f'{turn(t)!r}'", "x = f'{way.reverse()}'", "way[turn(t):]", "x = -turn(t)", "not turn(t)"),
    *("x = n < 2 < len(way.pop())", "x = 0 and turn(t)", "x = 1 or turn(t)", "x = n or turn(t)"),
    *("x = turn(t) if n else turn(way)", "x = [*(turn(t),)]", "x = {**(turn(t) or {})}"),
    *("print(*[turn(t)], sep='')", "print(end=turn(t))", "x = (yield turn(t))", "turn(x := t)"),
    *("@foo\n@print\ndef late(): pass", "@print\n@foo\ndef late(): pass", "@foo\nclass Late: pass"),
    *("@(lambda f: turn(t) or f)\ndef late(): pass", "@(lambda f: turn(t) or f)\nclass Late: pass"),
    "def mark(f):\n    way.reverse()\n    return f\n@mark\ndef late(): pass",
    "def mark(f):\n    global k\n    k = 'B'\n    return f\n@mark\ndef late(): pass",
    "def mark(f):\n    nonlocal k\n    k = 'B'\n    return f\n@mark\nclass Late: pass",
    "def mark(n):\n    turn(t)\n    return lambda f: f\n@mark(1)\ndef late(): pass",
    "def mark(f): return lambda *a: 'B'\n@mark\ndef pick(row): return 'A'",
    *("(lambda z: z.reverse())(way)", "[*map(turn, [t])]", "list(map(turn, [t, way]))"),
    *("sorted(way, key=lambda e: turn(t) or 0)", "max(way, key=lambda e: way.reverse() or 0)"),
    *("way.sort(key=lambda e: turn(t) or 0)", "dict.update(t, failed='A')", "list.reverse(way)"),
    *("from functools import partial\npartial(turn, t)()", "import copy\nt = copy.copy(t)"),
    *("import itertools\nfor k in itertools.chain(way): pass", "from operator import setitem"),
    *("import operator\noperator.setitem(t, 'failed', 'A')", "import random\nrandom.shuffle(way)"),
    *("import random\nk = random.choice(['A'])", "import collections\nt = collections.Counter(t)"),
    *(
        "iter(way).__next__()",
        "way.__setitem__(0, 'A')",
        "t.__delitem__('failed')",
        "way.__init__()",
    ),
    *("x = turn\nx(t)", "x = {'f': turn}\nx['f'](t)", "x = [turn]\nx[0](way)", "box.turn(t)"),
    *("box.f = turn\nbox.f(t)", "Box.k = 'B'\nk = Box.k", "Box.f = turn\nBox.f(t)", "k = Box().k"),
]
_ALIASES = [
    *(
        "x = way if foo() else w2\nx.reverse()",
        "(box and t)['failed'] = 'A'",
        "(n or t)['failed'] = 'A'",
    ),
    *("(foo() or way).reverse()", "[way, w2][foo() == 'A'].reverse()", "{'A': t}[foo()].clear()"),
    *("[way, w2][:1][0].reverse()", "[e for e in [t]][0].clear()", "[e.clear() for e in [t] if n]"),
    *("[[e for e in [t]] for _ in w2][0][0].clear()", "{0: e for e in [t]}[0].clear()"),
    *(
        "[e for e in [way] if foo()][0].reverse()",
        "next(e for e in [t]).clear()",
        "{foo(): t}.popitem()",
    ),
    *(
        "x = {foo(): t}\nx['A'].clear()",
        "[*foo(), t][-1].clear()",
        "turn(*[t], **{})",
        "turn(*(t,))",
    ),
    *("turn(*foo(), t)", "turn(**{'x': t})", "turn(**dict(x=t))", "max([way, w2]).reverse()"),
    *("iter([t]).__next__().clear()", "sorted([way])[0].reverse()", "list(iter([t]))[0].clear()"),
    *("import copy\ncopy.copy([t])[0].clear()", "import copy\ncopy.deepcopy([t])[0].clear()"),
    *("x, *y = [t, way]\nx.clear()", "x, y = foo(), t\ny.clear()", "*x, = [t]\nx[0].clear()"),
    *("way.reverse.__self__.pop()", "way.reverse.__call__()", "way.__class__.reverse(way)"),
    *("names.insert(foo(), t)\nnames[0].clear()", "names.extend([t])\nnames[-1].clear()"),
    *("([t] + [way])[0].clear()", "([t] * 2)[0].clear()", "x = [t]\nx *= 2\nx[1].clear()"),
    *(
        "x = [t, *foo()]\nx[0].clear()",
        "for e in t.items(): foo(e)",
        "for e in [t] if foo() else []: e.clear()",
    ),
    *(
        "for e in reversed([t]): e.clear()",
        "for _, e in enumerate([t]): e.clear()",
        "foo(zip([t]))",
    ),
    *("foo(iter([t]))", "foo({'x': [t]}.values())", "foo(t.items())", "foo((t,))", "foo([way])"),
    *("x = lambda: t\nx().clear()", "x = lambda e=t: e\nx().clear()", "foo(lambda: way.reverse())"),
    "if foo():\n    for e in reversed([t]): e.clear()",
    "if foo(): x = t\nelse: x = t2\nx.clear()",
    "def late():\n    if foo(): return way\n    return w2\nlate().reverse()",
    "def late():\n    if foo(): return sm\n    return sm\nlate().set_initial_state(['B'])",
    "def late(x):\n    yield x.reverse()\nlist(late(way))",
    "def late(*x): x[0].clear()\nlate(t)",
    "def late(**x): x['t'].clear()\nlate(t=t)",
    "def late(x, *, y=None): y.clear()\nlate(1, y=t)",
    "def late(x=[]):\n    x.append(t)\n    return x\nlate()\nlate()[0].clear()",
    "match [t]:\n    case [x]: x.clear()",
    "match n, t:\n    case 1, x: x.clear()",
    "try: raise ValueError(t)\nexcept ValueError as e: e.args[0].clear()",
    "class Late:\n    def __add__(self, other): return way\n(Late() + 1).reverse()",
    "class Late:\n    @property\n    def x(self): return way\nLate().x.reverse()",
    "class Late:\n    x = t\nLate.x.clear()",
    "class Late:\n    def __init__(self, x): self.x = x\nx = Late(t)\nfoo(x)",
    "from types import SimpleNamespace\nSimpleNamespace(x=t).x.clear()",
    "from collections import deque, ChainMap\nChainMap(t)['failed'] = 'A'",
    "from functools import reduce\nreduce(lambda a, b: a.clear(), [t, t])",
    "from operator import itemgetter\nitemgetter(0)([t]).clear()",
    "x = StateMachine if foo() else foo\nx(['succeeded'])",
    "x = StateMachine.add if foo() else foo\nwith sm: x('Q', X())",
    "x = [sm for _ in w2]\nx[0].set_initial_state(['B'])",
    "x = {0: sm}.get(foo(), sm)\nx.set_initial_state(['B'])",
    "x, *y = [sm]\nx.set_initial_state(['B'])",
]
_DUNDER = [
    ("__bool__(self)", "True", "if Late(): pass"),
    ("__bool__(self)", "True", "Late() and 1"),
    ("__len__(self)", "1", "len(Late())"),
    ("__eq__(self, other)", "True", "Late() == 1"),
    ("__lt__(self, other)", "True", "sorted([Late(), Late()])"),
    ("__add__(self, other)", "1", "Late() + 1"),
    ("__iadd__(self, other)", "self", "late = Late()\nlate += 1"),
    ("__iter__(self)", "iter(())", "for e in Late(): pass"),
    ("__iter__(self)", "iter(())", "[*Late()]"),
    ("__contains__(self, key)", "True", "1 in Late()"),
    ("__getitem__(self, key)", "1", "Late()[0]"),
    ("__setitem__(self, key, value)", "1", "Late()[0] = 1"),
    ("__getattr__(self, key)", "1", "Late().late"),
    ("__setattr__(self, key, value)", "1", "Late().late = 1"),
    ("__call__(self)", "1", "Late()()"),
    ("__str__(self)", "''", "print(Late())"),
    ("__format__(self, how)", "''", "f'{Late()}'"),
    ("__hash__(self)", "1", "{Late(): 1}"),
    ("__neg__(self)", "1", "-Late()"),
    ("__enter__(self)", "self", "with Late(): pass"),
    ("__del__(self)", "1", "Late()"),
    ("__new__(cls)", "1", "Late()"),
    ("__init__(self)", "None", "Late()"),
    ("__init_subclass__(cls)", "1", "class Later(Late): pass"),
    ("__class_getitem__(cls, key)", "1", "Late[1]"),
]
"""Methods that Python calls by itself, what they return, and a statement that calls them."""
_CLASSES = [
    *("class Late(foo(t)): pass", "class Late(foo=turn(t)): pass", "class Late:\n    turn(t)"),
    *("class Late:\n    k = 'B'\n    way.reverse()", "class Late:\n    global k\n    k = 'B'"),
    "class Late:\n    @property\n    def x(self): turn(t)\nLate().x",
    "class Late:\n    @classmethod\n    def x(cls): turn(t)\nLate.x()",
    "class Late:\n    @staticmethod\n    def x(): turn(t)\nLate.x()",
    "class Late:\n    def x(self, e=turn(t)): pass",
    "class Late:\n    k = [way.reverse() for _ in w2]",
    "class Late:\n    way = way\nLate.way.reverse()",
    "class Late:\n    def __init__(self): self.way = way\nLate().way.reverse()",
    "class Late(Box):\n    def __init__(self):\n        super().__init__()\n        self.k = 'B'\n"
    "k = Late().k",
]
_MACHINES = [
    *("sm.execute", "sm.__init__(['A'])", "sm.__dict__.update(_initial='B')", "vars(sm)"),
    *("sm.add('Q', X())", "type(sm).add('Q', X())", "sm.__class__.add('Q', X())", "sm.foo = t"),
    *("smach.__dict__['StateMachine'].add('Q', X())", "StateMachine.__init__(sm, ['A'])"),
    *("with StateMachine(['succeeded']): StateMachine.add('Q', X())", "sm.userdata = t"),
    *(
        "StateMachine.add('Q', X())",
        "StateMachine.add(*['Q', X()])",
        "StateMachine.add('Q', X(), t)",
    ),
    *(
        "OperatableStateMachine.add('Q', X(), t)",
        "with sm: pass",
        "with sm: foo()",
        "with sm: turn(t)",
    ),
    *("sm2 = StateMachine(['succeeded'])\nsm2.execute()", "sm.execute", "x = [sm]\nx[0].execute()"),
    *("sm.set_initial_state(['B'])", "x = sm.set_initial_state\nx(['B'])", "sm.name = 'x'"),
    *("[sm.set_initial_state([e]) for e in w2]", "n and sm.set_initial_state(['B'])"),
    *(
        "x = sm\nx._states.clear()",
        "x = {'sm': sm}\nx['sm']._initial = 'B'",
        "foo([sm])",
        "foo(s=sm)",
    ),
    *("made.register_outcomes(['Q'])", "made._outcomes = ['Q']", "W.__init__ = Box.__init__"),
    *("W.get_registered_outcomes = turn", "made.__init__()", "made = X()", "class W(X): pass"),
    "def W(*a): return X()",
    "def late():\n    with sm: StateMachine.add('Q', X())\nlate()",
    "def late(f): f('Q', X())\nlate(StateMachine.add)",
    "for e in [sm]:\n    with e: StateMachine.add('Q', X())",
    "from contextlib import contextmanager\n@contextmanager\ndef late():\n    turn(t)\n    yield\n"
    "with late(): pass",
]
_MORE = [*_HARMLESS, *_NAMES, *_ALIASES, *_ALIASES, *_CONTROL, *_HIDDEN, *_CLASSES, *_MACHINES]
_SMACH = """\
import smach
from smach import StateMachine, Concurrence, Sequence, State
{prologue}
class W(State):
    def __init__(self, *args):
        State.__init__(self, outcomes=['succeeded', 'failed'])
made = W()
def build(label, then):
    inner = StateMachine(outcomes=['succeeded', 'failed'])
    with inner:
        for e in way:
            StateMachine.add(label + e, W(), {{'succeeded': then, 'failed': 'failed'}})
    return inner
c = Concurrence(outcomes=['succeeded', 'failed'], default_outcome='failed',
    outcome_map={{'succeeded': {{'L': 'succeeded', 'R': k}}}})
with c:
    Concurrence.add('L', W())
    Concurrence.add('R', W())
s = Sequence(outcomes=['succeeded', 'failed'], connector_outcome=k)
with s:
    Sequence.add('S1', made, {{'failed': 'failed'}})
    Sequence.add('S2', W(), {{'failed': 'failed'}})
sm = StateMachine(outcomes=['succeeded', 'aborted'])
with sm:
    StateMachine.add('A', build('I', k), {{'succeeded': 'C', 'failed': m}})
    StateMachine.add('C', c, {{'succeeded': 'B', 'failed': 'S'}})
    if n:
        StateMachine.add('S', s, {{'succeeded': 'B', 'failed': 'aborted'}})
    StateMachine.add_auto('B', W(), ['succeeded'], {{'failed': 'A'}})
    StateMachine.add('D', W(), {{'succeeded': k, 'failed': t['failed']}})
sm.execute()
"""
_FLEXBE = """\
from flexbe_core import *
from my_states.drive_state import DriveState
import sys
import rospy
from contextlib import suppress
from my_pkg import common
class W(EventState):
    def __init__(self, *args):
        EventState.__init__(self, outcomes=['succeeded', 'failed'])
class T(Behavior):
    def __init__(self):
        super(T, self).__init__()
        self.add_parameter('speed', 1)
    def create(self):
{prologue}        c = ConcurrencyContainer(outcomes=['done', 'bad'], conditions=[
            ('done', [('L', k), ('R', 'succeeded')]), ('bad', [('L', 'failed')])])
        with c:
            OperatableStateMachine.add('L', W(), {{'succeeded': 'done', 'failed': 'bad'}})
            OperatableStateMachine.add('R', W(), {{'succeeded': 'done', 'failed': 'bad'}})
        sm = OperatableStateMachine(outcomes=['succeeded', 'aborted'])
        with sm:
            OperatableStateMachine.add('A', DriveState(), transitions=dict(t), autonomy={{}})
            OperatableStateMachine.add('B', c, transitions={{'done': k, 'bad': m}})
            for e in w2:
                OperatableStateMachine.add('E' + e, W(), {{'succeeded': e, 'failed': 'A'}})
        return sm
"""


@cache
def _program(number: int, *, flexbe: bool) -> str:
    """A program with the names that the statements speak of; "" for one that is not read."""
    head = builder_programs.PROLOGUE
    if number < 0:
        inner = "".join(f"        {line}\n" for line in head.splitlines()[4:])
        text = _FLEXBE.format(prologue=inner) if flexbe else _SMACH.format(prologue=head)
        assert list(judged(text)) == ["read"]
        return text
    text = builder_programs.program(number)
    fits = ("flexbe_core" in text) == flexbe
    return text if fits and list(judged(text)) == ["read"] else ""


def statement(chance: Random) -> str:
    """A statement, perhaps of several lines."""
    if chance.random() < 0.15:
        head, result, use = chance.choice(_DUNDER)
        does = chance.choice(
            ("turn(t)", "way.reverse()", "global k\nk = 'B'", "nonlocal k\nk = 'B'")
        )
        lines = "".join(f"        {each}\n" for each in does.split("\n"))
        more = "    def __exit__(self, *a): pass\n" if "enter" in head else ""
        return f"class Late:\n    def {head}:\n{lines}        return {result}\n{more}{use}"
    return chance.choice(chance.choice((SIMPLE, LATER, _MORE, _MORE, _MORE)))


def inserted(chance: Random, *, flexbe: bool) -> str:
    """A program with something in it that it was not written with."""
    while True:
        text = _program(-1 if chance.random() < 0.25 else chance.randrange(300), flexbe=flexbe)
        if not text:
            continue
        way = chance.random()
        if way < 0.06:
            changed = _with_argument(text, chance)
        elif way < 0.1:
            changed = text.replace("{'", "{'foo': 'A', '", 1 + chance.randrange(3))
        else:
            changed = _with_statement(text, chance)
        with suppress(SyntaxError):  # a return outside of a function
            compile(changed, "program", "exec")
            return changed


def _with_argument(text: str, chance: Random) -> str:
    calls = [each for each in ast.walk(ast.parse(text)) if isinstance(each, ast.Call)]
    call = chance.choice(calls)
    assert call.end_lineno is not None
    assert call.end_col_offset is not None
    lines = text.split("\n")
    line, at = lines[call.end_lineno - 1], call.end_col_offset - 1
    value = chance.choice(("foo=1", "transitions=t", "*way", "**t", "outcomes=way", "state=W()"))
    lines[call.end_lineno - 1] = f"{line[:at]}{', ' if call.args else ''}{value}{line[at:]}"
    return "\n".join(lines)


def _with_statement(text: str, chance: Random) -> str:
    lines = text.split("\n")
    places = [*_places(ast.parse(text), lines)]
    named = next(number for number, line in enumerate(lines) if "box = Box()" in line)
    if chance.random() < 0.7:  # all names have their first values there
        places = [each for each in places if each[0] > named]
    line, column = chance.choice(places)
    written = statement(chance)
    if chance.random() < 0.15:
        inner = "".join(f"\n    {each}" for each in written.split("\n"))
        around = ("if n:", "if foo():", "for e in range(2):", "while n < 2:\n    n += 1", "if 0:")
        written = (
            chance.choice((*around, "try:", "def late():", "with suppress(Exception):")) + inner
        )
        written += "\nexcept Exception: pass" if written.startswith("try") else ""
        written += "\nlate()" if written.startswith("def") else ""
    lines[line:line] = [" " * column + each for each in written.split("\n")]
    return "\n".join(lines)


def _places(tree: ast.AST, lines: list[str]) -> Iterator[tuple[int, int]]:
    """Before each statement that begins a line, and behind the last one of a block."""
    for node in ast.walk(tree):
        for name in ("body", "orelse", "finalbody"):
            body = getattr(node, name, None)
            for each in body if isinstance(body, list) else ():
                start = min([each.lineno, *(d.lineno for d in getattr(each, "decorator_list", ()))])
                if not lines[each.lineno - 1][: each.col_offset].strip():
                    yield start - 1, each.col_offset
                    if each is body[-1]:
                        yield each.end_lineno, each.col_offset
