"""What tells plans apart when something is drawn."""

from __future__ import annotations

import pytest
from hypothesis import given

from gpsfsm.compile import compile_plan
from gpsfsm.model.plan import Kind
from tests import strategies
from tests.oracle import to_xml
from tests.support import plan_of

PLAN = """<Plan>
  <Runner interface="a/B" provider="a/B" x="1" y="ä"/>
  <Control type="recovery"><Runner interface="a/C" provider="a/C"/></Control>
</Plan>"""


def fingerprint(text):
    return compile_plan(plan_of(text)).automaton.fingerprint


def test_it_is_the_same_in_every_process():
    expected = "065a84c5fe90aed73cfd6ebd021ac177d51645dbba50ebfbd6654bf3a5051ea9"
    assert fingerprint(PLAN) == expected


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<Plan>", "<Plan name='p'>"),
        ("\n  <", "<"),
        ("<Control", "<!-- c --><Control id='7'"),
        ('x="1" y="ä"', "y = '&#228;'   x='1' name='n'"),
    ],
)
def test_layout_and_labels_make_no_difference(old, new):
    assert old in PLAN
    assert fingerprint(PLAN.replace(old, new)) == fingerprint(PLAN)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('x="1"', 'x="1.0"'),
        ('x="1"', 'z="1"'),
        ('x="1" y="ä"', 'x="1y=ä"'),
        ('interface="a/B"', 'interface="a/D"'),
        ('provider="a/B"', 'provider="a/D"'),
        ('"recovery"', '"parallel_all"'),
        ("</Control>", "</Control><Control type='recovery'></Control>"),
    ],
)
def test_what_the_plan_asks_for_does(old, new):
    assert old in PLAN
    assert fingerprint(PLAN.replace(old, new)) != fingerprint(PLAN)


def _nested(plan):
    """The same by other means: nested tuples."""

    def element(index):
        result = plan.elements[index]
        attributes = {
            one.name: one.text
            for one in result.attributes
            if result.kind is Kind.RUNNER and one.name not in ("name", "id")
        }
        children = tuple(map(element, result.children))
        return result.kind, result.control_type, tuple(sorted(attributes.items())), children

    return element(0)


@given(strategies.plans(), strategies.plans())
def test_two_plans_have_the_same_exactly_if_they_are(one, two):
    first, second = plan_of(to_xml(one)), plan_of(to_xml(two))
    prints = [compile_plan(each).automaton.fingerprint for each in (first, second)]
    assert (prints[0] == prints[1]) == (_nested(first) == _nested(second))
