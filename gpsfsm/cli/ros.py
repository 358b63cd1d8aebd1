"""``gpsfsm ros``: the gate of a robot as a node of ROS 2, and a stop of all goals."""

from __future__ import annotations

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
from gpsfsm.cli._help import ANY_PATH, CommandGroup, Section, declare, declare_file
from gpsfsm.cli._options import LibraryValues, NumberRange, Values, library_options, read_values
from gpsfsm.cli._running import LogValues, log_options, ros_option, ros_settings
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, kw_only=True)
class RosGateCommand(GateValues, LogValues):
    """The options of ``gpsfsm ros gate``."""

    private: str
    wait: float
    receipts: str | None
    ros_args: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class RosCheckCommand(LibraryValues):
    """The options of ``gpsfsm ros check``."""

    path: str
    offline: bool
    ros_args: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class RosStopCommand(LibraryValues):
    """The options of ``gpsfsm ros stop``."""

    ros_args: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class RosStatusCommand(Values):
    """The options of ``gpsfsm ros status``."""

    journal: str
    number: int | None


_ROS = """Run ROS 2 nodes beside those of a robot, and stop it.

\b
Example:
  gpsfsm ros gate --robot robot.yaml
"""
_GATE = """Offer the public names of a Fabric server and pass on only plans that the gate accepts.

Start the server with its names remapped under --private. Everything fails closed: without a
verdict, or without the server, the plan is rejected.

Exit code: 0 stopped on request, 2 could not start.

\b
Example:
  gpsfsm ros gate --robot robot.yaml --receipts decisions.jsonl
"""
_CHECK = """Look for all that the plan in PATH (- for standard input) needs on ROS 2.

A plan with a miss does not begin on the robot: an interface that is not installed, a field that it
does not have, a value that does not fit, a server that is not there. Nothing is sent. This checks
no plan: 'gpsfsm check' does.

Exit code: 0 all is there, 1 something is missing, 2 could not look.

\b
Example:
  gpsfsm ros check plan.xml
"""
_STOP = """Cancel all goals of all actions of a robot, whoever has sent them.

This is no emergency stop: it needs the network and the servers of the robot.

Exit code: 0 all servers have ended their goals, 2 no server was seen, 3 a goal may still act.

\b
Example:
  gpsfsm ros stop --robot robot.yaml
"""

_STATUS = """Show what became of each goal of a run in JOURNAL, by the journal alone.

A goal that was open when its process ended or fell silent is UNKNOWN.

Exit code: 0 no goal may act, 2 not possible, 3 a goal may still act.

\b
Example:
  gpsfsm ros status run.db
"""

command = CommandGroup(
    "ros",
    section=Section.SERVE,
    help=_ROS,
    short_help="Run ROS 2 nodes, such as the gate for Fabric.",
)


@command.command(
    "gate", help=_GATE, short_help="Guard a Fabric server: pass on accepted plans only."
)
@task_option
@plan_strictness_options
@reach_options
@library_options
@declare(
    "--private",
    default="/gpsfsm_private",
    show_default=True,
    metavar="NAME",
    common=True,
    help="Namespace under which the server offers its names.",
)
@declare(
    "--wait",
    type=NumberRange(0, 1e6),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="Time to wait for the server.",
)
@declare_file(
    "--receipts",
    common=True,
    help="Append each decision to this file; reject plans if it cannot be written.",
)
@log_options
@ros_option
@declare("--config", metavar="FILE", help="Use this configuration file. [default: none]")
@click.pass_context
def _gate(context: click.Context, /, **_: object) -> int:
    """Run ``gpsfsm ros gate``."""
    values = settled(context, RosGateCommand)
    values.refuse_idle()
    from gpsfsm import logs
    from gpsfsm.dispatching.gate_node import GateNode, serve_gate
    from gpsfsm.model.ros import RosSettings
    from gpsfsm.running.interruption import Interruption

    options = values.gate_options()
    settings = GateNode(
        options=options,
        ros=RosSettings.of(ros_settings(options.check.described, values.ros_args)),
        budget_ms=values.budget_ms,
        memory_mb=values.memory_mb,
        private=values.private,
        wait_s=values.wait,
        receipts=values.receipts,
    )
    with logs.writing(values.log_level, values.log_format), Interruption() as interruption:
        return serve_gate(settings, interruption)


@command.command("check", help=_CHECK, short_help="Look for all that a plan needs on a robot.")
@click.argument("path", metavar="PATH", type=ANY_PATH)
@declare(
    "--offline",
    is_flag=True,
    common=True,
    help="Without a robot: check only against the interfaces that are installed.",
)
@library_options
@ros_option
@click.pass_context
def _check(context: click.Context, /, **_: object) -> int:
    """Run ``gpsfsm ros check``."""
    values = read_values(context, RosCheckCommand)
    if values.offline and values.ros_args:
        raise UsageError("--offline and --ros-args cannot be used together: no robot is looked at")
    from gpsfsm.running.looking import check_for_robot

    capabilities = values.library
    settings = ros_settings(capabilities, values.ros_args)
    return check_for_robot(values.path, capabilities, settings, offline=values.offline)


@command.command("stop", help=_STOP, short_help="Cancel all goals of a robot.")
@library_options
@ros_option
@click.pass_context
def _stop(context: click.Context, /, **_: object) -> int:
    """Run ``gpsfsm ros stop``."""
    values = read_values(context, RosStopCommand)
    from gpsfsm.ros.stopper import stop_all

    capabilities = values.library
    return stop_all(capabilities.library, ros_settings(capabilities, values.ros_args))


@command.command("status", help=_STATUS, short_help="Show the goals of a run.")
@click.argument("journal", metavar="JOURNAL", type=ANY_PATH)
@declare(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="Run number in the journal. [default: the last]",
)
@click.pass_context
def _status(context: click.Context, /, **_: object) -> int:
    """Run ``gpsfsm ros status``."""
    values = read_values(context, RosStatusCommand)
    from gpsfsm.running.goals import show_status

    return show_status(values.journal, values.number)
