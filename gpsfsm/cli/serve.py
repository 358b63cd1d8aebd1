"""``gpsfsm serve``: the HTTP service."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import Command, Section, declare, declare_file
from gpsfsm.cli._model import model_options
from gpsfsm.cli._options import (
    LibraryValues,
    NumberRange,
    apply,
    config_options,
    library_options,
    read_values,
)
from gpsfsm.cli._running import (
    AllowValues,
    LogValues,
    RegenerationValues,
    allow_options,
    log_options,
    permissions,
    regeneration_options,
    ros_option,
    ros_settings,
    wanted,
)
from gpsfsm.errors import UsageError
from gpsfsm.running.bounds import PERMISSIONS

if TYPE_CHECKING:
    from gpsfsm.service import Settings

_SETTINGS = frozenset(("capabilities", "builtin_capabilities", "robot"))
_SECONDS = NumberRange(0, 86_400, min_open=True)
_COUNT = click.IntRange(1, 1_000_000)
_BYTES = click.IntRange(1, 1 << 28)


def _where_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about who can reach the service."""
    return apply(
        (
            declare(
                "--host",
                default="127.0.0.1",
                show_default=True,
                metavar="ADDRESS",
                common=True,
                help="Address to listen on; any but this machine's needs a token.",
            ),
            declare(
                "--port",
                type=click.IntRange(0, 65_535),
                metavar="N",
                default=8321,
                show_default=True,
                common=True,
                help="Port; 0 takes a free one.",
            ),
            declare_file(
                "--token-file",
                common=True,
                help="File of client tokens, one per line. [env: GPSFSM_TOKEN]",
            ),
        ),
        command,
        "Address",
    )


def _proxy_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about the names, the proxy and the collector of traces around the service."""
    return apply(
        (
            declare(
                "--allow-name",
                "names",
                multiple=True,
                metavar="NAME",
                help="Accept this name in Host headers too; may be repeated.",
            ),
            declare(
                "--trust-proxy",
                "proxies",
                multiple=True,
                metavar="ADDRESS",
                help="Trust X-Forwarded-For, -Proto and -Prefix, and Forwarded, from this proxy or "
                "network; may be repeated.",
            ),
            declare(
                "--root-path",
                default="",
                metavar="PATH",
                help="Path under which a reverse proxy serves it, such as /gpsfsm.",
            ),
            declare(
                "--otel/--no-otel",
                default=None,
                help="Export traces by OpenTelemetry. [default: if OTEL_EXPORTER_OTLP_ENDPOINT is "
                "set]",
            ),
        ),
        command,
        "Proxy and traces",
    )


def _bound_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what requests may take. None stands for the default of the service."""
    rows = (
        ("--workers", _COUNT, "N", "Processes that check plans. [default: 2]"),
        (
            *("--gate-workers", _COUNT, "N"),
            "Further processes for small gate requests only. [default: as --workers, at most 2]",
        ),
        ("--memory", click.IntRange(256), "MB", "Memory of each process. [default: 1024]"),
        ("--waiting", _COUNT, "N", "Maximum waiting requests per cost class. [default: 64]"),
        ("--time-limit", _SECONDS, "SECONDS", "Time limit per request. [default: 10]"),
        (
            "--small-limit",
            _SECONDS,
            "SECONDS",
            "CPU time limit of a small request. [default: 0.5]",
        ),
        ("--max-body", _BYTES, "BYTES", "Maximum size of a request. [default: 2097152]"),
        ("--connections", _COUNT, "N", "Maximum number of connections. [default: 2048]"),
        ("--grace", _SECONDS, "SECONDS", "Time that a shutdown waits for requests. [default: 10]"),
        (
            *("--drain", NumberRange(0, 3_600), "SECONDS"),
            "Time that /readyz answers 503 before a shutdown begins. [default: 0]",
        ),
    )
    return apply(
        [
            declare(name, type=kind, metavar=metavar, help=text)
            for name, kind, metavar, text in rows
        ],
        command,
        "Limits on requests",
    )


