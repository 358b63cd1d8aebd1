"""JSON with a key twice is refused, and by everything that reads what others have written."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.checking.selection import load_baseline
from gpsfsm.errors import ConfigError, GpsfsmError, InputError
from gpsfsm.fuzzing.cases import read_case
from gpsfsm.gating import GateOptions, gate_text
from gpsfsm.gating.gate_process import verdict_of, written
from gpsfsm.gating.receipts import read_receipt, write_receipt
from gpsfsm.grading.experiment import recorded_times
from gpsfsm.running.scenario import read_scenario
from gpsfsm.strict_json import _REASONS, DuplicateKeyError, strict_loads
from gpsfsm.workers.frames import unpack
from tests.service.support import BAD, GOOD

if TYPE_CHECKING:
    from pathlib import Path

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=15,
)


@given(VALUES)
def test_it_reads_what_the_standard_library_reads(value: object) -> None:
    assert strict_loads(json.dumps(value)) == value


@given(VALUES, VALUES, st.text(max_size=4), st.integers(0, 5))
def test_a_key_twice_is_seen_at_any_depth(one: object, other: object, key: str, depth: int) -> None:
    name = json.dumps(key)
    text = f"{{{name}: {json.dumps(one)}, {name}: {json.dumps(other)}}}"
    for _ in range(depth):
        text = f'{{"a": [{text}]}}'
    with pytest.raises(DuplicateKeyError, match="twice"):
        strict_loads(text)


def test_the_same_key_written_in_two_ways() -> None:
    with pytest.raises(DuplicateKeyError):
        strict_loads(r'{"plan": 1, "\u0070lan": 2}')


@given(st.text(st.sampled_from('[]{},: \n"\\utnl10a\x01\ufeff'), max_size=12))
@example("[1, \n]")
@example('{"a": 1,}')
@example('{"a": [,]}')
def test_what_is_wrong_is_said_in_our_words(text: str) -> None:
    """Those of the standard library change, and with them the place of a comma too many."""
    error = None
    try:
        strict_loads(text)
    except json.JSONDecodeError as raised:
        error = raised
    except DuplicateKeyError:
        pass
    if error is not None:
        assert error.msg in _REASONS.values()
        before, rest = text[: error.pos].rstrip(), text[error.pos :].lstrip()
        assert not (before.endswith(",") and rest.startswith(("]", "}")))


def doubled(text: str, key: str, value: str) -> str:
    """The text with a key once more, behind the first one."""
    at = text.index(f'"{key}"')
    return f'{text[:at]}"{key}": {value}, {text[at:]}'


def test_a_receipt_that_says_two_things() -> None:
    """Of the plan that is refused, it says accept as well: a reader could take either."""
    receipt = write_receipt([gate_text(BAD, "plan.xml", GateOptions())])
    assert read_receipt(receipt.encode(), "receipt") == ()
    forged = receipt.replace(
        '"verdict": "rejected"', '"verdict": "rejected", "verdict": "accepted"'
    )
    forged = forged.replace('"reason": "findings"', '"reason": "findings", "reason": "passed"')
    assert forged != receipt
    with pytest.raises(ConfigError, match="'verdict' occurs twice"):
        read_receipt(forged.encode(), "receipt")


def test_a_worker_that_says_two_things() -> None:
    verdict = written(gate_text(GOOD, "plan.xml", GateOptions())).decode()
    assert verdict_of(verdict.encode())
    with pytest.raises(ValueError, match="twice"):
        verdict_of(doubled(verdict, "Verdict", "[]").encode())
    with pytest.raises(ValueError, match="twice"):
        unpack(b'{"status": 200, "status": 422}')


def test_files_that_say_two_things(tmp_path: Path) -> None:
    file = tmp_path / "file.json"
    file.write_text('{"version": 1, "plans": [], "plans": []}', encoding="utf-8")
    with pytest.raises(InputError, match="'plans' occurs twice"):
        load_baseline(file)
    with pytest.raises(InputError, match="'plans' occurs twice"):
        read_scenario(str(file), "plan.xml")
    with pytest.raises(InputError, match="'plans' occurs twice"):
        read_case(str(file))
    (tmp_path / "responses.jsonl").write_text('{"model": "a", "model": "b"}\n', encoding="utf-8")
    with pytest.raises(GpsfsmError, match="'model' occurs twice"):
        list(recorded_times(str(tmp_path)))
