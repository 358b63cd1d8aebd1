"""Baselines: what is known, and how often."""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis.rules import rule
from gpsfsm.checking.selection import Baseline, load_baseline
from gpsfsm.errors import InputError
from gpsfsm.model.plan import Location
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import render

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.model.finding import Finding

_NO_LISTS: tuple[Any, ...] = (None, 5, True, "x", {})
_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda each: (
        st.lists(each, max_size=2) | st.dictionaries(st.text(max_size=3), each, max_size=2)
    ),
    max_leaves=4,
)
FIRST, SECOND = "/Plan/Runner[1]", "/Plan/Runner[2]"


def finding(code: str, element: str, line: int = 1) -> Finding:
    return rule(code).finding("", Location(line, 1, element))


def baselined(finding: Finding) -> Finding:
    return replace(finding, suppressed_by="baseline")


def report(*findings: Finding, path: str = "a.xml", verdict: Verdict = Verdict.REJECTED) -> Report:
    return Report((PlanReport(path, verdict, None, findings),))


def loaded(library: Report, folder: Path) -> Baseline:
    file = folder / "known.json"
    file.write_text(render(library, "json"), encoding="utf-8")
    return load_baseline(file)


def test_lines_do_not_matter(tmp_path: Path) -> None:
    baseline = loaded(report(finding("GP302", FIRST, line=3)), tmp_path)
    (plan,) = baseline.apply(report(finding("GP302", FIRST, line=30))).plans
    assert plan.findings == ()
    assert plan.suppressed == (baselined(finding("GP302", FIRST, line=30)),)
    assert plan.verdict is Verdict.REJECTED


@pytest.mark.parametrize(
    "new",
    [
        report(finding("GP301", FIRST)),
        report(finding("GP302", SECOND)),
        report(finding("GP302", FIRST), path="b.xml"),
    ],
)
def test_rule_element_and_path_do(new: Report, tmp_path: Path) -> None:
    baseline = loaded(report(finding("GP302", FIRST)), tmp_path)
    assert baseline.apply(new) == new


def test_paths_are_compared_as_paths(tmp_path: Path) -> None:
    baseline = loaded(report(finding("GP302", FIRST), path="./plans//a.xml"), tmp_path)
    (plan,) = baseline.apply(report(finding("GP302", FIRST), path="plans/a.xml")).plans
    assert plan.findings == ()


def test_each_known_finding_counts_once(tmp_path: Path) -> None:
    baseline = loaded(report(finding("GP302", FIRST), finding("GP302", FIRST)), tmp_path)
    assert baseline.counts == Counter({("a.xml", "GP302", FIRST): 2})
    three = tuple(finding("GP302", FIRST, line=line) for line in (1, 2, 3))
    (plan,) = baseline.apply(report(*three)).plans
    assert plan.suppressed == tuple(map(baselined, three[:2]))
    assert plan.findings == three[2:]
    assert baseline.apply(report(*three)) == baseline.apply(report(*three))


def test_what_explains_the_exit_code_stays(tmp_path: Path) -> None:
    old = report(finding("GP302", FIRST), finding("GP904", "/Plan"), verdict=Verdict.UNDECIDED)
    new = loaded(old, tmp_path).apply(old)
    assert [finding.rule for finding in new.plans[0].findings] == ["GP904"]
    assert new.exit_code() == 2


def test_a_real_report_knows_all_of_itself(tmp_path: Path) -> None:
    text = '<Plan><Runner interface="a/B" provider="a/B"><Runner/></Runner><Go/></Plan>'
    checked = gpsfsm.check(text)
    assert checked.exit_code() == 1
    again = loaded(checked, tmp_path).apply(checked)
    assert again.exit_code() == 0
    assert again.plans[0].findings == ()
    assert again.plans[0].suppressed == tuple(map(baselined, checked.plans[0].findings))


def plan(**changes: Any) -> dict[str, Any]:
    finding = {"rule": "GP302", "location": {"element": FIRST}}
    return {"path": "a.xml", "findings": [finding], **changes}


def content(**changes: Any) -> dict[str, Any]:
    return {"version": 1, "plans": [plan()], **changes}


class TestUnfitFiles:
    def test_the_smallest_fit_one(self, tmp_path: Path) -> None:
        file = tmp_path / "known.json"
        file.write_text(json.dumps(content(future="ignored")), encoding="utf-8")
        assert load_baseline(file).counts == Counter({("a.xml", "GP302", FIRST): 1})

    @pytest.mark.parametrize(
        "unfit",
        [
            [],
            None,
            3,
            {},
            content(version=4),
            content(version="1"),
            content(version=True),
            content(plans={}),
            content(plans=[3]),
            content(plans=[plan(path=None)]),
            content(plans=[plan(findings=None)]),
            content(plans=[plan(findings=["GP302"])]),
            content(plans=[plan(findings=[{"rule": "GP302"}])]),
            content(plans=[plan(findings=[{"rule": "GP302", "location": {}}])]),
            content(plans=[plan(findings=[{"rule": 302, "location": {"element": ""}}])]),
            *(content(plans=[plan(suppressed_findings=odd)]) for odd in _NO_LISTS),
            content(plans=[plan(suppressed_findings=[None])]),
            content(plans=[plan(suppressed_findings=[{"suppressed_by": 1}])]),
            content(plans=[plan(suppressed_findings=[{"suppressed_by": "comment"}])]),
        ],
    )
    def test_json_of_another_shape(self, unfit: Any, tmp_path: Path) -> None:
        self.refused(json.dumps(unfit).encode(), tmp_path)

    @given(
        name=st.sampled_from(["version", "plans", "path", "findings", "suppressed_findings"])
        | st.sampled_from(["rule", "location", "element", "suppressed_by"]),
        value=_JSON,
        again=st.booleans(),
    )
    def test_any_value_anywhere(
        self, name: str, value: Any, again: bool, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        """It is read, or it is said to be unfit; nothing else."""
        finding: dict[str, Any] = {"rule": "GP302", "location": {"element": FIRST}}
        hidden = {**finding, "suppressed_by": "comment"}
        report: dict[str, Any] = content(plans=[plan(suppressed_findings=[hidden])])
        one = report["plans"][0]
        for place in (report, one, one["findings"][0], hidden, finding["location"]):
            if name in place:
                place[name] = [value, place[name]] if again else value
        file = tmp_path_factory.mktemp("known") / "known.json"
        file.write_text(json.dumps(report), encoding="utf-8")
        with contextlib.suppress(InputError):
            assert isinstance(load_baseline(file), Baseline)

    @pytest.mark.parametrize(
        "unfit", [b"", b"<Plan/>", b"\xff\xfe\x00", b"[" * 200_000, b"1" * 10_000, b"{" + b'"a":1,']
    )
    def test_no_json(self, unfit: bytes, tmp_path: Path) -> None:
        self.refused(unfit, tmp_path)

    def refused(self, unfit: bytes, folder: Path) -> None:
        file = folder / "known.json"
        file.write_bytes(unfit)
        with pytest.raises(InputError) as caught:
            load_baseline(file)
        assert f"{file} is not a report of 'gpsfsm check --format json'" in str(caught.value)

    def test_unreadable(self, tmp_path: Path) -> None:
        for path in (tmp_path, tmp_path / "missing.json"):
            with pytest.raises(InputError, match="cannot be read"):
                load_baseline(path)
