"""What the tests of the fixes share: what a plan means, and how plans get damaged."""

from __future__ import annotations

import re
from random import Random
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions
from gpsfsm.compile import compile_plan
from gpsfsm.fixing import fix_text
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.fixing import Fixed
    from gpsfsm.model.plan import Plan

__all__ = ["DAMAGES", "STEPS", "damaged", "fixed", "go", "meaning", "say"]


def go(x: float, y: float) -> str:
    name = "nav2_capabilities/WaypointRunner"
    return f'<Runner interface="{name}" provider="{name}" x="{x}" y="{y}"/>'


def say(text: str) -> str:
    name = "perception_capabilities/SpeechRunner"
    return f'<Runner interface="{name}" provider="{name}" text="{text}"/>'


STEPS = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<!-- Look after the hall. -->
<Plan name="hall">
    {go(2.0, -0.5)}
    <!-- The other door, if this one is shut. -->
    <Control type="recovery" name="other_door">
        {go(0.0, 2.0)}
    </Control>
    <Control type="parallel_all">
        {say("Fish &amp; chips &lt;fresh&gt; at the café.")}
        <Control type="sequential">
            {go(-2.0, 0.0)}
        </Control>
    </Control>
    {say("Good bye.")}
</Plan>
"""
"""A plan without errors: every damage below fits somewhere in it."""


def fixed(text: str | bytes, *, unsafe: bool = False, **options: object) -> Fixed:
    """The text after all fixes."""
    return fix_text(text, CheckOptions(**options), unsafe=unsafe)  # type: ignore[arg-type]


def meaning(text: str) -> tuple[object, ...]:
    """All that a plan says to an executor: its automaton with the actions of its nodes."""
    plan = parse(text).plan
    assert plan is not None, text
    automaton = compile_plan(plan).automaton
    nodes = tuple((node.kind, node.need) for node in automaton.nodes)
    return nodes, tuple(automaton.edges), _actions(plan)


def _actions(plan: Plan) -> tuple[object, ...]:
    return tuple((runner.action, runner.provider) for runner in plan.runners)


Damage = "Callable[[str, Random], str]"


def _at(pattern: str, replacement: str | Callable[[re.Match[str]], str]) -> Damage:
    """Damage one of the places where the pattern matches."""

    def damage(text: str, random: Random) -> str:
        matches = list(re.finditer(pattern, text))
        if not matches:
            return text
        match = random.choice(matches)
        new = match.expand(replacement) if isinstance(replacement, str) else replacement(match)
        return text[: match.start()] + new + text[match.end() :]

    return damage


def _everywhere(pattern: str, replacement: str) -> Damage:
    return lambda text, _: re.sub(pattern, replacement, text)


_SHORT = r'(\w+)="([\w.-]+)"'

DAMAGES: Mapping[str, Damage] = {
    "quotes left out": _at(_SHORT, r"\1=\2"),
    "typographic quotes": _at(_SHORT, "\\1=\u201c\\2\u201d"),
    "backslashes": _at(_SHORT, r'\1=\\"\2\\"'),
    "two equals signs": _at(_SHORT, r'\1=="\2"'),
    "no equals sign": _at(_SHORT, r'\1"\2"'),
    "no blank between": _at(r'" (x|y|provider|name)=', r'"\1='),
    "a comma between": _at(r'" (x|y|provider|name)=', r'", \1='),
    "closing quote left out": _at(r'(x|y|name|type)="([\w.-]+)"', r'\1="\2'),
    "repeated attribute": _at(_SHORT, r'\1="\2" \1="\2"'),
    "blank after less": _at(r"<(?=[PCR/])", "< "),
    "runner left open": _at(r"(<Runner [^>]*)/>", r"\1>"),
    "blank in the slash": _at(r"/>", "/ >"),
    "greater left out": _at(r"(<Runner [^>]*)/>(?=\s*<)", r"\1"),
    "lone ampersand": _everywhere("&amp;", "&"),
    "lone less": _everywhere("&lt;", "<"),
    "no semicolon": _everywhere("&lt;", "&lt"),
    "unknown entity": _everywhere("é", "&eacute;"),
    "end tag misspelt": _at("</Control>", "</control>"),
    "end tag of a runner": _at(r"(<Runner [^>]*/>)", r"\1</Runner>"),
    "declaration later": lambda text, _: "\n\n" + text,
    "declaration malformed": _everywhere(r"<\?xml", "<!xml"),
    "a DOCTYPE": _at(r"<Plan", '<!DOCTYPE Plan SYSTEM "plan.dtd">\n<Plan'),
    "a fence": lambda text, _: f"```xml\n{text}```\n",
    "prose": lambda text, _: f"Sure! Here is the plan:\n\n{text}\nHave a nice day.\n",
    "prose and a fence": lambda text, _: f"Here:\n```\n{text}```\nThis plan goes to the hall.\n",
    "lower case": lambda text, _: re.sub("(</?)Plan", r"\1plan", text),
    "upper case": lambda text, _: re.sub("(</?)Control", r"\1CONTROL", text),
    "near name": lambda text, _: re.sub("<Runner", "<Runer", text),
    "prefix": lambda text, _: re.sub("(</?)(Plan|Control|Runner)", r"\1p:\2", text),
    "name space": _at("<Plan", '<Plan xmlns="http://example.org/plan"'),
    "capital type": _at(r'type="(\w)', lambda match: f'type="{match[1].upper()}'),
    "dash in type": _everywhere("parallel_all", "parallel-all"),
    "near type": _everywhere('"sequential"', '"sequencial"'),
    "name instead of type": _at(r'type="(\w+)">', r'name="\1">'),
    "old elements": lambda text, _: re.sub("<Runner interface=", "<Event name=", text),
    "near attribute": _at("provider=", "provder="),
    "capital attribute": _at("interface=", "Interface="),
    "attribute without effect": _at("<Plan", '<Plan ID="MainTree" speed="3"'),
    "note between steps": _at(r"(?<=\n)    <Runner", "    first of all:\n    <Runner"),
    "control character": _at("Good", "Go\x0bod"),
    "explicit completion": _at(
        "</Plan>",
        '    <Runner interface="fabric_capabilities/FabricCompletionRunner" '
        'provider="fabric_capabilities/FabricCompletionRunner"/>\n</Plan>',
    ),
    "package": _everywhere("nav2_capabilities", "navigation_capabilities"),
    "near interface": _at("nav2_capabilities/WaypointRunner", "nav2_capabilities/WayPointRuner"),
    "packed": _at(r'x="([^"]*)" y="([^"]*)"', r'position="\1, \2"'),
    "near parameter": _at("text=", "Text="),
    "dashes in a comment": _at("<!-- Look", "<!-- Look --"),
    "CR LF": _everywhere("\n", "\r\n"),
}
"""What language models do to plans, by name; a fix gives each plan its meaning back."""


def damaged(name: str, text: str, seed: int) -> str:
    """``text`` with one of the damages, at a place that the seed chooses."""
    return DAMAGES[name](text, Random(seed))  # noqa: S311  (chooses places, keeps no secrets)
