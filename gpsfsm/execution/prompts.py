"""The prompt buffers of a run (semantics, section 8.3): texts are kept by uuid, none is taken out.

In real time a fill is no deed of its runner but of its outcome: ``FillsWritten`` puts the text in
once SUCCEEDED is journaled. So what is in the buffers is told by the journal alone, and after a
crash it is there again, each fill once.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from gpsfsm.execution.records import Kind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input, Record, RunValue

_MAX_TEXTS = 10_000
_MAX_CHARACTERS = 10_000_000


class PromptBuffers:
    """The texts that prompt runners have kept, by uuid. May be used from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: dict[str, list[str]] = {}
        self._texts = 0
        self._characters = 0

    def check(self, uuid: str, text: str) -> None:
        """Raises OverflowError if there is no room: 10,000 texts, 10,000,000 characters."""
        with self._lock:
            self._check(uuid, text)

    def fill(self, uuid: str, text: str) -> None:
        """Keep a text. Without a uuid nothing can ever flush it, so it is not kept.

        Raises OverflowError if there is no room for it.
        """
        with self._lock:
            self._check(uuid, text)
            self._put(uuid, text)

    def put(self, uuid: str, text: str) -> None:
        """Keep a text for which there was room when somebody looked."""
        with self._lock:
            self._put(uuid, text)

    def kept(self, uuid: str) -> tuple[str, ...]:
        """The texts in the buffer of a uuid, the oldest first."""
        with self._lock:
            return tuple(self._kept.get(uuid, ())) if uuid else ()

    def _check(self, uuid: str, text: str) -> None:
        full = self._texts >= _MAX_TEXTS or self._characters + len(text) > _MAX_CHARACTERS
        if uuid and full:
            raise OverflowError("the prompt buffers of this run are full")

    def _put(self, uuid: str, text: str) -> None:
        if uuid:
            self._texts += 1
            self._characters += len(text)
            self._kept.setdefault(uuid, []).append(text)


class FillsWritten:
    """Watches a run: a fill takes place when its success has been written down, not before.

    A runner that fills has a class method ``filled``: from its parameters it makes the uuid and the
    text, None if it flushes. ``class_of`` gives the class of a runner; it may raise.
    """

    def __init__(
        self, kernel: Kernel, buffers: PromptBuffers, class_of: Callable[[str, str], type]
    ) -> None:
        self._kernel = kernel
        self._buffers = buffers
        self._class_of = class_of
        self._parameters: dict[int, Mapping[str, RunValue]] = {}  # by node

    def __call__(self, _at_us: int, _happened: Input, records: Sequence[Record]) -> None:
        """Take note of what has been written."""
        for record in records:
            self._note(record.kind, record.node, record.data or {})

    def take(self, rows: Iterable[Row]) -> None:
        """Take note of what another process has written; rows that make no sense are left out."""
        last = len(self._kernel.runner_of)
        for row in rows:
            counts = row.record and row.kind in (Kind.TRIGGERED, Kind.SUCCEEDED)
            if counts and 1 <= row.node <= last:
                self._note(row.kind, row.node, row.values)

    def _note(self, kind: str, node: int, data: Mapping[str, RunValue]) -> None:
        if kind == Kind.TRIGGERED:
            self._parameters[node] = data
        elif kind == Kind.SUCCEEDED:
            number = self._kernel.automaton.runner_number(node)
            filled = self._filled(self._kernel.runner_of[number], self._parameters.pop(node, {}))
            if filled is not None:
                self._buffers.put(*filled)

    def _filled(self, runner: int, parameters: Mapping[str, RunValue]) -> tuple[str, str] | None:
        made = getattr(self._class_of(*self._kernel.runners[runner]), "filled", None)
        if made is None:
            return None
        filled: tuple[str, str] | None = made(parameters)
        return filled
