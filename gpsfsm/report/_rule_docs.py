"""Rules documented in Markdown: ``docs/rules`` and ``gpsfsm explain --format markdown``."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import says_no_verdict
from gpsfsm.model.finding import Confidence
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.analysis.rules import Rule

_FAMILIES = {
    "GP1": "Plan text",
    "GP2": "Capabilities",
    "GP3": "Control flow",
    "GP4": "Data flow",
    "GP5": "Resources and time",
    "GP6": "Tasks",
    "GP7": "Engines",
    "GP8": "Behaviour trees",
    "GP9": "The check itself",
}
_CLIP = 4000
"""An example may be long (an attribute over the limit); nobody reads more than this of it."""


def rule_markdown(rule: Rule) -> str:
    """The page of one rule."""
    return "\n".join(_page(rule))


def rules_index_markdown(rules: Iterable[Rule]) -> str:
    """The page that lists all rules, by family."""
    lines = [
        "# Rules",
        "",
        "`gpsfsm explain GP302` shows a page of these in the terminal.",
    ]
    family = ""
    for rule in rules:
        if rule.code[:3] != family:
            family = rule.code[:3]
            lines += ["", f"## {family}xx: {_FAMILIES.get(family, family)}", ""]
            lines += ["| Code | Name | Severity | What it finds |", "|---|---|---|---|"]
        summary = _plain(rule.summary)
        lines.append(
            f"| [{rule.code}]({rule.code}.md) | {rule.name} | {rule.severity.value} | {summary} |"
        )
    return "\n".join(lines) + "\n"


def example_command(rule: Rule) -> str:
    """The command line under which the rule finds something in its example."""
    kinds = {"{": "machine.json", "<root": "tree.xml"}
    file = next((name for begin, name in kinds.items() if rule.bad.startswith(begin)), "plan.xml")
    return shlex.join(["gpsfsm", "check", *map(printable, rule.options), file])


def visible(text: str) -> str:
    """An example without characters that a reader could not see, and not endlessly long."""
    if not text.strip():
        return "(no plan triggers it by itself)"
    clipped = text if len(text) <= _CLIP else text[:_CLIP] + "…"
    return "\n".join(printable(line.replace("\t", "    ")) for line in clipped.rstrip().split("\n"))


def _page(rule: Rule) -> Iterator[str]:
    yield f"# {rule.code} {rule.name}"
    yield ""
    severity = f"Severity: {rule.severity.value}."
    if rule.severities:
        severity += f" In detail: {_sentence(rule.severities)}"
    yield severity
    if rule.confidence is Confidence.HEURISTIC:
        yield ""
        yield "Confidence: heuristic. The rule guesses the intent of the plan."
    yield from ("", "## What it finds", "", _sentence(rule.summary))
    yield from ("", "## Why it matters", "", _sentence(rule.why))
    yield from ("", "## Example", "")
    if rule.bad.strip():
        yield from (f"`{example_command(rule)}` finds it here:", "")
        yield from _code(rule.bad)
        yield from ("", "and nothing here:", "")
    else:
        yield from ("No plan triggers it by itself. It finds nothing here:", "")
    yield from _code(rule.good)
    yield from ("", "## What to do", "", _sentence(rule.fix), "")
    if says_no_verdict(rule.code):
        yield "It cannot be ignored, because it explains why there is no verdict."
    else:
        comment = f"<!-- gpsfsm: ignore {rule.code} because … -->"
        yield f"To suppress it in one place, put `{comment}`, with a reason,"
        yield "before the element, and let such comments count with `--allow-suppressions`. To"
        yield f"ignore it everywhere, use `--ignore {rule.code}`."
    yield ""


def _sentence(text: str) -> str:
    """As Markdown, with a capital letter and a full stop; "gpsfsm" stays as it is."""
    first = text if text.startswith("gpsfsm") else text[:1].upper() + text[1:]
    return _plain(first if first.endswith((".", "!", "?")) else first + ".")


def _plain(text: str) -> str:
    """Text in which ``<Control>`` and ``*.xml`` stay what they are, also outside of backticks."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"[<*|]", r"\\\g<0>", part) for part in parts[::2]]
    return "`".join(parts)


def _code(text: str) -> Iterator[str]:
    """A code block that its content cannot end."""
    ticks = max((len(run) for run in re.findall("`+", text)), default=0)
    fence = "`" * max(3, ticks + 1)
    yield fence + ("json" if text.startswith("{") else "xml")
    yield visible(text)
    yield fence
