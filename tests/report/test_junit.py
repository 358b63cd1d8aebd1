from __future__ import annotations

from dataclasses import replace

from lxml import etree

from gpsfsm.model.report import Report, Verdict
from gpsfsm.report import render
from tests.report.samples import BROKEN, DANGLING, GIVES_UP, MALFORMED, SAMPLES


def parse(report: Report) -> etree._Element:
    return etree.fromstring(render(report, "junit").encode())


def test_one_case_per_plan() -> None:
    root = parse(SAMPLES["mixed"])
    cases = root.findall("testsuite/testcase")
    assert [case.get("name") for case in cases] == [p.path for p in SAMPLES["mixed"].plans]
    assert [[child.tag for child in case] for case in cases] == [
        ["system-out"],
        ["failure", "system-out"],
        ["error", "system-out"],
        ["system-out"],
    ]


def test_the_counts_are_those_of_the_elements() -> None:
    root = parse(SAMPLES["mixed"])
    for element in (root, root[0]):
        assert element.get("tests") == str(len(root.findall(".//testcase")))
        assert element.get("failures") == str(len(root.findall(".//failure")))
        assert element.get("errors") == str(len(root.findall(".//error")))


def test_a_failure_holds_all_errors_and_nothing_else() -> None:
    second = replace(MALFORMED, message="another one")
    failure = parse(Report((replace(BROKEN, findings=(MALFORMED, DANGLING, second)),)))[0][0][0]
    assert failure.get("type") == "GP101"
    message = "GP101 malformed-xml: a stray '&' in an attribute value (and 1 further error)"
    assert failure.get("message") == message
    assert failure.text is not None
    assert "another one" in failure.text
    assert "GP302" not in failure.text


def test_other_findings_are_output() -> None:
    (output,) = parse(Report((GIVES_UP,))).iter("system-out")
    assert output.text is not None
    assert [line.split(": ")[1] for line in output.text.splitlines()[:3]] == [
        "warning GP302 dangling-failure",
        "warning GP303 join-deadlock",
        "warning GP310 recovery-holds-goal",
    ]


def test_a_rejection_for_suppressed_findings_fails_too() -> None:
    plan = replace(GIVES_UP, verdict=Verdict.REJECTED)
    (failure,) = parse(Report((plan,))).iter("failure")
    assert failure.get("message") == "rejected for findings that are not shown"


def test_characters_that_xml_forbids() -> None:
    text = "]]> <&'\" \x00 \x1b \ufffe \uffff \ud800 é"
    finding = replace(MALFORMED, message=text, hint=text)
    (failure,) = parse(Report((replace(BROKEN, path=text, findings=(finding,)),))).iter("failure")
    shown = r"]]> <&'" + r'" \x00 \x1b \ufffe \uffff \ud800 é'
    assert failure.get("message") == f"GP101 malformed-xml: {shown}"
    assert failure.text is not None
    assert failure.text.endswith(f"hint: {shown}")
