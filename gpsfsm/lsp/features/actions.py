"""Code actions: fixes that are proved, all of them at once, and comments that allow a finding."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, cast

from lsprotocol.types import (
    CODE_ACTION_RESOLVE,
    TEXT_DOCUMENT_CODE_ACTION,
    CodeAction,
    CodeActionKind,
    CodeActionOptions,
    CodeActionParams,
    OptionalVersionedTextDocumentIdentifier,
    TextDocumentEdit,
    TextEdit,
    WorkspaceEdit,
)

from gpsfsm.analysis.rules import says_no_verdict
from gpsfsm.lsp.checking import Checked, Job, path_of
from gpsfsm.lsp.diagnostics import diagnostics, span
from gpsfsm.lsp.features import Feature
from gpsfsm.lsp.texts import tag_around

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Sequence

    from lsprotocol.types import Diagnostic

    from gpsfsm.fixing.suggest import Mended
    from gpsfsm.lsp.checking import Setting
    from gpsfsm.lsp.session import Session
    from gpsfsm.lsp.texts import Text
    from gpsfsm.model.finding import Finding

FIX_ALL = f"{CodeActionKind.SourceFixAll.value}.gpsfsm"
_MOST = 8
_PATIENCE_S = 3.0
"""After so long no further finding is looked at: an editor asks with each move of the cursor."""
_INDENT = re.compile(r"[ \t]*")
_COMMENT = "<!-- gpsfsm: ignore {} because {} -->"


async def actions(session: Session, params: CodeActionParams) -> list[CodeAction] | None:
    """The actions for the findings in a range."""
    uri = params.text_document.uri
    if session.text(uri) is None:
        return None
    checked = await session.checking.current(uri)
    if checked is None or checked.setting.error:
        return None
    wanted = [str(getattr(kind, "value", kind)) for kind in params.context.only or ()]
    offered: list[CodeAction] = []
    if _asks(wanted, CodeActionKind.QuickFix.value):
        places = checked.text.places
        first, last = places.offset(params.range.start), places.offset(params.range.end)
        chosen = _chosen(checked, first, last)
        async for action in _fixes(session, checked, chosen):
            offered.append(action)
        async for action in _allowing(session, checked, chosen):
            offered.append(action)
    if _asks(wanted, FIX_ALL):
        offered += await _fix_all(session, checked)
    return offered or None


async def resolve(session: Session, action: CodeAction) -> CodeAction:
    """The edit of an action that was offered without."""
    data = action.data if isinstance(action.data, dict) else {}
    uri, version = data.get("uri"), data.get("version")
    text = session.text(uri) if isinstance(uri, str) else None
    if text is None or text.version != version:
        return action  # it has changed meanwhile
    action.edit = await _all_at_once(session, text, await session.setting(text))
    return action


def _asks(wanted: Sequence[str], kind: str) -> bool:
    """True if an action of this kind is requested; nothing is named where any kind is."""
    return not wanted or any(kind == name or kind.startswith(f"{name}.") for name in wanted)


def _chosen(checked: Checked, first: int, last: int) -> list[tuple[Finding, Diagnostic]]:
    """The findings in a range, with what the editor was told of them."""
    shown = diagnostics(checked, None, related=False)
    chosen = []
    for finding, diagnostic in zip(checked.report.findings, shown, strict=False):
        start, end = span(finding.location, finding.length, checked.text)
        if start <= last and first <= end:
            chosen.append((finding, diagnostic))
    return chosen[:_MOST]


async def _fixes(
    session: Session, checked: Checked, chosen: Sequence[tuple[Finding, Diagnostic]]
) -> AsyncIterator[CodeAction]:
    from gpsfsm.fixing.suggest import fixable

    text = checked.text
    path = path_of(text, checked.setting)
    until = time.monotonic() + _PATIENCE_S
    for finding, diagnostic in chosen:
        if not fixable(finding.rule):
            continue
        if time.monotonic() > until:
            return
        job = Job("fix", text.content, path, finding=finding)
        answer = await session.mend(job, checked.setting)
        if answer is None:  # it takes too long with this text
            return
        mended = cast("tuple[Mended, ...]", answer) if isinstance(answer, tuple) else ()
        for number, each in enumerate(mended):
            yield CodeAction(
                title=_title(finding, each),
                kind=CodeActionKind.QuickFix,
                diagnostics=[diagnostic],
                is_preferred=True if each.safe and number == 0 else None,
                edit=_edit(text, [(e.start, e.end, e.text) for e in each.edits]),
            )


def _title(finding: Finding, mended: Mended) -> str:
    title = f"{finding.rule}: {mended.title}"
    return title if mended.safe else f"{title} (unsafe: may change what the plan does)"


async def _allowing(
    session: Session, checked: Checked, chosen: Sequence[tuple[Finding, Diagnostic]]
) -> AsyncIterator[CodeAction]:
    """A comment before the element, as docs/rules tells it, where it can allow the finding."""
    text = checked.text
    path = path_of(text, checked.setting)
    for finding, diagnostic in chosen:
        if says_no_verdict(finding.rule) or not finding.location.element:
            continue
        start, _ = span(finding.location, finding.length, text)
        at = tag_around(text.content, start)
        if at is None:
            continue
        before = text.content[text.places.line_begin(at) : at]
        behind = f"\n{before}" if _INDENT.fullmatch(before) else ""
        with_reason = _COMMENT.format(finding.rule, "of a reason") + behind
        content = text.content[:at] + with_reason + text.content[at:]
        allowed = await session.mend(Job("allows", content, path, finding=finding), checked.setting)
        if allowed is None:
            return
        if not allowed:
            continue
        comment = _COMMENT.format(finding.rule, "...")  # it allows nothing before a reason is there
        new = comment + behind
        yield CodeAction(
            title=f"{finding.rule}: allow it here, and say why ({comment})",
            kind=CodeActionKind.QuickFix,
            diagnostics=[diagnostic],
            edit=_edit(text, [(at, at, new)], plain=True),
        )


async def _fix_all(session: Session, checked: Checked) -> list[CodeAction]:
    from gpsfsm.fixing.suggest import fixable

    if not any(fixable(finding.rule) for finding in checked.report.findings):
        return []
    text = checked.text
    action = CodeAction(
        title="Fix all that can be fixed safely",
        kind=FIX_ALL,
        data={"uri": text.uri, "version": text.version},
    )
    if not _resolves(session):
        action.edit = await _all_at_once(session, text, checked.setting)
        return [action] if action.edit is not None else []
    return [action]


def _resolves(session: Session) -> bool:
    """True if the editor asks for the edit once it wants it."""
    about = session.client.text_document and session.client.text_document.code_action
    support = about.resolve_support if about else None
    return support is not None and "edit" in support.properties


async def _all_at_once(session: Session, text: Text, setting: Setting) -> WorkspaceEdit | None:
    job = Job("fix-all", text.content, path_of(text, setting))
    new = await session.mend(job, setting)
    if not isinstance(new, str) or new == text.content:
        return None
    old = text.content[text.marked :]
    first = 0
    while first < min(len(old), len(new)) and old[first] == new[first]:
        first += 1
    last = 0
    while last < min(len(old), len(new)) - first and old[-1 - last] == new[-1 - last]:
        last += 1
    return _edit(text, [(first, len(old) - last, new[first : len(new) - last])])


def _edit(
    text: Text, edits: Sequence[tuple[int, int, str]], *, plain: bool = False
) -> WorkspaceEdit:
    """Edits of this very version; offsets do not count a byte order mark, unless ``plain``."""
    shift = 0 if plain else int(text.marked)
    made = [
        TextEdit(text.places.range(start + shift, end + shift), new) for start, end, new in edits
    ]
    document = OptionalVersionedTextDocumentIdentifier(uri=text.uri, version=text.version)
    return WorkspaceEdit(document_changes=[TextDocumentEdit(document, list(made))])


FEATURE = Feature(
    TEXT_DOCUMENT_CODE_ACTION,
    actions,
    CodeActionOptions(code_action_kinds=[CodeActionKind.QuickFix, FIX_ALL], resolve_provider=True),
)
FURTHER = (Feature(CODE_ACTION_RESOLVE, resolve),)
