"""Prompts that are never sent (GP411, GP414)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.flow import buffer_name
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit, attribute_end, escaped

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.plan import Element


_NAME = "prompt"
_TITLE = 'flush="true" written at line {}'


def _missing_flush(draft: Draft) -> Iterator[Fix]:
    """One fix for all prompts without a buffer, which then share one; then one per buffer."""
    yield from _together(draft)
    for finding in draft.findings("GP411", "GP414"):
        elements = [draft.element(finding)]
        if finding.rule == "GP411":
            elements += (draft.element(other) for other in finding.related)
        runners = sorted(
            (each for each in elements if each is not None), key=lambda each: each.index
        )
        edits = tuple(_written(draft, runners[-1], "true")) if runners else ()
        if edits:
            title = _TITLE.format(runners[-1].line)
            yield Fix(finding.rule, title, draft.offset(finding), edits, Safety.UNSAFE)


def _together(draft: Draft) -> Iterator[Fix]:
    """Prompts without a uuid wait in buffers that nothing flushes: the last one shall send all."""
    nameless = [
        (finding, runner)
        for finding, runner in draft.elements("GP411", "GP414")
        if not buffer_name(draft.bindings.get(runner.index))
    ]
    nameless.sort(key=lambda each: each[1].index)
    if len(nameless) < 2:
        return
    runners = [runner for _, runner in nameless]
    *others, last = runners
    used = {buffer_name(binding) for binding in draft.bindings.values()}
    name = next(each for each in _names() if each not in used)
    edits = [edit for other in others for edit in _written(draft, other, "", name)]
    edits += _written(draft, last, "true", name)
    finding = nameless[0][0]
    title = f'uuid="{name}" written at {len(runners)} prompts, and flush="true" at line {last.line}'
    yield Fix(finding.rule, title, draft.offset(finding), tuple(edits), Safety.UNSAFE)


def _names() -> Iterator[str]:
    yield _NAME
    number = 2
    while True:
        yield f"{_NAME}_{number}"
        number += 1


def _written(draft: Draft, runner: Element, flush: str, uuid: str = "") -> Sequence[Edit]:
    """The edits that give a prompt these values; none if it is no prompt."""
    binding, node = draft.bindings.get(runner.index), draft.node(runner)
    buffer = binding.provider.effects.prompt_buffer if binding else None
    if binding is None or node is None or buffer is None or not node.tag.attributes:
        return ()
    edits: list[Edit] = []
    added = ""
    for name, value in ((buffer.uuid, uuid), (buffer.flush, flush)):
        literal = binding.written.get(name)
        raw = node.attribute(literal.name) if literal else None
        if not value:
            continue
        if raw is not None:
            edits.append(attribute_edit(draft, raw, raw.name, value))
        else:
            added += f' {name}="{escaped(value)}"'
    end = attribute_end(draft.text, node.tag.attributes[-1])
    return (*edits, Edit(end, end, added)) if added else tuple(edits)


FIXERS = (
    Fixer(
        name="missing-flush",
        rules=("GP411", "GP414"),
        propose=_missing_flush,
        unsafe=(
            'writes flush="true" at the last prompt of a buffer, and one uuid at prompts '
            "without any: the model is asked then, which takes time and money, and they may "
            "not belong together"
        ),
        # A prompt that is sent can fail, hands its answer on, and sends all that waits with it.
        reveals=frozenset({"GP302", "GP403", "GP404", "GP411", "GP412", "GP413"}),
    ),
)
