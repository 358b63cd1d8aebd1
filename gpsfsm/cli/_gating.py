"""The options of the gate, for the commands that let plans through it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import click

from gpsfsm.cli._help import declare, declare_file
from gpsfsm.cli._options import (
    SETTINGS,
    CheckValues,
    FailValues,
    apply,
    option,
    read_values,
    severity_of,
    words,
)
from gpsfsm.cli._running import ALLOW
from gpsfsm.errors import UsageError
from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from gpsfsm.gating import GateOptions

_Gate = TypeVar("_Gate", bound="GateValues")
_MAX_BUDGET_MS = 86_400_000
_BUDGET_MS = 10_000
_MEMORY_MB, _LEAST_MEMORY_MB = 1_024, 256
"""As in ``gpsfsm.gating.gate_process``; repeated here so that --help need not load it."""


@dataclass(frozen=True, kw_only=True)
class GateValues(CheckValues, FailValues):
    """The values of the options of a gate."""

    task: str | None
    allow_empty: bool
    allow_trees: bool = False
    allow_approximated: bool = False
    budget_ms: int
    memory_mb: int
    allow_host: Sequence[str]
    allow_program: Sequence[str]
    allow_function: Sequence[str]

    def gate_options(self) -> GateOptions:
        """The options of a gate. Raises UsageError and ConfigError."""
        from gpsfsm.gating import GateOptions
        from gpsfsm.gating.gate_call import DEFAULT_TOTAL_RLIMIT, options_with, permitting
        from gpsfsm.model.finding import Severity

        total = self.total_rlimit or DEFAULT_TOTAL_RLIMIT
        check = replace(self, select=(), total_rlimit=total).options()
        options = GateOptions(
            check=replace(check, capabilities=permitting(check.described, reached(self))),
            fail_on=severity_of(self.fail_on) or Severity.ERROR,
            allow_suppressions=self.allow_suppressions,
            allow_empty=self.allow_empty,
            allow_approximated=self.allow_approximated,
        )
        return options_with(options, task=self.task, robot=None, allow_trees=self.allow_trees)

    def refuse_idle(self) -> None:
        """Raise UsageError for rules that are ignored and would refuse nothing anyway."""
        from gpsfsm.gating.gate_call import is_idle
        from gpsfsm.model.printable import clip

        if "ignore" not in self.configured and is_idle(words(self.ignore), self.fail_on):
            raise UsageError(
                "--ignore has no effect on a gate that lets warnings pass: no finding of "
                f"{clip(', '.join(self.ignore), 100)} refuses a plan; leave it out, or add "
                "--fail-on warning"
            )


def settled(context: click.Context, kind: type[_Gate]) -> _Gate:
    """The values of all options. Raises UsageError."""
    values = read_values(context, kind, SETTINGS, named=True)
    if values.fail_on == "never":
        file = context.params["config"]
        raise UsageError(f"{file}: 'fail-on' must be error or warning for a gate, not never")
    return values


task_option = declare_file(
    "--task",
    common=True,
    help="Task file that the plans must fulfil.",
)


_STRICTNESS = (
    option(
        "fail_on",
        type=click.Choice(["error", "warning"]),
        help="Lowest severity that rejects a plan.",
    ),
    option("ignore", help="Do not reject plans for warnings of these rules."),
    declare(
        "--allow-suppressions",
        is_flag=True,
        help="Let comments in a plan suppress its findings.",
    ),
    declare("--allow-empty", is_flag=True, common=True, help="Accept plans that do nothing."),
    declare(
        "--budget-ms",
        type=click.IntRange(1, _MAX_BUDGET_MS),
        default=_BUDGET_MS,
        show_default=True,
        metavar="N",
        common=True,
        help="Time limit per plan; beyond it, it is undecided.",
    ),
    declare(
        "--memory-mb",
        type=click.IntRange(_LEAST_MEMORY_MB),
        default=_MEMORY_MB,
        show_default=True,
        metavar="N",
        help="Memory limit of the deciding process; beyond it, likewise.",
    ),
)


def strictness_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is refused."""
    trees = declare("--allow-trees", is_flag=True, common=True, help="Accept behaviour trees too.")
    text = "Accept errors that only an over-approximation has."
    doubtful = declare("--allow-approximated", is_flag=True, help=text)
    return apply((*_STRICTNESS[:4], trees, doubtful, *_STRICTNESS[4:]), command, "What is refused")


def plan_strictness_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The same where plans are all that can pass."""
    return apply(_STRICTNESS, command, "What is refused")


def reach_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of a gate about what plans may reach."""
    options = [
        declare(name, multiple=True, metavar=metavar, help=text)
        for name, metavar, text in ALLOW
        if name != "--allow-module"
    ]
    return apply(options, command, "Permissions of real runners")


def reached(values: Any) -> list[tuple[str, str]]:
    """The values of these options: kind and value. Raises UsageError as ``permitted`` does."""
    from gpsfsm.running.bounds import PERMISSIONS, permitted

    return [
        (name.removeprefix("allow_"), text)
        for name in PERMISSIONS
        for text in permitted(name, words(getattr(values, name, ())))
    ]
