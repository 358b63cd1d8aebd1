"""``gpsfsm init``: write the profile of a robot, and a configuration that names it."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from gpsfsm.checking.option_table import BY_NAME
from gpsfsm.cli._help import Command, Section, declare
from gpsfsm.errors import UsageError
from gpsfsm.streams import check_writable, to_stderr, write_text

_EXAMPLE = """\b
Example:
  gpsfsm init --name lab --engine fabric-v2 --map -10 10 -5 5"""


@click.command(
    "init",
    cls=Command,
    section=Section.MAINTAIN,
    short_help="Write a robot profile and a configuration.",
    epilog=_EXAMPLE,
)
@declare("--name", metavar="TEXT", help="Name of the robot. [default: robot]")
@declare(
    "--capabilities",
    multiple=True,
    metavar="DIR",
    help="Folder of its capability files; may be repeated.",
)
@declare(
    "--runner",
    "runners",
    multiple=True,
    metavar="NAME",
    help="A runner of the robot; may be repeated.",
)
@declare(
    "--map", "area", type=float, nargs=4, metavar="X1 X2 Y1 Y2", help="Area in which it drives."
)
@declare(
    "--engine", type=click.Choice(BY_NAME["engine"].choices), help="Engine that runs its plans."
)
@declare("--yes", is_flag=True, help="Ask no questions.")
@declare("--force", is_flag=True, help="Overwrite existing files.")
def command(
    name: str | None,
    capabilities: tuple[str, ...],
    runners: tuple[str, ...],
    area: tuple[float, float, float, float] | None,
    engine: str | None,
    *,
    yes: bool,
    force: bool,
) -> int:
    """Write robot.yaml and gpsfsm.toml into the current folder.

    On a terminal, it asks for everything that the options do not set.
    """
    from gpsfsm.capabilities.robot import area_of, write_profile

    if not yes and sys.stdin.isatty():
        name = name or click.prompt("Name of the robot", default="robot")
        if not runners:
            text = click.prompt("Its runners, with commas (empty: all)", default="")
            runners = tuple(filter(None, (each.strip() for each in text.split(","))))
        engine = engine or click.prompt("Its engine", default=BY_NAME["engine"].default)
        if area is None:
            text = click.prompt("Where it drives: X1 X2 Y1 Y2 (empty: anywhere)", default="")
            area = area_of(text)
    files = {"robot.yaml": "", "gpsfsm.toml": 'robot = "robot.yaml"\n'}
    present = [each for each in files if Path(each).exists()]
    if present and not force:
        raise UsageError(f"{' and '.join(present)} would be overwritten; use --force to do so")
    for each in files:  # both or none
        check_writable(each, (), within=".")
    write_profile(
        Path("robot.yaml"), name or "robot", capabilities, runners, area=area, engine=engine
    )
    write_text(files["gpsfsm.toml"], "gpsfsm.toml")
    to_stderr("wrote robot.yaml and gpsfsm.toml; 'gpsfsm check' uses them here\n")
    return 0
