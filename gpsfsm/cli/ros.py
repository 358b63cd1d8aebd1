"""``gpsfsm ros``: nodes of ROS 2 that stand beside a robot's own; so far the gate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from gpsfsm.cli._gating import GateValues, plan_strictness_options, settled, task_option
from gpsfsm.cli._options import (
    NumberRange,
    library_options,
    reach_options,
    ros_option,
    ros_settings,
)

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, kw_only=True)
class RosGateCommand(GateValues):
    """The options of ``gpsfsm ros gate``."""

    private: str
    wait: float
    receipts: str | None
    ros_args: Sequence[str]


_ROS = """Nodes of ROS 2 that stand beside those of a robot.

\b
Example:
  gpsfsm ros gate --robot robot.yaml
"""
_GATE = """Offer the public names of a Fabric server, and pass on only what the gate accepts.

The server itself has to be started with its names remapped below --private. All fails closed:
without a verdict, or without the server, the answer is that of a server that rejects the plan.

\b
Exit code: 0 it was ended, 2 it could not be started.

\b
Example:
  gpsfsm ros gate --robot robot.yaml --receipts decisions.jsonl
"""

COMMAND = click.Group(
    "ros", help=_ROS, short_help="Nodes of ROS 2: the gate in front of a Fabric server."
)


@COMMAND.command(
    "gate", help=_GATE, short_help="Stand in front of a Fabric server, and let plans through."
)
@task_option
@plan_strictness_options
@reach_options
@library_options
@click.option(
    "--private",
    default="/gpsfsm_private",
    show_default=True,
    metavar="NAME",
    help="The namespace below which the server offers its names.",
)
@click.option(
    "--wait",
    type=NumberRange(0, 1e6),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="How long to wait for the server.",
)
@click.option(
    "--receipts",
    metavar="FILE",
    type=click.Path(),
    help="Append each decision to this file; what cannot be written there is rejected.",
)
@ros_option
@click.option("--config", metavar="FILE", help="Read this configuration file. [default: none]")
@click.pass_context
def _gate(context: click.Context, /, **_: object) -> int:
    """Run ``gpsfsm ros gate``."""
    values = settled(context, RosGateCommand)
    values.refuse_idle()
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
    with Interruption() as interruption:
        return serve_gate(settings, interruption)
