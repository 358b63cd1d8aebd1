"""The plan in a language model's raw answer.

The answer is cut, not rewritten: every offset stays that of the answer. Places of ``<Plan>`` wait
on a stack for their ``</Plan>``; the last plan that is complete is taken, else the last that is
open. What was thought aloud (``<think>``) and what prose mentions in backticks is passed over.

``<think><Plan>…</Plan></think> I use `<Plan>`: <Plan>…</Plan> Enjoy!``
    The first plan was thought, the second is a mention, the third is taken; the rest is left out.

An answer may be copied from a terminal: below the command, ``@ros2 launch …``, or out of the log of
``ros2 launch``, where each line begins with the name of the process, ``[fabric_server-1]``. These
prefixes are blanked if all lines of the plan have them.
"""

from __future__ import annotations

import re
from dataclasses import field

from gpsfsm.late import dataclass, pattern
from gpsfsm.syntax.text import WHITE, Finder, Lines

_W = f"[{WHITE}]"

# Strings are skipped, so that a <Plan> in an attribute value is none. A string that spans lines
# must hold no '<': else a forgotten quote would hide the rest of the answer.
_BODY = r"(?:=[ \t\r\n]*+(?:\"(?:[^\"\n]*+|[^\"<]*+)\"|'(?:[^'\n]*+|[^'<]*+)')|[^<>\"'])*+"
_WORD = rf"(?:!--|!\[CDATA\[|/?+(?:Plan(?={_W}|/|>|\Z)|(?i:think(?:ing)?+){_W}*+>))"
_SKIP = pattern(rf"(?:[^<]++|<(?!{_WORD})(?:[A-Za-z_:]{_BODY})?+)*+")
_PLAN = pattern(rf"<Plan{_BODY}>")
_END = pattern(rf"</Plan{_W}*+>")
_THINK = pattern(rf"<(/?+)(?i:think(?:ing)?+){_W}*+>")
_FENCE = pattern(r"^[ \t]*+(?:```|~~~)[^\n]*+$", re.MULTILINE)
_DECLARATION = pattern(r"<[?!]xml\s[^<>]*+>")
_COMMENT = pattern(r"<!--(?:[^-]++|-(?!->))*+-->")
_COMMAND = pattern(r"^[ \t]*+(?:\S{0,200}[@$#>%][ \t]*+)?ros2[ \t][^\n<]*+", re.MULTILINE)
_PREFIX = pattern(r"^\[[\w.-]{0,200}\w-\d{1,9}\](?: |$)", re.MULTILINE)
_AROUND = pattern(rf"(?:<\?xml{_W}[^<>]*+>)?+(?:{_W}++|<!--(?:[^-]++|-(?!->))*+-->)*+")


@dataclass(frozen=True, slots=True)
class Extract:
    """The plan is ``text[start:end]`` without the ``prefixes``, spans in which a log put names.

    ``note`` tells what was left out ("" if nothing was).
    """

    start: int
    end: int
    note: str = ""
    prefixes: tuple[tuple[int, int], ...] = ()

    def of(self, text: str) -> str:
        """The plan, with blanks for the prefixes, so that no place in it changes."""
        parts, pos = [], self.start
        for start, end in self.prefixes:
            parts += [text[pos:start], " " * (end - start)]
            pos = end
        return "".join([*parts, text[pos : self.end]])


@dataclass(slots=True)
class _Scan:
    """The plans of an answer: complete ones, places of ``<Plan>`` that are still open."""

    complete: list[tuple[int, int]] = field(default_factory=list)
    mentions: list[tuple[int, int]] = field(default_factory=list)
    open: list[int] = field(default_factory=list)
    thought: int = 0  # how many plans the model wrote down while thinking
    think_from: int = -1
    thinks: list[tuple[int, int]] = field(default_factory=list)


def extract_plan(text: str, limit: int) -> Extract | None:
    """The last complete plan of an answer, else the last incomplete one; None if there is none.

    At most ``limit`` tags and comments are looked at.

    >>> answer = "Here it is: <Plan></Plan> Enjoy!"
    >>> found = extract_plan(answer, 100)
    >>> answer[found.start : found.end]
    '<Plan></Plan>'
    """
    prefixes = [match.span() for match in _PREFIX.finditer(text)]
    if prefixes:
        # A line that the plan begins behind other words has its prefix before the plan.
        whole = Extract(0, len(text), "", tuple(prefixes)).of(text)
        extract = _extract(whole, limit, of_log=True)
        if extract is not None:
            first = text.rfind("\n", 0, extract.start) + 1
            lines = [each for each in prefixes if first <= each[0] < extract.end]
            if len(lines) == 1 + text.count("\n", first, extract.end):
                return Extract(extract.start, extract.end, extract.note, tuple(lines[1:]))
    return _extract(text, limit)


def _extract(text: str, limit: int, *, of_log: bool = False) -> Extract | None:
    """The plan in a text; one out of a log never stands alone."""
    scan = _scan(text, limit)
    if scan.complete or scan.mentions:
        start, end = (scan.complete or scan.mentions)[-1]
        if not of_log and _AROUND.fullmatch(text, 0, start) and _AROUND.fullmatch(text, end):
            return Extract(0, len(text))
        return Extract(start, end, _note(text, start, end, scan, of_log=of_log))
    if not scan.open:
        return None
    start = scan.open[-1]
    fence = _FENCE.search(text, start)
    end = fence.start() if fence else len(text)
    if not of_log and end == len(text) and _AROUND.fullmatch(text, 0, start):
        return Extract(0, end)
    return Extract(start, end, _note(text, start, end, scan, of_log=of_log))


