"""The options of commands that check plans, and the settings of the check that they make."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.analysis.options import (
    DEFAULT_MAX_SCENARIOS,
    MAX_RLIMIT,
    MAX_TOTAL_RLIMIT,
    AnalysisOptions,
)
from gpsfsm.cli._options import (
    CONFIGURED,
    apply,
    library_options,
    limits_of,
    response_option,
    words,
)
from gpsfsm.cli._streams import complain
from gpsfsm.model.engine import PAPER_ENGINE
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Effect, SettingUsed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import Report

__all__ = [
    "SETTINGS",
    "capability_options",
    "check_options_of",
    "effort_options",
    "exit_code",
    "scenario_options",
    "selection_options",
    "settings_used",
    "severity_of",
    "tell_narrowing",
    "tell_settings",
]

SETTINGS = (
    *("select", "ignore", "fail_on", "assume", "consistent", "faults", "from_response"),
    *("capabilities", "builtin_capabilities", "deadline", "energy_limit", "engine"),
    *("solver", "rlimit", "total_rlimit", "max_scenarios"),
    *("max_bytes", "max_depth", "max_elements", "max_attributes", "max_attribute_length"),
)
"""The settings of a configuration file that say how plans are checked."""


_NARROWING: Mapping[str, object] = {
    "assume": [],
    "consistent": False,
    "capabilities": [],
    "builtin_capabilities": True,
    "engine": PAPER_ENGINE,
    "from_response": False,
}
"""Settings under which less is decided than everything, or of another text; and what does not."""


def selection_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Which findings count."""
    options = (
        click.option(
            "--select",
            multiple=True,
            metavar="CODES",
            help="Show only these rules: codes, names, prefixes (GP3) or ALL, with commas.",
        ),
        click.option("--ignore", multiple=True, metavar="CODES", help="Do not show these rules."),
        click.option(
            "--fail-on",
            type=click.Choice(["error", "warning", "never"]),
            default="error",
            show_default=True,
            help="The least severity of a finding that makes the exit code 1.",
        ),
        click.option(
            "--allow-suppressions/--no-allow-suppressions",
            help="Let comments in a plan excuse its findings: they make the exit code 0.",
        ),
    )
    return apply(options, command)


def scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is read and what may happen."""
    options = (
        click.option(
            "--assume",
            multiple=True,
            metavar="TEXT",
            help="Consider only runs where this holds, e.g. 'never fails: SpeechRunner'.",
        ),
        click.option(
            "--consistent/--no-consistent", help="Equal actions of a plan have equal outcomes."
        ),
        click.option(
            "--faults",
            multiple=True,
            metavar="LIST",
            help="What can happen to a runner: failed, no-start, hang. [default: failed]",
        ),
        response_option,
    )
    return apply(options, command)


def capability_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is known of the robot."""
    options = (
        library_options,
        click.option(
            "--deadline",
            type=float,
            metavar="SECONDS",
            help="What a run may take at most, as far as durations are declared.",
        ),
        click.option(
            "--energy-limit",
            type=float,
            metavar="JOULES",
            help="The energy that a run may take at most, as far as it is declared.",
        ),
    )
    return apply(options, command)


