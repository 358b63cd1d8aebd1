"""Random files of YASMIN, with whatever its factory reads, refuses or passes over."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import quoteattr

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_POOL = ("ok", "done", "next", "failed", "aborted", "timeout")
_PARALLEL = ("Concurrence", "OrthogonalState")
_EXTRAS = (
    '<Remap old="a" new="b"/>',
    '<ParamRemap old="a" new="b"/>',
    '<Param name="p" default_type="int" default_value="3"/>',
    '<Key name="k" type="in/out" default_value="x"/>',
    '<Default key="k" value="1" type="int"/>',
)


class Part(NamedTuple):
    """A state with its outcomes; its element has neither transitions nor its end yet."""

    name: str
    tag: str
    text: str
    outcomes: tuple[str, ...]


class YasminMachine:
    """A file; ``text`` is what is in it."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)  # noqa: S311
        self.states = 0
        self.left = self.chance.randint(2, 9)  # leaves
        complete = ' gpsfsm:complete="true"' if self._may(0.25) else ""
        prefixes = f'xmlns:gpsfsm="urn:gpsfsm" xmlns:x="urn:x"{complete}'
        root = self._machine("StateMachine", "Top", self._outcomes(), 0, prefixes)
        self.text = f"{root.text}\n</StateMachine>\n"

    def _may(self, share: float) -> bool:
        return self.chance.random() < share

    def _outcomes(self, more: Iterable[str] = ()) -> tuple[str, ...]:
        pool = [*_POOL, *more]
        return tuple(self.chance.sample(pool, self.chance.randint(1, 3)))

    def _names(self, most: int) -> list[str]:
        count = self.chance.randint(1, most)
        self.states += count
        return [f"S{self.states - number}" for number in reversed(range(count))]

    # -- states -----------------------------------------------------------------------------

    def _part(self, name: str, depth: int, more: Sequence[str]) -> Part:
        tags = ["State"] * (4 if depth < 3 else 9)
        if self.left > 1 and depth < 3:
            tags += ["StateMachine", "Concurrence", "Concurrence", "OrthogonalState"]
        tag = self.chance.choice(tags)
        if tag == "StateMachine":
            return self._machine(tag, name, self._outcomes(more), depth + 1)
        if tag != "State":
            return self._concurrence(tag, name, depth + 1, more)
        self.left -= 1
        if self._may(0.02):
            return Part(name, "JoinState", f'<JoinState name="{name}" sync_id="s">', ("joined",))
        if self._may(0.08):
            return self._elsewhere("StateMachine", name)
        kind = self.chance.choice(('type="py" module="m"', 'type="cpp"'))
        outcomes = self._outcomes() if self._may(0.9) else ()
        text = f'<State name="{name}" {kind} class="{name}">{self._extras()}'
        return Part(name, "State", text, outcomes)

    def _elsewhere(self, tag: str, name: str) -> Part:
        place = self.chance.choice(('file_path="x.xml"', 'file_name="x.xml" package="p"'))
        body = '<State name="X"/>' if self._may(0.3) else ""
        return Part(name, tag, f'<{tag} name="{name}" {place}>{body}', self._outcomes())

    def _extras(self) -> str:
        extra = "".join(each for each in _EXTRAS if self._may(0.05))
        return extra + ('<x:State name="other"/>' if self._may(0.03) else "")

    # -- machines and regions ---------------------------------------------------------------

    def _machine(
        self, tag: str, name: str, outcomes: tuple[str, ...], depth: int, more: str = ""
    ) -> Part:
        names = self._names(4 if depth < 2 else 2)
        parts = [self._part(each, depth, (*names, *outcomes)) for each in names]
        start = self.chance.choice((*names, *[names[0]] * 9)) if self._may(0.15) else ""
        body = "".join(self._in_machine(parts, number, outcomes) for number in range(len(parts)))
        attributes = f'name="{name}" outcomes="{" ".join(outcomes)}" {more}'
        attributes += f' start_state="{start}"' if start else ""
        final = "".join(f'<FinalOutcome name="{each}"/>' for each in outcomes if self._may(0.1))
        return Part(name, tag, f"\n<{tag} {attributes}>{self._extras()}{body}{final}", outcomes)

    def _in_machine(self, parts: list[Part], number: int, outcomes: tuple[str, ...]) -> str:
        part = parts[number]
        names = [each.name for each in parts]
        rows = [(each, self.chance.choice((*names, *outcomes))) for each in part.outcomes if each]
        on = number + 1 < len(parts) and self._may(0.97)  # YASMIN wants all to be reached
        if on:
            rows[:1] = [(rows[0][0] if rows else "ok", parts[number + 1].name)]
        if part.tag not in ("State", "JoinState"):
            # what has no transition leads to the outcome or state of its name, if there is one
            named = {*names, *outcomes}
            rows = rows[:on] + [
                row for row in rows[on:] if not self._may(0.5 if row[0] in named else 0.01)
            ]
        if rows and self._may(0.05):
            rows.append((rows[0][0], self.chance.choice(names)))  # the last one counts
        inner = "".join(f'<Transition from="{a}" to="{b}"/>' for a, b in rows)
        return f"\n{part.text}{inner}</{part.tag}>"

    # -- concurrences -----------------------------------------------------------------------

    def _concurrence(self, tag: str, name: str, depth: int, more: Sequence[str]) -> Part:
        parts = []
        for each in self._names(3):
            if tag == "Concurrence":
                parts.append(self._part(each, max(depth, 2), ()))
            elif self._may(0.05):
                parts.append(self._elsewhere("Region", each))
            else:
                parts.append(self._machine("Region", each, self._outcomes(), depth))
        ends = self._outcomes(more)
        maps = "".join(self._map(parts, each) for each in ends)
        maps += self._map(parts, ends[0]) if self._may(0.05) else ""  # the last one counts
        default = self.chance.choice(("", self.chance.choice(ends), self.chance.choice(_POOL)))
        body = "".join(f"\n{each.text}{self._ignored()}</{each.tag}>" for each in parts)
        attributes = f'name="{name}"' + (
            f" default_outcome={quoteattr(default)}" if default else ""
        )
        attributes += ' outcomes="ok failed never"' if self._may(0.1) else ""
        text = f"\n<{tag} {attributes}>{body}{maps}"
        return Part(name, tag, text, tuple(dict.fromkeys((*ends, default))))

    def _ignored(self) -> str:
        return '<Transition from="ok" to="failed"/>' if self._may(0.05) else ""

    def _map(self, parts: list[Part], outcome: str) -> str:
        items = [
            (each.name, self.chance.choice(names))
            for each in parts
            for names in [[name for name in each.outcomes if name] or ["ok"]]
            if each.tag in ("State", "JoinState") or each.outcomes
        ]
        chosen = [item for item in items if self._may(0.6)] or [self.chance.choice(items)]
        if self._may(0.02):
            chosen.append((chosen[0][0], "ok"))  # the last one counts
        old = self._may(0.2)
        tag = "Transition" if old else "Item"
        rows = "".join(f'<{tag} state="{a}" outcome="{b}"/>' for a, b in chosen)
        if old:
            noise = ' outcome="ok"' if self._may(0.1) else ""
            return f'<Outcome to="{outcome}"{noise}>{rows}</Outcome>'
        return f'<OutcomeMap outcome="{outcome}">{rows}</OutcomeMap>'
