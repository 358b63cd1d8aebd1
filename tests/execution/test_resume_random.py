"""Random plans: replay gives every event again, and a cut anywhere changes nothing."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.replay import replay
from tests.cases import many
from tests.execution.journaling import (
    compiled,
    cut,
    ends_of_writes,
    exported,
    resume_journaled,
    run_journaled,
)
from tests.oracle import P, to_xml
from tests.strategies import plans


@settings(max_examples=many(40))
@given(plan=plans(min_runners=1), seed=st.integers(0, 10**6), data=st.data())
def test_a_cut_anywhere_changes_nothing(plan: P, seed: int, data: st.DataObject) -> None:
    text = to_xml(plan)
    with tempfile.TemporaryDirectory() as name:
        whole, broken = Path(name, "whole.db"), Path(name, "cut.db")
        first = run_journaled(whole, text, seed=seed)
        expected = exported(whole)
        with JournalReader(str(whole)) as reader:
            rows = list(reader.events(1))
        kernel = Kernel(compiled(text))
        left = replay(kernel, rows)
        assert kernel.status is first.status
        assert (left.active, left.loaded, left.loading) == ((), (), ())
        cut(whole, broken, data.draw(st.sampled_from(ends_of_writes(whole)), "cut"))
        assert resume_journaled(broken).status is first.status
        assert exported(broken) == expected
