"""The gate of fixes: what is kept, what is refused, and that it ends."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.fixing import Edit, Fix, Safety, engine, fix_text
from gpsfsm.fixing.compare import better
from gpsfsm.fixing.fixer import Fixer
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Verdict
from tests.fixing.support import fixed, go, say

if TYPE_CHECKING:
    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.report import PlanReport

_PROVIDER = ' provider="nav2_capabilities/WaypointRunner"'
_RUNNER = '<Runner interface="{name}" provider="{name}" {words}/>'
_DEAD = f'<Plan>\n  <Control type="recovery">\n    {go(1, 3)}\n  </Control>\n</Plan>\n'


def _better(before: str, *edits: Edit, rule: str, at: int) -> bool:
    fix = Fix(rule, "", at, edits)
    after = engine.apply_edits(before, edits)
    options = CheckOptions()
    return better(check_text(before, "a", options), check_text(after, "a", options), [fix])


def test_a_fix_must_remove_its_finding() -> None:
    text = f"<Plan speed='1'>{go(1, 2)}</Plan>"
    assert _better(text, Edit(5, 15), rule="GP112", at=6)
    assert not _better(text, Edit(6, 11, "tempo"), rule="GP112", at=6)


def test_a_fix_must_bring_no_other_finding() -> None:
    text = f"<Plan speed='1'>{go(1, 2)}</Plan>"
    step = text.index('x="1"')
    assert not _better(text, Edit(5, 15), Edit(step, step + 5, 'w="1"'), rule="GP112", at=6)


def test_a_finding_must_not_move_to_another_element() -> None:
    text = f"<Plan>{go(1, 2)}{go(3, 4).replace('x=', 'q=')}</Plan>"
    first, second = text.index('x="1"'), text.index('q="3"')
    there = Edit(first, first + 1, "q")
    assert _better(text, Edit(second, second + 1, "x"), rule="GP203", at=second)
    assert not _better(text, there, Edit(second, second + 1, "x"), rule="GP203", at=second)


def test_what_is_as_easy_to_see_was_not_hidden() -> None:
    wait = _RUNNER.format(name="generic_capabilities/WaitRunner", words='seconds="1"')
    text = f"<Plan>{wait}{go(3, 4).replace('x=', 'q=')}</Plan>"
    seconds, wrong = text.index(' seconds="1"'), text.index('q="3"')
    gone = Edit(seconds, seconds + 12)  # GP204, which is found when GP203 is
    assert not _better(text, gone, Edit(wrong, wrong + 1, "x"), rule="GP203", at=wrong)


def test_neither_verdict_nor_findings_get_worse() -> None:
    text = f"<Plan speed='1'>{go(1, 2)}</Plan>"
    before = check_text(text, "a", CheckOptions())
    after = check_text(text.replace(" speed='1'", ""), "a", CheckOptions())
    fix = Fix("GP112", "", 6, (Edit(5, 15),))
    assert better(before, after, [fix])
    assert not better(before, replace(after, verdict=Verdict.UNDECIDED), [fix])
    worse = [replace(each, severity=Severity.ERROR) for each in after.findings]
    assert worse
    assert not better(before, replace(after, findings=tuple(worse)), [fix])


def test_lines_may_move() -> None:
    text = f"<Plan speed='1'>{go(1, 2)}</Plan>"
    assert _better(text, Edit(5, 15), Edit(16, 16, "\n\n\n"), rule="GP112", at=6)


def test_what_an_error_hides_may_come_to_light() -> None:
    text = f"<Plan>{go(1, 2)}<Runner interface=nav2_capabilities/RobotPose/></Plan>"
    start = text.index("nav2_capabilities/RobotPose/>")
    good = Edit(start, start + 27, '"nav2_capabilities/RobotPose"')
    assert _better(text, good, rule="GP101", at=start)  # GP107 was there, GP201 may come


@pytest.mark.parametrize("text", ["", "   ", "no plan at all", "<", "&", "<Plan", "</Plan>", "\0"])
def test_texts_without_a_plan(text: str) -> None:
    result = fixed(text, unsafe=True)
    assert result.report.verdict is not Verdict.ACCEPTED


def test_no_empty_plan_is_made_of_what_says_something_else() -> None:
    for text in ("<Plan>go to the door</Plan>", "<Plan><!-- ", "<Plan", "<plan/>"):
        assert fixed(text, unsafe=True).report.verdict is not Verdict.ACCEPTED


def test_rules_that_are_not_selected_are_not_fixed() -> None:
    text = f"<Plan speed='1'>{go(1, 2).replace('x=', 'X=')}</Plan>"
    result = fixed(text, selection=Selection.of(["GP112"]))
    assert result.text == f"<Plan>{go(1, 2).replace('x=', 'X=')}</Plan>"
    result = fixed(text, selection=Selection.of(ignore=["GP112"]))
    assert result.text == f"<Plan speed='1'>{go(1, 2)}</Plan>"


def test_values_without_quotes_are_left_as_they_are_if_nobody_asks() -> None:
    text = f"<Plan speed=3 pitch=4 name=a>{go(1, 2).replace('x=', 'position=(3;4) X=')}</Plan>"
    result = fixed(text, unsafe=True, selection=Selection.of(["GP112"]))
    assert result.text == text.replace(" speed=3 pitch=4", "")
    text = f"<Plan>{go(1, 2)}</Plan>".replace('x="1" y="2"', "position=(3;4)")
    result = fixed(text, selection=Selection.of(["GP111"]))
    assert result.text == f"<Plan>{go(3, 4)}</Plan>"


def test_what_a_comment_suppresses_is_not_fixed() -> None:
    comment = "<!-- gpsfsm: ignore GP203 because it may fail -->"
    text = f"<Plan>\n{comment}\n{go(1, 2)[:-2]} Z='3'/>\n</Plan>"
    assert fixed(text).text == text


def test_lines_are_those_of_the_text_as_it_was() -> None:
    text = f"Sure:\n\n```xml\n<Plan>\n  hello\n  {go(1, 2).replace('y=', 'Y=')}\n</Plan>\n```\n"
    result = fixed(text)
    assert [(fix.rule, fix.line) for fix in result.applied][1:] == [("GP108", 5), ("GP203", 6)]


def test_unsafe_fixes_are_counted() -> None:
    result = fixed(_DEAD)
    assert (result.applied, result.unsafe_left, result.text) == ((), 1, _DEAD)
    result = fixed(_DEAD, unsafe=True)
    assert ([fix.safety for fix in result.applied], result.unsafe_left) == ([Safety.UNSAFE], 0)


def test_it_ends_where_fixes_go_in_circles(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fixer that is never done is stopped, and what it does to no avail is refused."""

    def circle(draft: object) -> list[Fix]:
        text: str = draft.text  # type: ignore[attr-defined]
        at = text.index("speed") if "speed" in text else text.index("tempo")
        new = "tempo" if "speed" in text else "speed"
        return [Fix("GP112", "round and round", at, (Edit(at, at + 5, new),))]

    def growing(draft: object) -> list[Fix]:
        text: str = draft.text  # type: ignore[attr-defined]
        return [Fix("GP112", "more", 6, (Edit(len(text), len(text), " "),))]

    fixers = (Fixer("circle", ("GP112",), circle), Fixer("growing", ("GP112",), growing))
    monkeypatch.setattr(engine, "all_fixers", lambda: fixers)
    text = f"<Plan speed='1'>{go(1, 2)}</Plan>"
    assert fixed(text).text == text