def effort_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about how to decide and how much to do."""
    options = (
        click.option(
            "--solver",
            type=click.Choice(["auto", "z3", "structural"]),
            default="auto",
            show_default=True,
            help="How to decide.",
        ),
        click.option(
            "--rlimit",
            type=click.IntRange(1, MAX_RLIMIT),
            metavar="N",
            help="z3's steps per question; beyond them the answer is 'unknown', exit code 2.",
        ),
        click.option(
            "--total-rlimit",
            type=click.IntRange(1, MAX_TOTAL_RLIMIT),
            metavar="N",
            help="z3's steps for one plan in all; beyond them likewise.",
        ),
        click.option(
            "--max-scenarios",
            type=click.IntRange(min=0),
            metavar="N",
            help=f"Scenarios per rule and plan. [default: {DEFAULT_MAX_SCENARIOS}]",
        ),
    )
    return apply(options, command)


def check_options_of(values: Mapping[str, Any]) -> CheckOptions:
    from gpsfsm.api import check_options  # noqa: PLC0415
    from gpsfsm.capabilities.choice import choose_capabilities  # noqa: PLC0415

    limits = ("rlimit", "total_rlimit", "max_scenarios")
    given = {name: values[name] for name in limits if values[name] is not None}
    analysis = AnalysisOptions(
        faults=words(values["faults"]),
        consistent=values["consistent"],
        assumptions=tuple(values["assume"]),
        solver=values["solver"],
        deadline_s=values["deadline"],
        energy_limit_j=values["energy_limit"],
        **given,
    )
    return check_options(
        analysis,
        select=words(values["select"]),
        ignore=words(values["ignore"]),
        from_response=values["from_response"],
        engine=values.get("engine", PAPER_ENGINE),
        limits=limits_of(values),
        capabilities=choose_capabilities(
            values["capabilities"], builtin=values["builtin_capabilities"]
        ),
    )


def exit_code(values: Mapping[str, Any], report: Report) -> int:
    """The exit code for a report; that comments alone make it 1 is told on standard error."""
    fail_on = severity_of(values["fail_on"])
    excused = report.exit_code(fail_on, allow_suppressions=True)
    if values["allow_suppressions"]:
        return excused
    code = report.exit_code(fail_on)
    if code != excused:
        complain("comments in a plan excuse nothing; --allow-suppressions lets them")
    return code


def settings_used(values: Mapping[str, Any], report: Report) -> Report:
    """The report with the settings that take something away from it, or from the exit code.

    Of options on the command line those that hide findings; of a configuration file also those
    under which less is decided, and those that let errors pass: its author may be somebody else.
    """
    used = (*_hiding(values, report), *_narrowing(values), *_excusing(values, report))
    return replace(report, settings=used)


def tell_narrowing(values: Mapping[str, Any]) -> None:
    """Tell on standard error under which settings of files less is decided than everything."""
    tell_settings(tuple(_narrowing(values)))


def tell_settings(used: Sequence[SettingUsed]) -> None:
    """Tell on standard error what settings take away."""
    from gpsfsm.report._words import setting_line  # noqa: PLC0415

    for each in used:
        complain(setting_line(each))


def _hiding(values: Mapping[str, Any], report: Report) -> Iterator[SettingUsed]:
    from gpsfsm.analysis.rules import select_rules  # noqa: PLC0415

    ignored = select_rules(words(values.get("ignore", ())))
    groups: dict[str, list[Finding]] = {"select": [], "ignore": [], "baseline": []}
    for plan in report.plans:
        for finding in plan.suppressed:
            if finding.suppressed_by == "option":
                groups["ignore" if finding.rule in ignored else "select"].append(finding)
            elif finding.suppressed_by == "baseline":
                groups["baseline"].append(finding)
    for name, hidden in groups.items():
        if hidden:
            yield _used(values, name, Effect.HIDES, hidden)


def _narrowing(values: Mapping[str, Any]) -> Iterator[SettingUsed]:
    configured = values.get(CONFIGURED, {})
    for name, harmless in _NARROWING.items():
        if name in configured and values[name] != harmless:
            yield _used(values, name, Effect.NARROWS, ())


def _excusing(values: Mapping[str, Any], report: Report) -> Iterator[SettingUsed]:
    """The settings under which errors do not fail, as far as there are any."""
    if "fail_on" not in values:  # a command whose exit code says something else
        return
    counting = [*report.excused, *(each for plan in report.plans for each in plan.findings)]
    errors = [each for each in counting if each.severity is Severity.ERROR]
    if errors and values["fail_on"] == "never" and "fail_on" in values[CONFIGURED]:
        yield _used(values, "fail_on", Effect.EXCUSES, errors)
    least = severity_of(values["fail_on"])
    excused = [each for each in report.excused if least and each.severity.rank >= least.rank]
    if excused and values["allow_suppressions"]:
        yield _used(values, "allow_suppressions", Effect.EXCUSES, excused)


def _used(
    values: Mapping[str, Any], name: str, effect: Effect, findings: Sequence[Finding]
) -> SettingUsed:
    file, value, key = values[CONFIGURED].get(name, ""), values[name], name.replace("_", "-")
    if file:
        text = json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)
        setting = f"{key} = {text}"
    elif value is True:
        setting = f"--{key}"
    else:
        setting = f"--{key} {value if isinstance(value, str) else ','.join(value)}"
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    return SettingUsed(setting, effect, _nearer(file), len(findings), errors)


def _nearer(file: str) -> str:
    """A file below the current folder by its path from there."""
    try:
        return str(Path(file).relative_to(Path.cwd())) if file else ""
    except (OSError, ValueError):
        return file


def severity_of(fail_on: str) -> Severity | None:
    return None if fail_on == "never" else Severity(fail_on)
