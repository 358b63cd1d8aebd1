"""What stands where it must not: text, unknown elements, elements after the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.finding import Related
from gpsfsm.syntax.chars import SPACED_TAG, WHITE, clip, strip
from gpsfsm.syntax.frames import Frame, Inside
from gpsfsm.syntax.references import decode
from gpsfsm.syntax.tokens import Fault, StartTag, TextRun
from gpsfsm.syntax.words import unknown_element

if TYPE_CHECKING:
    from gpsfsm.syntax.collector import Collector

__all__ = ["Strays", "TextResult"]

_MAX_RELATED = 20
_LONG = 65_536
_RESPONSE = "remove it; --from-response takes the plan out of a model's answer"


class TextResult(NamedTuple):
    """What a text means for the whole: see ``TreeBuilder``."""

    broken: bool = False
    fatal: bool = False


class _Unknown:
    """An unknown name of elements: its first place, and the others."""

    __slots__ = ("attributes", "count", "path", "related", "start")

    def __init__(self, start: int, path: str, attributes: list[str]) -> None:
        self.start, self.path, self.attributes = start, path, attributes
        self.related: list[Related] = []
        self.count = 1


class Strays:
    """Collects strays; ``report`` tells those that need the whole text to be judged."""

    def __init__(self, text: str, collector: Collector) -> None:
        self._text, self._collector = text, collector
        self._unknown: dict[str, _Unknown] = {}
        self._outside: list[TextRun] = []
        self._extra: list[tuple[int, str]] = []

    # ---- elements --------------------------------------------------------------------------

    def unknown_element(self, tag: StartTag, path: str) -> None:
        """An element that no plan has; reported once per name."""
        known = self._unknown.get(tag.name)
        if known is None:
            names = [attribute.name for attribute in tag.attributes]
            self._unknown[tag.name] = _Unknown(tag.start, path, names)
            return
        known.count += 1
        if len(known.related) < _MAX_RELATED:
            known.related.append(Related(self._collector.location(tag.start, path), "another"))

    def extra_root(self, start: int, name: str) -> None:
        """An element after the outermost one."""
        if len(self._extra) < _MAX_RELATED:
            self._extra.append((start, name))

    # ---- text ------------------------------------------------------------------------------

    def text(self, run: TextRun, frame: Frame | None) -> TextResult:
        """Text that is not blank as it is written; ``frame`` is the element around it."""
        if frame is None:
            if len(self._outside) <= 10 * _MAX_RELATED:
                self._outside.append(run)
            return TextResult(broken=True)
        faults = self._faults(run)
        unclosed = run.cdata and bool(run.faults)
        if not faults and self._is_blank(run):
            return TextResult()
        frame.filled = True
        spaced = not run.cdata and any(SPACED_TAG.match(self._text, f.start) for f in run.faults)
        if spaced:
            faults = [fault._replace(hint="remove the blanks after '<'") for fault in faults]
        if unclosed or spaced or (faults and frame.inside in (Inside.OTHER, Inside.QUIET)):
            self._collector.add_faults(faults, frame.path)
        elif frame.inside is Inside.RUNNER:
            if frame.content is None:
                shown = f"the text: {self._shown(run)}"
                frame.content = (run.start, self._first_line(run), shown)
        elif frame.inside is Inside.PLAN:
            self._stray(run, frame.path, f"text is not allowed in <{frame.tag}>", "remove it")
        return TextResult(broken=bool(faults), fatal=unclosed or spaced)

    def _faults(self, run: TextRun) -> list[Fault]:
        """What makes the text not well-formed."""
        if run.cdata:
            return run.faults
        faults = list(run.faults)
        # Of a long text the beginning is enough: it is an error in any case.
        raw = self._text[run.start : min(run.end, run.start + _LONG)]
        decode(raw, run.start, faults)
        found = raw.find("]]>")
        if found >= 0:
            message = "']]>' is not allowed in text"
            faults.append(Fault(run.start + found, 3, message, "write ']]&gt;', or remove it"))
        return faults

    def _is_blank(self, run: TextRun) -> bool:
        raw = self._text[run.start : run.end]
        if run.cdata:
            return not strip(raw[9:-3])
        # Text is not blank as written, so it can only be blank by references such as &#32;
        return raw[0] == "&" and len(raw) <= _LONG and not strip(decode(raw, 0, []))

    def _shown(self, run: TextRun) -> str:
        return clip(self._text[run.start : min(run.end, run.start + 200)])

    def _first_line(self, run: TextRun) -> int:
        return min(run.end - run.start, self._collector.lines.rest(run.start))

    def _stray(self, run: TextRun, path: str, what: str, hint: str) -> None:
        message = f"{what}: {self._shown(run)}"
        length = min(self._first_line(run), len(self._text[run.start : run.end].rstrip(WHITE)))
        if "```" in self._text[run.start : run.end]:
            hint = _RESPONSE
        self._collector.add("GP108", run.start, length, message=message, hint=hint, element=path)

    # ---- at the end ------------------------------------------------------------------------

    def report(self, *, outside: bool) -> None:
        """Report what was kept; text and elements around the plan only if ``outside``."""
        for tag, found in self._unknown.items():
            if self._collector.full("GP105"):
                self._collector.count("GP105")
            else:
                self._report_unknown(tag, found)
        if outside:
            for run in self._outside:
                self._stray(run, "", "text is not allowed around the plan", _RESPONSE)
            self._report_extra()

    def _report_unknown(self, tag: str, found: _Unknown) -> None:
        times = f" ({found.count:,} times)" if found.count > 1 else ""
        message = f"<{clip(tag)}> is not an element of a plan{times}"
        if tag == "Plan":
            message = f"a <Plan> must not stand inside a plan{times}"
        hint = unknown_element(tag, found.attributes)
        if tag == "Plan":
            hint = 'write <Control type="sequential"> instead, or leave the inner <Plan> out'
        self._collector.add(
            "GP105",
            found.start,
            1 + len(tag),
            message=message,
            hint=hint,
            element=found.path,
            related=found.related,
        )

    def _report_extra(self) -> None:
        if not self._extra:
            return
        start, name = self._extra[0]
        self._collector.add(
            "GP101",
            start,
            1 + len(name),
            message=f"a plan text holds one <Plan>; <{clip(name)}> stands after its end",
            hint="move it into the plan, or keep one plan per file; " + _RESPONSE[11:]
            if name == "Plan"
            else "move it into the plan or remove it",
            related=[
                Related(self._collector.location(offset), f"<{clip(other)}>")
                for offset, other in self._extra[1:]
            ],
        )