def test_one_bad_proposal_does_not_spoil_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    text = f"<Plan speed='1'>{go(1, 2)}{say('a')[:-2]} pitch='2'/></Plan>"

    def some(_: object) -> list[Fix]:
        at = text.index(" pitch")
        return [
            Fix("GP112", "good", 6, (Edit(5, 15),)),
            Fix("GP112", "bad", 20, (Edit(at, at + 10, "<"),)),
        ]

    monkeypatch.setattr(engine, "all_fixers", lambda: (Fixer("some", ("GP112",), some),))
    assert [fix.title for fix in fixed(text).applied] == ["good"]


def test_many_fixes_are_made_whatever_a_report_lists() -> None:
    """Of a rule a report lists a hundred findings; here most of those cannot be fixed."""
    unknown = '<Runner interface="a/B"/>' * 150
    goes = "".join(go(1, place).replace(_PROVIDER, "") for place in range(120))
    result = fixed(f"<Plan>{unknown}{goes}</Plan>")
    assert [fix.rule for fix in result.applied] == ["GP107"] * 120
    assert result.before - result.after == 120
    assert sum(finding.rule == "GP107" for finding in result.report.findings) == 100
    assert result.text.count(_PROVIDER) == 120


def test_few_checks_lead_to_the_bad_one_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    said = [say("a").replace("/>", f" pitch='{int(place == 40)}'/>") for place in range(64)]

    def some(draft: Draft) -> list[Fix]:
        places = [match.start() for match in re.finditer(" pitch='[01]'", draft.text)]
        return [
            Fix(
                "GP203", "drop", each + 1, (Edit(each, each + 10, "<" * int(draft.text[each + 8])),)
            )
            for each in places
        ]

    checks: list[str] = []

    def checked(text: str, path: str, options: CheckOptions) -> PlanReport:
        checks.append(text)
        return check_text(text, path, options)

    monkeypatch.setattr(engine, "check_text", checked)
    monkeypatch.setattr(engine, "all_fixers", lambda: (Fixer("some", ("GP203",), some),))
    result = fixed(f"<Plan>{''.join(said)}</Plan>")
    assert len(result.applied) == 63
    assert result.text.count("pitch") == 1
    assert len(checks) < 30


