"""The options of commands that check plans, and the settings of the check that they make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gpsfsm.analysis.options import (
    DEFAULT_MAX_SCENARIOS,
    MAX_RLIMIT,
    MAX_TOTAL_RLIMIT,
    AnalysisOptions,
)
from gpsfsm.cli._options import (
    apply,
    library_options,
    limits_of,
    response_option,
    words,
)
from gpsfsm.model.engine import PAPER_ENGINE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Severity

__all__ = [
    "SETTINGS",
    "capability_options",
    "check_options_of",
    "effort_options",
    "scenario_options",
    "selection_options",
    "severity_of",
]

SETTINGS = (
    *("select", "ignore", "fail_on", "assume", "consistent", "faults", "from_response"),
    *("capabilities", "builtin_capabilities", "deadline", "energy_limit", "engine"),
    *("solver", "rlimit", "total_rlimit", "max_scenarios"),
    *("max_bytes", "max_depth", "max_elements", "max_attributes", "max_attribute_length"),
)
"""The settings of a configuration file that say how plans are checked."""


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


def severity_of(fail_on: str) -> Severity | None:
    from gpsfsm.model.finding import Severity  # noqa: PLC0415

    return None if fail_on == "never" else Severity(fail_on)
