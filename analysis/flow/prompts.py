"""Which instances fill and flush which prompt buffer (semantics, section 8.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.flow.values import Values

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Value

__all__ = ["Prompt", "Prompts", "buffer_name", "prompts_of"]


class Prompt(NamedTuple):
    """An instance that prompts a model.

    ``flush`` and ``uuid`` are None where they are not known before the run; ``uuid`` is "" where
    there is none. ``answer`` names the output that holds the answer.
    """

    runner: int
    flush: bool | None
    uuid: str | None
    answer: str


class Prompts:
    """The prompts of a plan in document order, and the values that arrive at its instances."""

    def __init__(self, found: tuple[Prompt, ...], values: Values) -> None:
        self.all = found
        self.values = values
        self._filling: dict[str, list[int]] = {}
        self._flushing: dict[str, list[int]] = {}
        self._unsure: set[tuple[str, bool]] = set()  # buffers that something unknown may change
        self._any: set[bool] = set()  # and what may be done to any buffer
        for prompt in found:
            for flush, known in ((True, self._flushing), (False, self._filling)):
                if prompt.flush is (not flush):
                    continue
                if prompt.uuid is None:
                    self._any.add(flush)
                elif prompt.flush is None:
                    self._unsure.add((prompt.uuid, flush))
                else:
                    known.setdefault(prompt.uuid, []).append(prompt.runner)

    @property
    def fills(self) -> tuple[Prompt, ...]:
        """The instances that are known to fill a buffer that is known."""
        return tuple(found for found in self.all if found.flush is False and found.uuid is not None)

    @property
    def flushes(self) -> tuple[Prompt, ...]:
        """The instances that are known to flush a named buffer."""
        return tuple(found for found in self.all if found.flush and found.uuid)

    def flushing(self, uuid: str) -> tuple[int, ...] | None:
        """The runners that flush a buffer; None if one of which this is not known may.

        Nothing flushes the buffer of a prompt without uuid.
        """
        return () if not uuid else self._of(uuid, flush=True)

    def filling(self, uuid: str) -> tuple[int, ...] | None:
        """The runners that fill a buffer; None if one of which this is not known may."""
        return self._of(uuid, flush=False)

    def _of(self, uuid: str, *, flush: bool) -> tuple[int, ...] | None:
        if flush in self._any or (uuid, flush) in self._unsure:
            return None
        return tuple((self._flushing if flush else self._filling).get(uuid, ()))


def prompts_of(compiled: Compiled) -> Prompts | None:
    """The prompts of a plan; None if there are none."""
    prompting = [
        number
        for number, binding in enumerate(compiled.bindings)
        if binding is not None and binding.provider.effects.prompt_buffer is not None
    ]
    if not prompting:
        return None
    values = Values(compiled)
    return Prompts(tuple(_prompt(values, number) for number in prompting), values)


def _prompt(values: Values, number: int) -> Prompt:
    binding = values.bindings[number]
    assert binding is not None
    buffer = binding.provider.effects.prompt_buffer
    assert buffer is not None
    flush = _said_true(values.known(number, buffer.flush))
    uuid = buffer_name(binding)
    return Prompt(
        runner=number,
        flush=flush if binding.settled(buffer.flush) else None,
        uuid=uuid if binding.settled(buffer.uuid) else None,
        answer=buffer.answer,
    )


def _said_true(value: Value | None) -> bool | None:
    """Whether a value asks to flush; None where it says neither."""
    if isinstance(value, str):
        return {"true": True, "false": False}.get(value.strip().lower())
    return value if isinstance(value, bool) else False if value is None else None


def buffer_name(binding: Binding | None) -> str:
    """The uuid of the buffer of a prompt, as its runner reads it; "" if it names none."""
    buffer = binding.provider.effects.prompt_buffer if binding else None
    value = binding.worked_with(buffer.uuid) if binding and buffer else None
    return str(value).lower() if isinstance(value, bool) else "" if value is None else str(value)
