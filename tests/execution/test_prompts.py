"""Prompt buffers against a list, from many threads, and as the journal tells of them."""

from __future__ import annotations

import threading

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.prompts import FillsWritten, PromptBuffers
from gpsfsm.execution.records import Input, Kind
from tests.execution.support import compiled_of

UUIDS = st.sampled_from(["", "a", "b", "ä"])


class Buffers(RuleBasedStateMachine):
    """What is in the buffers is the list of what was put in."""

    def __init__(self) -> None:
        super().__init__()
        self.buffers = PromptBuffers()
        self.model: list[tuple[str, str]] = []

    @rule(uuid=UUIDS, text=st.text(max_size=5))
    def fill(self, uuid: str, text: str) -> None:
        self.buffers.fill(uuid, text)
        self.model.append((uuid, text))

    @rule(uuid=UUIDS, text=st.text(max_size=5))
    def look_for_room(self, uuid: str, text: str) -> None:
        self.buffers.check(uuid, text)

    @invariant()
    def the_same_is_kept(self) -> None:
        for uuid in ("a", "b", "ä", "c"):
            expected = tuple(text for name, text in self.model if name == uuid)
            assert self.buffers.kept(uuid) == expected
        assert self.buffers.kept("") == ()


TestBuffers = Buffers.TestCase


def test_many_threads_lose_nothing_and_keep_their_order() -> None:
    buffers, names = PromptBuffers(), [str(number) for number in range(8)]

    def work(name: str) -> None:
        for number in range(500):
            buffers.fill("all", f"{name} {number}")
            buffers.fill(name, str(number))
            assert buffers.kept(name)[-1] == str(number)

    threads = [threading.Thread(target=work, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    kept = buffers.kept("all")
    assert len(kept) == 8 * 500
    for name in names:
        own = [text.split()[1] for text in kept if text.startswith(f"{name} ")]
        assert own == list(buffers.kept(name)) == [str(number) for number in range(500)]


@pytest.mark.parametrize(("texts", "length"), [(10_000, 1), (10, 1_000_000)])
def test_buffers_are_bounded(texts: int, length: int) -> None:
    buffers = PromptBuffers()
    for _ in range(texts):
        buffers.fill("a", "x" * length)
    buffers.fill("", "nobody can ever ask for this, so it takes no room")
    for action in (buffers.check, buffers.fill):
        with pytest.raises(OverflowError, match="full"):
            action("a", "x")
    assert len(buffers.kept("a")) == texts


# -- what the journal tells -----------------------------------------------------------------------


class Filling:
    @staticmethod
    def filled(parameters):
        return None if parameters.get("flush") else (parameters["uuid"], parameters["text"])


class Other:
    """Has nothing to do with prompts."""


def step(name: str, **parameters: str) -> str:
    written = " ".join(f'{key}="{value}"' for key, value in parameters.items())
    return f'<Runner interface="{name}" provider="{name}" {written}/>'


PLAN = (
    f"<Plan>{step('fill', uuid='u', text='one')}"
    f"<Control type='recovery'>{step('fill', uuid='u', text='two')}</Control>"
    f"{step('other', uuid='u', text='no')}{step('fill', uuid='u', text='no', flush='true')}</Plan>"
)


def classes(interface: str, _provider: str) -> type:
    return Filling if interface == "fill" else Other


def test_a_fill_is_there_once_its_success_is_written_and_again_from_the_rows() -> None:
    kernel = Kernel(compiled_of(PLAN))
    live, maker, rows = PromptBuffers(), RowMaker(kernel), []
    fills = FillsWritten(kernel, live, classes)
    ended = [Input(Kind.FAILED, 0), *(Input(Kind.SUCCEEDED, number) for number in (1, 2, 3))]
    loading = [Input(Kind.LOADED, runner=number) for number in range(len(kernel.runners))]
    pending = [Input(Kind.BEGIN), *loading[:1], *ended[:2], *loading[1:], *ended[2:]]
    done = False
    for happened in pending:
        records, _ = kernel.step(happened)
        rows += maker.make(0, happened, records)
        fills(0, happened, records)
        again = PromptBuffers()
        FillsWritten(Kernel(compiled_of(PLAN)), again, classes).take(rows)
        assert again.kept("u") == live.kept("u")
        done = done or happened is ended[1]
        assert live.kept("u") == (("two",) if done else ())
    assert kernel.status.ended


def test_a_late_success_fills_nothing() -> None:
    kernel = Kernel(compiled_of(f"<Plan>{step('fill', uuid='u', text='one')}</Plan>"))
    buffers = PromptBuffers()
    fills = FillsWritten(kernel, buffers, classes)
    happening = [
        Input(Kind.BEGIN),
        Input(Kind.LOADED, runner=0),
        Input(Kind.CANCEL),
        Input(Kind.SUCCEEDED, 0),
    ]
    for happened in happening:
        records, _ = kernel.step(happened)
        fills(0, happened, records)
    assert buffers.kept("u") == ()
