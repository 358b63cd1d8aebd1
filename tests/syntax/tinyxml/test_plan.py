"""The plan of an engine's tree: that of the front end where both read the same text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given

from gpsfsm.model.engine import EngineDocument
from gpsfsm.syntax import parse
from gpsfsm.syntax.tinyxml import parse_document, plan_of, position
from tests.oracle import P, to_xml
from tests.strategies import plans

if TYPE_CHECKING:
    from gpsfsm.model.plan import Element, Plan


def engine_plan(text: str) -> tuple[Plan, dict[int, int], EngineDocument]:
    document = parse_document(text)
    assert isinstance(document, EngineDocument)
    root = next(e.index for e in document.elements(document.roots) if e.tag == "Plan")
    return *plan_of(document, root, text, "file"), document


def parts(element: Element) -> tuple[object, ...]:
    """Everything that an element consists of."""
    return tuple(getattr(element, name) for name in element.__slots__)


@given(plans())
def test_the_same_elements_as_the_front_end(whole: P) -> None:
    # With a runner behind it, a completion runner at the end of a plan is one like every other.
    text = to_xml(whole).replace("</Plan>", '<Runner interface="Z" provider="Z" b="é&lt;"/></Plan>')
    expected = parse(text).plan
    assert expected is not None
    plan, places, document = engine_plan(text)
    assert [parts(each) for each in plan.elements] == [parts(each) for each in expected.elements]
    assert [document.element(index).start for index in places] == [
        plan.elements[index].start for index in places.values()
    ]


def test_what_the_engine_passes_over_is_left_out() -> None:
    text = (
        "<Plan><Bogus><Runner/></Bogus><Runner interface='a'><Runner interface='b'/></Runner>"
        "<Control><Runner interface='c'/></Control>"
        "<Control type='recovery'>t<Runner interface='d'/><Plan/></Control></Plan>"
    )
    plan, places, document = engine_plan(text)
    assert [plan.path(element) for element in plan.elements] == [
        "/Plan",
        "/Plan/Runner[1]",
        "/Plan/Control[2]",
        "/Plan/Control[2]/Runner[1]",
    ]
    assert [each.interface for each in plan.runners] == ["a", "d"]
    tags = [document.element(index).tag for index in places]
    assert tags == [plan.elements[index].kind for index in places.values()]


def test_a_byte_order_mark_does_not_count() -> None:
    text = "\ufeff<Plan>\n  <Runner interface='a' provider='b'/></Plan>"
    plan, _, _ = engine_plan(text)
    (runner,) = plan.runners
    assert (runner.line, runner.column, runner.attributes[0].column) == (2, 3, 11)
    assert text[1:][runner.start : runner.end].startswith("<Runner")
    assert position(text, 1) == (1, 1)
    assert position(text, text.index("<Runner")) == (2, 3)
