"""Cases: what is kept can be read, played again, and is refused with words if it makes no sense."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import GpsfsmError, InputError
from gpsfsm.fuzzing import Fate, run_campaign
from gpsfsm.fuzzing.cases import cases_in, keep_case, read_case, scenario_in
from gpsfsm.fuzzing.properties import find_property
from tests.fuzzing.support import acts, control, go, plan, subject

if TYPE_CHECKING:
    from pathlib import Path

CHILDREN = (go("A"), control("recovery", go("B")), go("C"))


def kept(folder: Path) -> Path:
    target = subject(*CHILDREN, faults=("failed", "late"), limit_s=30.0)
    (failure,) = run_campaign(target, [find_property("completes")], runs=30).failures
    return keep_case(failure, plan(*CHILDREN), str(folder), seed=4)


def test_a_case_is_not_written_through_a_link_out_of_its_folder(tmp_path: Path) -> None:
    path = kept(tmp_path / "cases")
    outside = tmp_path / "outside"
    outside.write_text("theirs")
    path.unlink()
    path.symlink_to(outside)
    with pytest.raises(GpsfsmError, match="a link leads out of the folder"):
        kept(tmp_path / "cases")
    assert outside.read_text() == "theirs"


def test_a_case_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    path = kept(tmp_path / "new" / "cases")
    (case,) = cases_in(str(path.parent))
    assert (case.file, case.broken, case.seed) == (str(path), "completes", 4)
    assert (case.faults, case.limit_s) == (("failed", "late"), 30.0)
    assert case.plan == plan(*CHILDREN)
    target = subject(*CHILDREN)
    assert scenario_in(case, target) == acts(target, n2=Fate.FAILED)


def test_the_same_case_has_the_same_name_and_bytes(tmp_path: Path) -> None:
    one, other = kept(tmp_path / "one"), kept(tmp_path / "other")
    assert one.name == other.name
    assert one.read_bytes() == other.read_bytes()


def test_a_case_names_what_it_is_about(tmp_path: Path) -> None:
    data = json.loads(kept(tmp_path).read_text())
    assert data["message"] == "the plan gives up"
    assert [act["element"] for act in data["acts"]] == ["/Plan/Runner[2]"]
    assert data["scenario"]["ends"] == "GAVE_UP"


def test_a_case_of_another_plan_does_not_fit(tmp_path: Path) -> None:
    (case,) = cases_in(str(kept(tmp_path).parent))
    assert scenario_in(case, subject(go("A"))) is None
    assert scenario_in(case, subject(*CHILDREN, faults=("hang",))) is None


def test_no_folder_is_no_cases(tmp_path: Path) -> None:
    assert cases_in(str(tmp_path / "missing")) == []


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"gpsfsm_case": 2}, "gpsfsm_case must be 1"),
        ({"time_limit_s": -1}, "time_limit_s"),
        ({"time_limit_s": "1"}, "time_limit_s"),
        ({"seed": True}, "seed must be an integer"),
        ({"plan": None}, "is not a case"),
        ({"property": 3}, "3 is not a text"),
        ({"acts": [{"element": "/Plan", "fate": "DIES", "duration_ms": 1}]}, "DIES"),
        ({"acts": [{"element": "/Plan", "fate": "HANG", "duration_ms": 0}]}, "duration_ms"),
        ({"acts": [{"element": "/Plan", "fate": "HANG", "duration_ms": 0.0004}]}, "duration_ms"),
        ({"acts": [{"element": "/Plan", "fate": "HANG", "duration_ms": "1"}]}, "duration_ms"),
        (
            {"acts": [{"element": "/Plan", "fate": "HANG", "duration_ms": float("nan")}]},
            "duration_ms",
        ),
        ({"acts": 7}, "is not a case"),
    ],
)
def test_a_file_that_is_no_case_is_refused(
    tmp_path: Path, changed: dict[str, Any], message: str
) -> None:
    path = kept(tmp_path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **changed}))
    with pytest.raises(InputError, match=message) as raised:
        read_case(str(path))
    assert str(path) in str(raised.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", ":1:1: is not JSON: a value is expected"),
        ("[]", ": is not a case of 'gpsfsm fuzz' (TypeError: "),
        ("7", ": is not a case of 'gpsfsm fuzz' (TypeError: "),
        ("{}", ": is not a case of 'gpsfsm fuzz' (KeyError: 'gpsfsm_case')"),
        ("[" * 100_000, ": is not JSON that can be read: it is nested too deeply"),
        ('{"gpsfsm_case": 1}', ": is not a case of 'gpsfsm fuzz' (KeyError: 'time_limit_s')"),
    ],
)
def test_a_hostile_file_is_refused(tmp_path: Path, content: str, told: str) -> None:
    path = tmp_path / "case.json"
    path.write_text(content)
    with pytest.raises(InputError) as raised:
        read_case(str(path))
    assert str(raised.value).startswith(f"{path}{told}")


def test_what_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_case(str(tmp_path / "missing.json"))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is not a folder"):
        cases_in(str(tmp_path / "file"))
