"""``gpsfsm dispatch``: gate a plan, submit it to a Fabric server and follow it."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from gpsfsm.cli._gating import (
    GateValues,
    plan_strictness_options,
    reach_options,
    settled,
    task_option,
)
from gpsfsm.cli._help import ANY_PATH, Command, Section, declare, declare_file
from gpsfsm.cli._options import NumberRange, format_option, library_options
from gpsfsm.cli._running import ros_option, ros_settings
from gpsfsm.errors import UsageError
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from collections.abc import Sequence

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm dispatch plan.xml"""

_HELP = """Submit the plan in PATH, or in standard input for -, to a Fabric server on ROS 2.

The gate decides first, for the engine of the server. An accepted plan is submitted and followed to
its end; Ctrl-C cancels it.

Exit code: 0 completed; 1 not completed, or rejected and not submitted;
2 undecided, or could not be submitted; 130 cancelled with Ctrl-C.

\b
Example:
  gpsfsm dispatch plan.xml --robot robot.yaml --journal run.db
"""


@dataclass(frozen=True, kw_only=True)
class DispatchCommand(GateValues):
    """The options of ``gpsfsm dispatch``."""

    path: str | None
    namespace: str
    events: str
    wait: float
    timeout: float | None
    journal: str | None
    durability: str
    ros_args: Sequence[str]
    output_format: str
    verbose: bool


@click.command(
    "dispatch",
    cls=Command,
    section=Section.RUN,
    help=_HELP,
    short_help="Submit a plan to a Fabric server and follow it.",
)
@click.argument("path", required=False, metavar="PATH", type=ANY_PATH)
@task_option
@plan_strictness_options
@reach_options
@library_options
@declare(
    "--namespace",
    default="/fabric",
    show_default=True,
    metavar="NAME",
    common=True,
    help="Namespace of the server.",
)
@declare(
    "--events",
    default="/capabilities/events",
    show_default=True,
    metavar="TOPIC",
    help="Topic on which the Capabilities2 server reports runner events.",
)
@declare(
    "--wait",
    type=NumberRange(0, 1e6),
    default=5.0,
    show_default=True,
    metavar="SECONDS",
    common=True,
    help="Time to wait for the server.",
)
@declare(
    "--timeout",
    type=NumberRange(0, 1e9, min_open=True),
    metavar="SECONDS",
    common=True,
    help="Cancel the plan after this time.",
)
@declare_file("--journal", common=True, help="Journal: record every event in this file.")
@declare(
    "--durability",
    type=click.Choice(["power", "process", "none"]),
    default="power",
    show_default=True,
    help="What the journal survives: a power failure, the end of the process, or nothing.",
)
@ros_option
@format_option("auto", "plain", "json", text="auto: a live tree on a terminal, else lines.")
@declare("--verbose", is_flag=True, help="Show every event.")
@declare("--config", metavar="FILE", help="Use this configuration file. [default: none]")
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    """Run ``gpsfsm dispatch``."""
    values = settled(context, DispatchCommand)
    if not values.path:
        raise click.UsageError(_NO_PATH, context)
    if values.journal == "":
        raise UsageError("--journal needs the name of a file, not an empty one")
    values.refuse_idle()
    return _dispatch(values, values.path)


def _dispatch(values: DispatchCommand, path: str) -> int:
    from gpsfsm.checking.inputs import read_named
    from gpsfsm.dispatching.dispatch import Dispatch, dispatch
    from gpsfsm.model.ros import RosSettings
    from gpsfsm.running.interruption import Interruption

    options = values.gate_options()
    name, text = read_named(path, options.check.limits.max_bytes)
    settings = Dispatch(
        options=options,
        ros=RosSettings.of(ros_settings(options.check.described, values.ros_args)),
        budget_ms=values.budget_ms,
        memory_mb=values.memory_mb,
        root=values.namespace,
        events=values.events,
        wait_s=values.wait,
        timeout_s=values.timeout,
        output_format=values.output_format,
        verbose=values.verbose,
    )
    with ExitStack() as stack:
        interruption = stack.enter_context(Interruption())
        journal = None
        if values.journal is not None:
            from gpsfsm.execution.journal import Journal

            journal = stack.enter_context(Journal(values.journal, values.durability))
            if journal.note:
                complain(journal.note)
        return dispatch(settings, text, name, journal, interruption)
