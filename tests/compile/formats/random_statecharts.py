"""Random statecharts of all that SCXML has without data, the odd things most."""

from __future__ import annotations

import random
import re

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


class EventfulChart(OddChart):
    """A statechart that raises and sends events, remembers states, and asks what is active.

    Events are drawn from a small set, so that those that are raised meet those that are waited
    for. Without ``data`` everything that it does is known: no expression, nothing that may fail.
    """

    EVENTS = ("a", "a", "b", "b.c", "c", "failed")

    def __init__(
        self, seed: int, size: int = 5, *, data: bool | None = None, sends: bool | None = None
    ) -> None:
        self.odd = random.Random(f"eventful {seed}")  # noqa: S311
        self.data = self.odd.choice((0.0, 0.3)) if data is None else 0.3 * data
        self.sends = self.odd.choice((0.0, 0.0, 0.2)) if sends is None else 0.2 * sends
        self.busy = self.odd.choice((0.15, 0.3, 0.5))
        self.remembers = self.odd.choice((0.0, 0.5, 0.9))
        self.asks = self.odd.choice((0.0, 0.2, 0.4))
        self.errors = self.odd.random() < 0.5
        self.histories: dict[str, str] = {}
        self.services: dict[str, str] = {}
        super().__init__(seed, size)

    def state(self, around: list[str], depth: int) -> str:
        name = super().state(around, depth)
        if self.bodies[name] and self.odd.random() < self.remembers:
            self.histories[f"{name}_h"] = name
        if self.odd.random() < self.sends / 2:
            self.services[name] = f"{name}_i"
        return name

    def event(self, name: str) -> str:
        odd = self.odd
        if odd.random() < 0.25:
            return super().event(name)
        words = [*self.EVENTS, "b.*", "*"]
        if self.errors and (self.data or self.sends):
            words += ["error", "error.execution", "error.communication", "error.*"]
        if self.services:
            words += [f"done.invoke.{odd.choice([*self.services.values()])}", "done.invoke"]
        return " ".join(odd.choice(words) for _ in range(odd.choice((1, 1, 1, 2))))

    def _conditions(self) -> list[str]:
        state = self.odd.choice(self.states)
        known = ["true", "false", f"In('{state}')", f"In('{state}')", f"In( '{state}' )"]
        number = self.odd.randint(0, 1)
        unknown = ["x == 3", f"{number} == 1", f"not In('{state}')", f"{number}"]
        return known + (unknown if self.data else [])

    def target(self, name: str) -> str:
        if self.histories and self.odd.random() < 0.3:
            return self.odd.choice([*self.histories])
        return super().target(name)

    def initial(self, inside: list[str], among: list[str]) -> str:
        around = self.around[inside[0]]
        if around and f"{around[-1]}_h" in self.histories and self.odd.random() < 0.3:
            return f' initial="{around[-1]}_h"'
        return super().initial(inside, among)

    # -- content ----------------------------------------------------------------------------

    def block(self, tag: str, attributes: str = "") -> str:
        """An element with executable content, or none."""
        content = self.content(2) if self.odd.random() < self.busy else ""
        if not content and tag in ("onentry", "onexit"):
            return ""
        return f"<{tag}{attributes}>{content}</{tag}>"

    def content(self, depth: int) -> str:
        return "".join(self.action(depth) for _ in range(self.odd.choice((1, 1, 2, 3))))

    def action(self, depth: int) -> str:
        odd = self.odd
        event = odd.choice(self.EVENTS)
        if depth and odd.random() < 0.2:
            return self.branches(depth - 1)
        if odd.random() < self.sends:
            return odd.choice(self._sends(event))
        if odd.random() < self.data:
            return odd.choice(self._doings(event, depth))
        if odd.random() < 0.1:
            return f'<send event="{event}" target="#_internal"/>'
        if odd.random() < 0.05:
            event = odd.choice(("error.execution", f"done.state.{odd.choice(self.states)}"))
        return f'<raise event="{event}"/>'

    def _sends(self, event: str) -> list[str]:
        rows = [f'<send event="{event}"/>', f'<send event="{event}" delay="1s"/>']
        if self.data:
            rows += [
                f'<send event="{event}"><param name="p" expr="x"/></send>',
                f'<send event="{event}" target="#_internal"><param name="p" expr="x"/></send>',
                f'<send event="{event}" namelist="x"/>',
                f"<send eventexpr=\"'{event}'\"/>",
                f'<send eventexpr="\'{event}\'" target="#_internal"/>',
            ]
        return rows

    def _doings(self, event: str, depth: int) -> list[str]:
        body = self.content(depth - 1) if depth else f'<raise event="{event}"/>'
        loop = f'<foreach array="[1, 2]" item="it" index="at">{body}</foreach>'
        return [
            '<assign location="x" expr="1"/>', "<script>1</script>", '<log expr="1"/>',
            '<log label="here"/>', '<cancel sendid="none"/>', '<log expr="x"/>', loop,
        ]  # fmt: skip

    def branches(self, depth: int) -> str:
        rows = [f'<if cond="{self.cond_text()}">{self.content(depth)}']
        if self.odd.random() < 0.4:
            rows.append(f'<elseif cond="{self.cond_text()}"/>{self.content(depth)}')
        if self.odd.random() < 0.5:
            rows.append(f"<else/>{self.content(depth)}")
        return "".join(rows) + "</if>"

    def cond_text(self) -> str:
        return self.odd.choice(self._conditions())

    # -- elements ---------------------------------------------------------------------------

    def transitions(self, name: str) -> list[str]:
        rows = []
        for each in super().transitions(name):
            text = re.sub(' cond="[^"]*"', "", each[len("<transition") : -len("/>")])
            if self.odd.random() < self.asks:
                text += f' cond="{self.cond_text()}"'
            rows.append(self.block("transition", text))
        return rows

    def history(self, name: str) -> list[str]:
        if f"{name}_h" not in self.histories:
            return []
        deep = self.odd.random() < 0.5
        inside = [each for each in self.states if name in self.around[each]]
        targets = inside if deep else self.bodies[name]
        way = self.block("transition", f' target="{self.odd.choice(targets)}"')
        kind = self.odd.choice(("", ' type="shallow"')) if not deep else ' type="deep"'
        return [f'<history id="{name}_h"{kind}>{way}</history>']

    def shown(self, name: str) -> str:
        tag, inside = self.tags[name], self.bodies[name]
        first, element = "", ""
        if inside and tag == "state":
            first = self.initial(inside, inside)
            if first and self.odd.random() < 0.5:
                way = self.block("transition", first.replace("initial", "target"))
                first, element = "", f"<initial>{way}</initial>"
        rows = [self.block(each) for each in ("onentry", "onentry", "onexit")]
        if name in self.services:
            rows.append(f'<invoke id="{self.services[name]}" src="service.scxml"/>')
        rows += [*self.history(name), *self.transitions(name), *map(self.shown, inside)]
        if tag == "final" and self.data and self.odd.random() < 0.3:
            rows.append('<donedata><param name="p" expr="x"/></donedata>')
        return f'<{tag} id="{name}"{first}>{element}' + "\n ".join(filter(None, rows)) + f"</{tag}>"