def _scan(text: str, limit: int) -> _Scan:
    scan, finder = _Scan(), Finder(text)
    pos = 0
    for _ in range(limit):
        skipped = _SKIP.match(text, pos)
        pos = skipped.end() if skipped else pos
        if pos >= len(text):
            break
        pos = _step(text, pos, finder, scan)
    if scan.think_from >= 0:
        _forget(scan, scan.think_from, len(text))
    return scan


def _step(text: str, pos: int, finder: Finder, scan: _Scan) -> int:
    """Take in what is at ``pos``; the offset after it."""
    for opening, closing in (("<!--", "-->"), ("<![CDATA[", "]]>")):
        if text.startswith(opening, pos):
            end = finder.find(closing, pos + len(opening))
            return pos + len(opening) if end < 0 else end + len(closing)
    think = _THINK.match(text, pos)
    if think:
        if not think[1]:
            scan.think_from = pos if scan.think_from < 0 else scan.think_from
        else:
            # Some models leave the opening <think> out: all before belongs to it.
            _forget(scan, max(scan.think_from, 0), think.end())
        return think.end()
    end_tag = _END.match(text, pos)
    if end_tag:
        if not _is_mention(text, pos, end_tag.end()) and scan.open:
            start = scan.open.pop()
            inner = text.find("<", start + 5, pos) >= 0 or not text[start:pos].partition(">")[2]
            (scan.complete if inner else scan.mentions).append((start, end_tag.end()))
        return end_tag.end()
    tag = _PLAN.match(text, pos)
    if tag is None:
        if text.startswith("<Plan", pos):
            scan.open.append(pos)
        return pos + 5
    if _is_mention(text, pos, tag.end()):
        return tag.end()
    if text.startswith("/>", tag.end() - 2):
        scan.complete.append((pos, tag.end()))
    else:
        scan.open.append(pos)
    return tag.end()


def _is_mention(text: str, start: int, end: int) -> bool:
    """True for `<Plan>` in backticks: prose that speaks about the tag."""
    return text[max(start - 1, 0) : start] == "`" == text[end : end + 1] and (
        text[max(start - 3, 0) : start] != "```"
    )


def _forget(scan: _Scan, start: int, end: int) -> None:
    """Drop the plans between ``start`` and ``end``: they were thought, not answered."""
    kept = [plan for plan in scan.complete if plan[0] < start]
    scan.thought += len(scan.complete) - len(kept)
    scan.complete = kept
    scan.mentions = [plan for plan in scan.mentions if plan[0] < start]
    scan.open = [place for place in scan.open if place < start]
    scan.thinks.append((start, end))
    scan.think_from = -1


def _note(text: str, start: int, end: int, scan: _Scan, *, of_log: bool) -> str:
    lines = Lines(text)
    first, last = lines.position(start)[0], lines.position(max(end - 1, start))[0]
    taken = f"took line {first}" if first == last else f"took lines {first} to {last}"
    left = [
        *(["the prefixes of a log"] if of_log else []),
        *_thinking(scan),
        *_prose(text, start, end, scan),
        *_earlier(scan, start),
    ]
    return f"{taken} of the answer as the plan; left out: {', '.join(left) or 'nothing else'}"


def _thinking(scan: _Scan) -> list[str]:
    if not scan.thinks:
        return []
    count = scan.thought
    plans = f" with {count:,} plan{'s' if count > 1 else ''} in it" if count else ""
    return [f"the model's reasoning{plans}"]


def _prose(text: str, start: int, end: int, scan: _Scan) -> list[str]:
    """The kinds of other text before and after the plan."""
    before = _without(text[:start], [*scan.thinks, *(p for p in scan.complete if p[1] <= start)])
    after = text[end:]
    kinds: list[str] = []
    commanded = _COMMAND.sub("", before)
    if commanded != before:
        kinds.append("a ros2 command")
        before = commanded
    fenced = declared = False
    for part, words in ((before, "text before the plan"), (after, "text after the plan")):
        bare = _FENCE.sub("", part)
        fenced |= bare != part
        plain = _DECLARATION.sub("", bare)
        declared |= plain != bare
        uncommented = _COMMENT.sub("", plain)
        if uncommented.strip(WHITE + "`"):
            kinds.append(words)
    if fenced or "```" in before or "```" in after:
        kinds.append("a Markdown fence")
    if declared:
        kinds.append("an XML declaration")
    return kinds


def _earlier(scan: _Scan, start: int) -> list[str]:
    count = sum(1 for plan in scan.complete if plan[1] <= start)
    return [f"{count:,} earlier plan{'s' if count > 1 else ''}"] if count else []


def _without(text: str, spans: list[tuple[int, int]]) -> str:
    """``text`` without the spans, which may overlap."""
    parts: list[str] = []
    pos = 0
    for start, end in sorted(spans):
        if start > pos:
            parts.append(text[pos:start])
        pos = max(pos, end)
    return "".join([*parts, text[pos:]])