def test_hostile_texts_end() -> None:
    for text in (
        "<Plan><Runner " + 'a="' * 3000,
        "<Plan>" + "< Runner " * 3000,
        '<Plan><Control type="x">' * 190,
        "<Plan>" + "</Control>" * 3000 + "</Plan>",
        "<Plan>\0" * 3000,
        '<Plan><Runner interface="a/b" provider="a/b" x="' + "&" * 20_000 + '"/></Plan>',
        "<Plan>" + "<!--" * 3000,
        "```\n" * 5000,
    ):
        result = fixed(text, unsafe=True)
        assert len(result.text) <= 2 * len(text)


def test_a_fixer_with_a_defect_is_told_and_the_others_work(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = f"<Plan speed='1'>{go(1, 2)}</Plan>"

    def broken(_: object) -> list[Fix]:
        raise KeyError("no such\x1b element")

    def good(draft: object) -> list[Fix]:
        at = draft.text.find(" speed")  # type: ignore[attr-defined]
        return [Fix("GP112", "good", 6, (Edit(at, at + 10),))] if at > 0 else []

    fixers = (Fixer("broken", ("GP112",), broken), Fixer("good", ("GP112",), good))
    monkeypatch.setattr(engine, "all_fixers", lambda: fixers)
    monkeypatch.delenv("GPSFSM_DEBUG", raising=False)
    result = fixed(text)
    assert result.text == f"<Plan>{go(1, 2)}</Plan>"
    assert dict(result.failed) == {"broken": "KeyError: 'no such\\x1b element'"}
    monkeypatch.setenv("GPSFSM_DEBUG", "1")
    with pytest.raises(KeyError):
        fixed(text)


@pytest.mark.parametrize(
    "text", ["Note: I cannot help with that.", "\ufeffhello", b"hello", "", " "]
)
@pytest.mark.parametrize("unsafe", [False, True])
def test_a_text_without_a_plan_stays_as_it_is(text: str | bytes, unsafe: bool) -> None:
    kept = fix_text(text, unsafe=unsafe)
    whole = text if isinstance(text, str) else text.decode()
    assert (kept.original, kept.applied) == (whole.removeprefix("\ufeff"), ())
    assert kept.text == kept.original


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_a_plan_is_fixed_for_its_engine(engine: str) -> None:
    """What is found on an engine is mended, and the new text is checked on that engine."""
    text = f"<Plan>{go(1, 2)}</Plan>"
    result = fixed(text, engine=engine)
    rules = {finding.rule for finding in check_text(text, "", CheckOptions(engine=engine)).findings}
    assert [fix.rule for fix in result.applied] == ["GP708"] * 2 * ("GP708" in rules)
    assert "GP708" not in {finding.rule for finding in result.report.findings}
    assert result.report.facts is not None
    assert result.report.facts.engine is not None
    assert fixed(text).text == text