class ReturningChart(EventfulChart):
    """A statechart whose transitions often lead back: to their own state, around it, to histories.

    So what is left is entered again, or what is raised on the way in is raised again.
    """

    def __init__(self, seed: int, size: int = 5, *, data: bool | None = None) -> None:
        self.back = random.Random(f"returning {seed}")  # noqa: S311
        super().__init__(seed, size, data=data)

    def target(self, name: str) -> str:
        if self.back.random() < 0.5:
            return super().target(name)
        around = [*self.around[name], name]
        return self.back.choice([*around, *(h for h, of in self.histories.items() if of in around)])


def odder(text: str, seed: int) -> str:
    """A chart with the rare forms of what is in it: expressions for names, late data, scripts."""
    odd = random.Random(f"odder {seed}")  # noqa: S311

    def send(match: re.Match[str]) -> str:
        inward = 'target="#_internal"'
        other = ['targetexpr="t"', "targetexpr=\"'#_internal'\"", f'{inward} typeexpr="t"']
        other += [f'{inward} type="http"', f'{inward} delayexpr="d"', f'{inward} idlocation="i"']
        new = odd.choice([*other, inward, inward])
        if inward in match[0]:
            return match[0].replace(inward, new)
        end = "/>" if match[0].endswith("/>") else ">"
        return match[0].removesuffix(end) + odd.choice(["", "", f" {odd.choice(other)}"]) + end

    text = re.sub("<send [^>]*>", send, text)
    text = re.sub(
        r"In\('(\w+)'\)", lambda each: odd.choice((each[0], f"In(&quot;{each[1]}&quot;)")), text
    )
    kept = odd.choice(("", "", '<finalize><raise event="a"/></finalize>', "<finalize/>"))
    if kept:
        text = re.sub(r"(<invoke [^>]*)/>", lambda each: f"{each[1]}>{kept}</invoke>", text)
    data = odd.choice(('<data id="x" expr="y"/>', '<data id="x">text</data>', '<data id="x"/>'))
    if odd.random() < 0.3:
        state = odd.choice(("<onentry>", "<onexit>"))
        text = text.replace(state, f"<datamodel>{data}</datamodel>{state}", 1)
    head = odd.choice(("", "", f"<datamodel>{data}</datamodel>", "<script>x = 1</script>"))
    model = odd.choice(("", ' datamodel="null"', ' datamodel="python"', ' datamodel="ecmascript"'))
    late = odd.choice(("", ' binding="late"'))
    first = text.index(">")
    return f"{text[:first]}{model}{late}>{head}{text[first + 1 :]}"
