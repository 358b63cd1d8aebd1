"""``gpsfsm init``: write the profile of a robot, and a configuration that names it."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from gpsfsm.checking.option_table import BY_NAME
from gpsfsm.errors import UsageError
from gpsfsm.streams import write_message

_EXAMPLE = """\b
Example:
  gpsfsm init --name lab --runner nav2_capabilities/WaypointRunner --map -10 10 -5 5"""


@click.command("init", short_help="Write the profile of a robot.", epilog=_EXAMPLE)
@click.option("--name", metavar="TEXT", help="What the robot is called. [default: robot]")
@click.option(
    "--capabilities", multiple=True, metavar="DIR", help="A folder of its runners' files."
)
@click.option("--runner", "runners", multiple=True, metavar="NAME", help="A runner that it has.")
@click.option("--map", "area", type=float, nargs=4, metavar="X1 X2 Y1 Y2", help="Where it drives.")
@click.option("--engine", type=click.Choice(BY_NAME["engine"].choices), help="Its engine.")
@click.option("--yes", is_flag=True, help="Ask nothing.")
@click.option("--force", is_flag=True, help="Replace files that are there.")
def _init(
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

    On a terminal it asks for what no option says.
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
        raise UsageError(f"{' and '.join(present)}: there already; --force replaces files")
    write_profile(
        Path("robot.yaml"), name or "robot", capabilities, runners, area=area, engine=engine
    )
    Path("gpsfsm.toml").write_text(files["gpsfsm.toml"], encoding="utf-8")
    write_message("robot.yaml and gpsfsm.toml are written; 'gpsfsm check' uses them here\n")
    return 0


COMMAND = _init
