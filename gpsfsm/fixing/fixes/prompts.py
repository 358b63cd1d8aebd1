"""Prompts that are never sent (GP411, GP414), and questions that decide nothing (GP312)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.analysis.flow import buffer_name
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit, attribute_end, escaped, without_attribute

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.model.capability import Provider
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
                title += "; uuid, which no other prompt has, removed"
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
            title = f'flush="true" uuid="{name}" set at line {sender.line}'
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
    title = f'uuid="{name}" set on {len(runners)} prompts, and flush="true" at line {last.line}'
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


def _checked_question(draft: Draft) -> Iterator[Fix]:
    """One fix per question in front of a recovery: a runner asks it that fails on no."""
    checks = [
        provider
        for provider in draft.library.providers
        if provider.effects.checks and not provider.deprecated
    ]
    checks.sort(key=lambda provider: provider.name)
    for finding, recovery in draft.elements("GP312") if checks else ():
        runner = next(filter(None, map(draft.element, finding.related)), None)
        binding = draft.bindings.get(runner.index) if runner is not None else None
        if runner is None or binding is None or _means_yes(recovery):
            continue
        question = runner.text(binding.provider.effects.question) or ""
        if _QUESTION.fullmatch(question.strip()) is None or _gets_text(draft, runner, checks[0]):
            continue
        if _is_read(draft, runner, binding.provider.effects.answers):
            continue
        edits = _replaced(draft, runner, binding.provider.effects.question, checks[0])
        if edits:
            name = checks[0].implements.rpartition("/")[2]
            title = f"question at line {runner.line} asked by a {name}, which fails on a 'no'"
            yield Fix(finding.rule, title, draft.offset(finding), edits, Safety.UNSAFE)


_QUESTION = re.compile(
    r"(?:is|are|was|were|do|does|did|has|have|had|can|could|will|would|should)\b"
    r"(?:(?!\b(?:or|and|what|which|who|where|how|why)\b)[^?.!;])*\?",
    re.IGNORECASE,
)
"""One plain question for yes or no."""
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+")
_IF = frozenset(("if", "when", "whenever", "is", "are", "has"))
_NOT = frozenset(
    (
        *("no", "not", "none", "nobody", "nothing", "without", "otherwise", "else", "unless"),
        *("missing", "absent", "empty", "closed"),
    )
)


def _means_yes(recovery: Element) -> bool:
    """True if a recovery is named after a condition and not after its opposite: ``if_a_person``."""
    words = {word.lower() for word in _WORD.findall(recovery.text("name") or "")}
    return bool(words & _IF) and not words & _NOT


def _gets_text(draft: Draft, runner: Element, check: Provider) -> bool:
    """True if a step before the runner may hand over what the check would judge instead.

    The step right before is the last runner of the sibling before the element, or of the sibling
    before what it is in. All runners of these siblings are looked at.
    """
    names = {each.name for each in check.inputs}
    node = draft.node(runner)
    while node is not None and node.parent is not None:
        siblings = node.parent.children
        place = next(n for n, each in enumerate(siblings) if each is node)
        before = [] if place == 0 else [siblings[place - 1]]
        while before:
            other = before.pop()
            before += other.children
            binding = draft.bindings.get(_index(draft, other))
            gives = {output.name for output in binding.provider.outputs} if binding else set()
            if other.name == "Runner" and (binding is None or gives & names):
                return True
        node = node.parent
    return False


def _is_read(draft: Draft, runner: Element, answer: str) -> bool:
    """True if the next step may take the answer, which a check does not hand on."""
    node = draft.node(runner)
    siblings = [] if node is None or node.parent is None else node.parent.children
    after = [n for n, each in enumerate(siblings[:-1], 1) if each is node]
    pending = [siblings[place] for place in after]
    while pending:
        other = pending.pop()
        pending += other.children
        binding = draft.bindings.get(_index(draft, other))
        if other.name == "Runner" and (binding is None or binding.provider.input(answer)):
            return True
    return False


def _index(draft: Draft, node: Node) -> int:
    runners = draft.plan.runners if draft.plan is not None else ()
    return next((each.index for each in runners if draft.node(each) is node), -1)


def _replaced(draft: Draft, runner: Element, question: str, check: Provider) -> tuple[Edit, ...]:
    """The edits that put the check into the place of a runner: it keeps its label and question."""
    node = draft.node(runner)
    if node is None or {"interface", "provider"} - {each.name for each in node.tag.attributes}:
        return ()
    edits = []
    kept = {each.name for each in check.configuration} | {"name", "id"}
    for raw in node.tag.attributes:
        if raw.name == "interface":
            edits.append(attribute_edit(draft, raw, raw.name, check.implements))
        elif raw.name == "provider":
            edits.append(attribute_edit(draft, raw, raw.name, check.name))
        elif raw.name == question:
            edits.append(attribute_edit(draft, raw, check.effects.checks))
        elif raw.name not in kept:
            edits.append(without_attribute(draft, raw))
    return tuple(edits)


FIXERS = (
    Fixer(
        name="checked-question",
        rules=("GP312",),
        propose=_checked_question,
        unsafe=(
            "asks a yes-or-no question before a recovery with a runner that fails if the answer is "
            "no: the recovery may have been meant for yes, or for a broken camera"
        ),
        # The check hands nothing on.
        reveals=frozenset({"GP404"}),
    ),
    Fixer(
        name="missing-flush",
        rules=("GP411", "GP414"),
        propose=_missing_flush,
        unsafe=(
            'adds `flush="true"` to the last prompt of a buffer or, with the uuid of the buffer, '
            "to the next prompt that has none, and gives prompts without a uuid a common one: the "
            "model is then asked, which costs time and money, and the prompts may not belong "
            "together"
        ),
        # A prompt that is sent can fail, hands its answer on, and sends all that waits with it.
        reveals=frozenset({"GP302", "GP403", "GP404", "GP411", "GP412", "GP413"}),
    ),
)
