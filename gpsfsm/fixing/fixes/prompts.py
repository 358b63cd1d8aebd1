"""Prompts that are never sent (GP411, GP414)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.flow import buffer_name
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit, attribute_end, escaped, without_attribute

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.plan import Element


_NAME = "prompt"
_TITLE = 'flush="true" written at line {}'


def _missing_flush(draft: Draft) -> Iterator[Fix]:
    """One fix for all prompts without a buffer, which then share one; then one per buffer.

    A named buffer is sent by the first prompt without a uuid behind it: what waits in the buffer,
    such as the description of a picture, is of use only to the prompt whose answer is used.
    """
    yield from _together(draft)
    joined = list(_joined(draft))
    yield from joined
    done = {place for fix in joined for place in (fix.at, *(edit.start for edit in fix.edits))}
    for finding in draft.findings("GP411", "GP414"):
        around = draft.around(draft.offset(finding))
        if around and any(around.start <= at < around.tag.end for at in done):
            continue
        elements = [draft.element(finding)]
        if finding.rule == "GP411":
            elements += (draft.element(other) for other in finding.related)
        runners = sorted(
            (each for each in elements if each is not None), key=lambda each: each.index
        )
        edits = tuple(_written(draft, runners[-1], "true")) if runners else ()
        if edits:
            title = _TITLE.format(runners[-1].line)
            needless = _own_buffer(draft, runners)
            if needless is not None:
                edits = (needless, *edits)
                title += ", and the uuid left out, which no other prompt has"
            yield Fix(finding.rule, title, draft.offset(finding), edits, Safety.UNSAFE)


def _own_buffer(draft: Draft, runners: Sequence[Element]) -> Edit | None:
    """The removal of a uuid that only this prompt has: sent alone, it needs no buffer (GP412)."""
    binding, node = draft.bindings.get(runners[0].index), draft.node(runners[0])
    buffer = binding.provider.effects.prompt_buffer if binding else None
    if len(runners) > 1 or binding is None or buffer is None or node is None:
        return None
    name = buffer_name(binding)
    alone = sum(buffer_name(each) == name for each in draft.bindings.values()) == 1
    literal = binding.written.get(buffer.uuid)
    raw = node.attribute(literal.name) if literal and name and alone else None
    return None if raw is None else without_attribute(draft, raw)


def _joined(draft: Draft) -> Iterator[Fix]:
    """One fix per named buffer that nothing flushes and that a nameless prompt can flush.

    An example: ``text uuid="a"``, ``plan task="…"`` becomes ``text uuid="a"``,
    ``plan task="…" flush="true" uuid="a"``: the model that plans gets the text.
    """
    nameless = [
        runner
        for _, runner in draft.elements("GP411", "GP414")
        if not buffer_name(draft.bindings.get(runner.index))
    ]
    for finding, runner in draft.elements("GP411"):
        name = buffer_name(draft.bindings.get(runner.index))
        others = (draft.element(other) for other in finding.related)
        last = max(each.index for each in (runner, *others) if each is not None)
        sender = next((each for each in nameless if each.index > last), None)
        if name and sender is not None:
            nameless.remove(sender)
            edits = tuple(_written(draft, sender, "true", name))
            title = f'flush="true" uuid="{name}" written at line {sender.line}'
            yield Fix("GP411", title, draft.offset(finding), edits, Safety.UNSAFE)


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
            'writes flush="true" at the last prompt of a buffer, or with its uuid at the next '
            "prompt that has none, and one uuid at prompts without any: the model is asked then, "
            "which takes time and money, and they may not belong together"
        ),
        # A prompt that is sent can fail, hands its answer on, and sends all that waits with it.
        reveals=frozenset({"GP302", "GP403", "GP404", "GP411", "GP412", "GP413"}),
    ),
)
