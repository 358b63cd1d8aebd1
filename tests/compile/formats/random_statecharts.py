"""Random statecharts of all that SCXML has without data, the odd things most."""

from __future__ import annotations

import random

HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0"'


class OddChart:
    """A statechart of a few states that share a few events."""

    def __init__(self, seed: int, size: int = 7) -> None:
        self.chance = random.Random(seed)  # noqa: S311
        self.left = size
        self.states: list[str] = []
        self.bodies: dict[str, list[str]] = {}
        self.around: dict[str, list[str]] = {}
        self.tags: dict[str, str] = {}
        # What a chart has none of lets other things show.
        self.eventless = self.chance.choice((0.0, 0.0, 0.15, 0.3))
        self.cond = self.chance.choice((0.0, 0.0, 0.2, 0.4))
        self.own = self.chance.random() < 0.5  # events of its own for each state
        self.kinds = self.chance.choice(
            (("state",), ("state", "state", "compound"), ("state", "compound", "parallel"))
        )
        top = [self.state([], 0) for _ in range(self.chance.randint(1, 3))]
        top += [self.final([], name) for name in ("ok", "failed")]
        self.text = f"{HEAD}{self.initial(top, top)}>\n" + "\n".join(map(self.shown, top))
        self.text += "\n</scxml>"

    def final(self, around: list[str], name: str) -> str:
        self.tags[name], self.bodies[name], self.around[name] = "final", [], around
        self.states.append(name)
        return name

    def state(self, around: list[str], depth: int) -> str:
        name = f"s{len(self.states)}"
        self.states.append(name)
        self.left -= 1
        kind = self.chance.choice(self.kinds) if depth < 3 and self.left > 0 else "state"
        self.around[name], self.bodies[name] = around, []
        self.tags[name] = "parallel" if kind == "parallel" else "state"
        inner = [*around, name]
        if kind == "compound":
            self.bodies[name] = [self.state(inner, depth + 1)]
            while self.left > 0 and self.chance.random() < 0.5:
                self.bodies[name].append(self.state(inner, depth + 1))
            if self.chance.random() < 0.7:
                self.bodies[name].append(self.final(inner, f"{name}_end"))
        elif kind == "parallel":
            self.bodies[name] = [self.region(inner, depth) for _ in range(2)]
        return name

    def region(self, around: list[str], depth: int) -> str:
        if self.chance.random() < 0.3:
            return self.state(around, depth + 1)
        name = f"s{len(self.states)}"
        self.states.append(name)
        self.tags[name], self.around[name] = "state", around
        inner = [*around, name]
        self.bodies[name] = [self.state(inner, depth + 1), self.final(inner, f"{name}_end")]
        return name

    def initial(self, inside: list[str], among: list[str]) -> str:
        if self.chance.random() < 0.5:
            return ""
        within = [each for each in self.states if set(self.around[each]) & set(inside)]
        chosen = self.chance.choice([*among, *within] if self.chance.random() < 0.5 else among)
        return f' initial="{chosen}"'

    def event(self, name: str) -> str:
        chance = self.chance
        words = ["a", "a", "b", "b.c", "failed", "b.failed", "*", "a.*", "done", "done.state", "."]
        words += [f"done.state.{chance.choice(self.states)}", "a.b", "c"]
        if self.own or chance.random() < 0.3:
            words = [f"{name}.x", f"{name}.y", f"{name}.failed", name]
        picked = [chance.choice(words) for _ in range(chance.choice((1, 1, 1, 2)))]
        return " ".join(each for each in picked if each != ".") or "d"

    def transitions(self, name: str) -> list[str]:
        chance, rows = self.chance, []
        for _ in range(chance.choice((0, 1, 1, 2, 2, 3)) if self.tags[name] != "final" else 0):
            event = "" if chance.random() < self.eventless else f' event="{self.event(name)}"'
            if self.bodies[name] and event and chance.random() < 0.4:
                event = f' event="done.state.{name}"'
            cond = f' cond="x == {chance.randint(0, 9)}"' if chance.random() < self.cond else ""
            kind = ' type="internal"' if chance.random() < 0.15 else ""
            target = f' target="{self.target(name)}"' if chance.random() < 0.9 or not event else ""
            rows.append(f"<transition{event}{cond}{kind}{target}/>")
        return rows

    def target(self, name: str) -> str:
        if self.chance.random() < 0.35:
            return self.chance.choice(("ok", "ok", "failed"))
        target = self.chance.choice(self.states)
        if self.chance.random() < 0.2:  # several, in different regions
            other = self.chance.choice(self.states)
            here, there = [*self.around[target], target], [*self.around[other], other]
            same = [one for one, two in zip(here, there, strict=False) if one == two]
            regions = same and self.tags[same[-1]] == "parallel" and target != other
            if regions and len(same) < min(len(here), len(there)):
                return f"{target} {other}"
        return target

    def shown(self, name: str) -> str:
        tag, inside = self.tags[name], self.bodies[name]
        first, element = "", ""
        if inside and tag == "state":
            first = self.initial(inside, inside)
            if first and self.chance.random() < 0.3:
                element = f"<initial><transition{first.replace('initial', 'target')}/></initial>"
                first = ""
        rows = [*self.transitions(name), *map(self.shown, inside)]
        return f'<{tag} id="{name}"{first}>{element}' + "\n ".join(rows) + f"</{tag}>"
