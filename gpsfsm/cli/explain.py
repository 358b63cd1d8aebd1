"""``gpsfsm explain``: what a rule finds, why that matters, and what to do."""

from __future__ import annotations

import difflib
import json
import textwrap
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import Command, Section, complete_rules
from gpsfsm.cli._options import format_option, words
from gpsfsm.errors import UsageError
from gpsfsm.streams import form_of, terminal_width, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.rules import Rule

_MAX_WIDTH = 100
_MAX_HINTS = 3


@click.command(
    "explain",
    cls=Command,
    section=Section.CHECK,
    aliases=("rule",),
    short_help="Explain a rule: what it finds, why, what to do.",
)
@click.argument("rules", nargs=-1, metavar="[CODE|NAME]…", shell_complete=complete_rules)
@format_option("text", "markdown", "json", text="Output format.")
def command(rules: Sequence[str], output_format: str) -> int:
    r"""Explain rules by code or name: what each finds, why it matters, what to do.

    Without a rule, list all of them; with a prefix such as GP3, its family.

    \b
    Examples:
      gpsfsm explain GP303
      gpsfsm explain join-deadlock dangling-failure
    """
    names = words(rules)
    family = _family(names)
    chosen = [] if family else [_find(each) for each in names]
    if not chosen:
        text = _all(family, output_format)
    elif output_format == "json":
        data = [_data(each) for each in chosen]
        text = json.dumps(data[0] if len(data) == 1 else data, indent=2) + "\n"
    else:
        text = "\n".join(_one(each, output_format) for each in chosen)
    write_text(text, form=form_of(output_format))
    return 0


def _family(names: Sequence[str]) -> list[Rule]:
    """The rules of a prefix such as GP3, or all if there is no name; none for anything else."""
    from gpsfsm.analysis.rules import all_rules

    prefix = "".join(names).upper() if names else "GP"
    if not prefix.startswith("GP") or len(prefix) > len("GP3"):
        return []
    return [rule for rule in all_rules() if rule.code.startswith(prefix)]


def _all(rules: Sequence[Rule], output_format: str) -> str:
    if output_format == "json":
        return json.dumps([_data(rule) for rule in rules], indent=2) + "\n"
    if output_format == "markdown":
        from gpsfsm.report._rule_docs import rules_index_markdown

        return rules_index_markdown(rules)
    return "\n".join(_table(rules)) + "\n"


def _one(rule: Rule, output_format: str) -> str:
    if output_format == "markdown":
        from gpsfsm.report._rule_docs import rule_markdown

        return rule_markdown(rule)
    return "\n".join(_text(rule)) + "\n"


def _find(wanted: str) -> Rule:
    from gpsfsm.analysis.rules import all_rules, rule

    try:
        return rule(wanted)
    except UsageError as error:
        near = _near(wanted, all_rules())
        hint = f"did you mean {' or '.join(near)}?" if near else "'gpsfsm explain' lists all rules"
        raise UsageError(f"there is no rule '{wanted}'; {hint}") from error


def _near(wanted: str, rules: Sequence[Rule]) -> list[str]:
    """Names that may have been meant: those that begin like it, else those spelt nearly like it."""
    names = [name for rule in rules for name in (rule.code, rule.name)]
    beginning = [name for name in names if wanted and name.lower().startswith(wanted.lower())]
    return beginning[:_MAX_HINTS] or [
        *difflib.get_close_matches(wanted.upper(), [rule.code for rule in rules], n=1),
        *difflib.get_close_matches(wanted.lower(), [rule.name for rule in rules], n=2),
    ]


def _table(rules: Sequence[Rule]) -> Iterator[str]:
    width = max(len(rule.name) for rule in rules)
    for rule in rules:
        yield f"{rule.code}  {rule.name:{width}}  {rule.severity.value:7}  {rule.summary}"


def _text(rule: Rule) -> Iterator[str]:
    from gpsfsm.report._rule_docs import example_command, visible

    yield f"{rule.code} {rule.name} ({rule.severity.value}, {rule.confidence.value})"
    yield ""
    yield from _wrapped(rule.summary)
    yield ""
    yield from _wrapped(rule.why)
    if rule.severities:
        yield ""
        yield from _wrapped(f"Severity: {rule.severities}")
    examples = [
        (f"{example_command(rule)} finds it here:", rule.bad),
        ("and nothing here:", rule.good),
    ]
    if not rule.bad:
        examples = [("No plan triggers it by itself. It finds nothing here:", rule.good)]
    for title, plan in examples:
        yield ""
        yield title
        yield ""
        yield from (f"    {line}".rstrip() for line in visible(plan).split("\n"))
    yield ""
    yield from _wrapped(f"What to do: {rule.fix}")


def _wrapped(text: str) -> list[str]:
    width = min(terminal_width() or _MAX_WIDTH, _MAX_WIDTH)
    return textwrap.wrap(text, max(width, 20), break_long_words=False, break_on_hyphens=False)


def _data(rule: Rule) -> dict[str, Any]:
    return {
        "code": rule.code,
        "name": rule.name,
        "severity": rule.severity.value,
        "confidence": rule.confidence.value,
        "summary": rule.summary,
        "why": rule.why,
        "severities": rule.severities,
        "bad": rule.bad,
        "good": rule.good,
        "options": list(rule.options),
        "fix": rule.fix,
    }