def _queue_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about the plan queue."""
    return apply(
        (
            declare_file(
                "--journal",
                common=True,
                help="Keep a queue of plans in this file and run them.",
            ),
            declare(
                "--durability",
                type=click.Choice(["power", "process", "none"]),
                default="power",
                show_default=True,
                help="What the journal survives.",
            ),
            declare(
                "--queue",
                "most_waiting",
                type=_COUNT,
                metavar="N",
                help="Maximum number of waiting plans. [default: 1000]",
            ),
        ),
        command,
        "The plan queue",
    )


def _run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about how plans are run. None stands for what ``gpsfsm run`` does."""
    at_most, positive = NumberRange(0, 1e6, min_open=True), NumberRange(0, 1)
    world = declare_file(
        "--world",
        "worlds",
        multiple=True,
        common=True,
        help="Simulate the runners in this world; may be repeated: clients choose, the first is "
        "the default.",
    )
    rows: tuple[tuple[str, Any, Any, str, str], ...] = (
        ("--seed", int, 0, "N", "Random seed. [default: 0]"),
        (
            *("--failure", positive, None, "P"),
            "Probability that an action fails. [default: 0.1]",
        ),
        (
            *("--speed", at_most, None, "X"),
            "Simulated seconds per second. [default: no waiting]",
        ),
        (
            *("--action-timeout", NumberRange(0, 1e9, min_open=True), None, "SECONDS"),
            "Time limit per action; beyond it, it fails.",
        ),
        (
            *("--run-limit", at_most, 3_600.0, "SECONDS"),
            "Time limit per run; beyond it, it is cancelled. [default: 3600]",
        ),
    )
    return apply(
        [
            world,
            declare(
                "--real",
                is_flag=True,
                common=True,
                help="Run real runners; needs --journal, a token, permissions.",
            ),
            *(
                declare(name, type=kind, default=default, metavar=metavar, help=text)
                for name, kind, default, metavar, text in rows
            ),
        ],
        command,
        "Runs",
    )


@dataclass(frozen=True, kw_only=True)
class ServeCommand(RegenerationValues, LibraryValues, AllowValues, LogValues):
    """The options of ``gpsfsm serve``."""

    host: str
    port: int
    token_file: str | None
    names: Sequence[str]
    proxies: Sequence[str]
    root_path: str
    otel: bool | None
    workers: int | None
    gate_workers: int | None
    memory: int | None
    waiting: int | None
    time_limit: float | None
    small_limit: float | None
    max_body: int | None
    connections: int | None
    grace: float | None
    drain: float | None
    journal: str | None
    durability: str
    most_waiting: int | None
    worlds: Sequence[str]
    real: bool
    seed: int
    failure: float | None
    speed: float | None
    action_timeout: float | None
    run_limit: float
    ros_args: Sequence[str]


