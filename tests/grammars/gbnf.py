"""GBNF as llama.cpp reads it, written from its rules: a strict reader and a recogniser.

Stricter than the engines that are installed: names without underscores, few escapes, bounded
repetitions, no left recursion. A text is matched as llama.cpp does it, with a set of stacks.
"""

from __future__ import annotations

import re
from typing import NamedTuple

__all__ = ["Gbnf"]

_NAME = re.compile(r"[A-Za-z0-9-]+")
_BLANK = re.compile(r"(?:[ \t]|#[^\r\n]*)*")
_BLANKS = re.compile(r"(?:[ \t\r\n]|#[^\r\n]*)*")
_HEX = {"x": 2, "u": 4, "U": 8}
_PLAIN = {"t": "\t", "r": "\r", "n": "\n", "\\": "\\", '"': '"', "[": "[", "]": "]"}
_REPEAT = re.compile(r"([*+?])|\{([0-9]+)(?:(,)([0-9]*))?\}")
_MOST_REPEATED = 2000


class Chars(NamedTuple):
    """One character: of these ranges, or of none of them."""

    negated: bool
    ranges: tuple[tuple[str, str], ...]

    def fits(self, char: str) -> bool:
        return any(low <= char <= high for low, high in self.ranges) is not self.negated


Part = Chars | str
Alternatives = list[list[Part]]
Stack = tuple[tuple[Part, ...], "Stack"] | None


class Gbnf:
    """A grammar. Raises ValueError for what llama.cpp would not read."""

    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0
        self._rules: dict[str, Alternatives] = {}
        self._names: set[str] = set()
        self._skip(_BLANKS)
        while self._at < len(text):
            self._rule()
            self._skip(_BLANKS)
        missing = (self._names | {"root"}) - set(self._rules)
        if missing:
            raise ValueError(f"undefined: {missing}")
        for name in self._rules:
            self._refuse_left_recursion(name, ())

    def accepts(self, text: str) -> bool:
        """Whether the text is a sentence."""
        stacks = self._expanded([(("root",), None)])
        for char in text:
            stacks = self._expanded(
                [
                    (stack[0][1:], stack[1])
                    for stack in stacks
                    if stack and isinstance(stack[0][0], Chars) and stack[0][0].fits(char)
                ]
            )
        return None in stacks

    def _expanded(self, stacks: list[Stack]) -> set[Stack]:
        """Stacks with a character on top; None is the end."""
        reached: set[Stack] = set()
        seen: set[Stack] = set()
        while stacks:
            stack = stacks.pop()
            while stack is not None and not stack[0]:
                stack = stack[1]
            if stack in seen:
                continue
            seen.add(stack)
            if stack is None or isinstance(stack[0][0], Chars):
                reached.add(stack)
                continue
            rest, below = stack[0][1:], stack[1]
            under = (rest, below) if rest else below
            stacks += [(tuple(one), under) for one in self._rules[stack[0][0]]]
        return reached

    def _refuse_left_recursion(self, name: str, above: tuple[str, ...]) -> None:
        if name in above:
            raise ValueError(f"left recursion in {name}")
        for one in self._rules[name]:
            if one and isinstance(one[0], str):
                self._refuse_left_recursion(one[0], (*above, name))

    # --- reading ---------------------------------------------------------------------------------

    def _skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self._text, self._at)
        assert match is not None
        self._at = match.end()

    def _sees(self, text: str) -> bool:
        return self._text.startswith(text, self._at)

    def _take(self, text: str) -> None:
        if not self._sees(text):
            raise ValueError(f"{text!r} expected at {self._text[self._at : self._at + 40]!r}")
        self._at += len(text)

    def _word(self) -> str:
        match = _NAME.match(self._text, self._at)
        if match is None:
            raise ValueError(f"name expected at {self._text[self._at : self._at + 40]!r}")
        self._at = match.end()
        return match[0]

    def _rule(self) -> None:
        name = self._word()
        self._skip(_BLANK)
        self._take("::=")
        self._skip(_BLANKS)
        if name in self._rules:
            raise ValueError(f"{name} twice")
        self._rules[name] = self._alternatives(_BLANK)
        if self._at < len(self._text):
            self._take("\n")

    def _alternatives(self, blank: re.Pattern[str]) -> Alternatives:
        sequences = [self._sequence(blank)]
        while self._sees("|"):
            self._at += 1
            self._skip(_BLANKS)
            sequences.append(self._sequence(blank))
        return sequences

    def _sequence(self, blank: re.Pattern[str]) -> list[Part]:
        parts: list[Part] = []
        while True:
            if self._sees('"'):
                item: list[Part] = [Chars(False, ((each, each),)) for each in self._literal()]
            elif self._sees("["):
                item = [self._class()]
            elif self._sees("("):
                self._at += 1
                self._skip(_BLANKS)
                item = [self._new(self._alternatives(_BLANKS))]
                self._take(")")
            elif _NAME.match(self._text, self._at):
                item = [self._word()]
                self._names.add(str(item[0]))
            else:
                return parts
            self._skip(blank)
            if repeat := _REPEAT.match(self._text, self._at):
                self._at = repeat.end()
                item = self._repeated(item, repeat)
                self._skip(blank)
            parts += item

    def _repeated(self, item: list[Part], repeat: re.Match[str]) -> list[Part]:
        least, most = {"*": (0, None), "+": (1, None), "?": (0, 1)}.get(repeat[1], (0, None))
        if not repeat[1]:
            least = int(repeat[2])
            most = least if not repeat[3] else int(repeat[4]) if repeat[4] else None
        if max(least, most or 0) >= _MOST_REPEATED:
            raise ValueError("too many repetitions")
        if most is None:
            again = self._new([[]])
            self._rules[again] = [[*item, again], []]
            return [*item * least, again]
        inner: list[Part] = []
        for _ in range(most - least):
            inner = [self._new([[*item, *inner], []])]
        return [*item * least, *inner]

    def _new(self, alternatives: Alternatives) -> str:
        name = f"({len(self._rules)}"  # no name that could be written
        self._rules[name] = alternatives
        return name

    def _literal(self) -> str:
        self._at += 1
        items = []
        while not self._sees('"'):
            items.append(self._char())
        self._at += 1
        return "".join(items)

    def _class(self) -> Chars:
        self._at += 1
        negated = self._sees("^")
        self._at += negated
        ranges = []
        while not self._sees("]"):
            low = high = self._char()
            if self._sees("-") and not self._sees("-]"):
                self._at += 1
                high = self._char()
            ranges.append((low, high))
        self._at += 1
        return Chars(negated, tuple(ranges))

    def _char(self) -> str:
        if self._at >= len(self._text):
            raise ValueError("unexpected end")
        char = self._text[self._at]
        self._at += 1
        if char != "\\":
            return char
        escape = self._text[self._at : self._at + 1]
        self._at += 1
        if escape not in _HEX:
            if escape not in _PLAIN:
                raise ValueError(f"unknown escape \\{escape}")
            return _PLAIN[escape]
        digits = self._text[self._at : self._at + _HEX[escape]]
        if not re.fullmatch(rf"[0-9A-Fa-f]{{{_HEX[escape]}}}", digits):
            raise ValueError(f"\\{escape} wants {_HEX[escape]} digits")
        self._at += _HEX[escape]
        return chr(int(digits, 16))