@click.command(
    "serve",
    cls=Command,
    section=Section.SERVE,
    short_help="Serve checks and a plan queue over HTTP.",
)
@_where_options
@_proxy_options
@_bound_options
@_queue_options
@_run_options
@log_options
@allow_options
@ros_option
@model_options(timeout="--model-timeout")
@regeneration_options
@library_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Serve checks, the gate, grades, repairs and, with --journal, a queue of plans.

    Without a token, only this machine can connect. /openapi.json describes the interface.

    Exit code: 0 stopped on request, 2 could not start, or its queue failed.

    \b
    Example:
      gpsfsm serve --journal queue.db --world world.yaml
    """
    values = read_values(context, ServeCommand, _SETTINGS, named=True)
    _refuse_contradictions(values)
    from gpsfsm.service import serve

    return serve(_settings(context, values))


def _refuse_contradictions(values: ServeCommand) -> None:
    world = next(iter(values.worlds), None)
    for name, value in (
        *((name, getattr(values, name)) for name in ("journal", "token_file")),
        ("world", world),
    ):
        if value == "":  # of a variable of the shell that is not set, say
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} needs the name of a file, not an empty one")
    if values.real:
        _refuse_with_real(values)
    else:
        for name in (*PERMISSIONS, "ros_args"):
            if getattr(values, name):
                raise UsageError(f"--{name.replace('_', '-')} needs --real")
    if values.journal is None:
        if world is not None:
            raise UsageError("--world needs --journal")
        for name in ("failure", "speed", "action_timeout"):
            if getattr(values, name) is not None:
                raise UsageError(f"--{name.replace('_', '-')} needs --journal")
    if world is not None and values.failure is not None:
        raise UsageError("--failure cannot be used with --world")
    if values.model_name and values.journal and world is None and not values.real:
        raise UsageError("--model needs --world or --real: random outcomes ask no model")


def _refuse_with_real(values: ServeCommand) -> None:
    """Options that have no meaning when real runners act. Raises UsageError."""
    if values.journal is None:
        raise UsageError(
            "--real needs --journal FILE, which records what to stop after a crash, and that "
            "the queue is held"
        )
    for name, option in (("worlds", "world"), ("speed", "speed"), ("failure", "failure")):
        if getattr(values, name) not in (None, ()):
            raise UsageError(f"--real and --{option} cannot be used together")


def _settings(context: click.Context, values: ServeCommand) -> Settings:
    from gpsfsm.ros.stopper import stopper_command
    from gpsfsm.service import Settings
    from gpsfsm.service.settings import tokens_of

    bounds = {
        name: getattr(values, option)
        for name, option in (
            *(("workers", "workers"), ("memory_mb", "memory"), ("waiting", "waiting")),
            *(("request_s", "time_limit"), ("max_body", "max_body"), ("grace_s", "grace")),
            *(("connections", "connections"), ("most_waiting", "most_waiting")),
            *(("gate_workers", "gate_workers"), ("small_s", "small_limit"), ("drain_s", "drain")),
        )
        if getattr(values, option) is not None
    }
    module = "real_serving" if values.real else "serving"
    command = (sys.executable, "-P", "-m", f"gpsfsm.running.{module}")
    allowed, place = _allowed(values) if values.real else ({}, {})
    return Settings(
        host=values.host,
        port=values.port,
        tokens=tokens_of(values.token_file),
        hosts=tuple(values.names),
        proxies=tuple(values.proxies),
        root_path=values.root_path.rstrip("/"),
        log_level=values.log_level,
        log_format=values.log_format,
        otel=values.otel,
        capabilities=tuple(os.path.realpath(each) for each in values.capabilities),
        builtin_capabilities=values.builtin_capabilities,
        robot=None if values.robot is None else os.path.realpath(values.robot),
        journal=values.journal or "",
        executor=command if values.journal else (),
        runs=_runs(context, values, {**allowed, **({"ros": place} if values.real else {})}),
        stopper=stopper_command(values.library.library, place) if values.real else (),
        allow=tuple(
            (name.removeprefix("allow_"), text)
            for name, texts in allowed.items()
            if name != "allow_module"
            for text in texts
        ),
        generator=_generator(context.params, values),
        **bounds,
    )


def _allowed(values: ServeCommand) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """The permissions of the command line and of the profile, and where the robot is.

    Raises UsageError if there are no permissions and no profile.
    """
    capabilities = values.library
    allowed = permissions(values, capabilities.allow or ())
    if not allowed and values.robot is None:
        raise UsageError(
            "--real lets plans act, so say what they may reach: --allow-host, --allow-program, "
            "--allow-function, --allow-module, or a robot profile with --robot"
        )
    return allowed, ros_settings(capabilities, values.ros_args)


def _runs(
    context: click.Context, values: ServeCommand, allowed: Mapping[str, Any]
) -> dict[str, Any]:
    """The settings of runs, for the process that runs the plans."""
    from gpsfsm.cli._model import run_model_settings

    options: dict[str, Any] = {**allowed}
    if values.action_timeout is not None:
        options["timeout_s"] = values.action_timeout
    if values.failure is not None:
        options["failure"] = values.failure
    settings = run_model_settings(context, real=values.real) if values.journal else None
    if settings is not None:
        options["model"] = settings.spec
    if values.journal:
        options |= wanted(values, settings)
    runs = {
        "durability": values.durability,
        "real": values.real,
        "worlds": _worlds(values.worlds),
        "seed": values.seed,
        "speed": values.speed,
        "run_s": values.run_limit,
        "options": options,
    }
    if settings is not None:
        from gpsfsm.cli._model import model_flags

        runs["model"], configured = model_flags(context)
        runs["model_files"] = asdict(configured)
    return runs


def _worlds(files: Sequence[str]) -> list[list[str]]:
    """The names of worlds, and their files. Raises UsageError for two of the same name."""
    by_name = {Path(file).stem: os.path.realpath(file) for file in files}
    if len(by_name) < len(files):
        raise UsageError(
            "two files of --world have the same name; clients choose a world by its name"
        )
    return [[name, file] for name, file in by_name.items()]


def _generator(params: Mapping[str, Any], values: ServeCommand) -> tuple[str, ...]:
    """The command that asks a model for a plan; empty if none is named."""
    if not values.model_name:
        return ()
    from gpsfsm.cli._model import model_words

    words = ["generate", "--task-file", "-", "--no-journal", "--format", "json", "--served"]
    words += model_words(params)
    for folder in values.capabilities:
        words += ["--capabilities", os.path.realpath(folder)]
    if values.robot is not None:
        words += ["--robot", os.path.realpath(values.robot)]
    if not values.builtin_capabilities:
        words.append("--no-builtin-capabilities")
    if values.worlds:
        words += ["--world", os.path.realpath(values.worlds[0])]
    if params["isolated"]:
        words.append("--isolated")
    elif params["config"] is not None:
        words += ["--config", os.path.realpath(params["config"])]
    return (sys.executable, "-P", "-m", "gpsfsm", *words)
