"""Real runners: which they are, and what they may reach."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.cli._runs import texts
from gpsfsm.errors import GpsfsmError
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.capabilities.describe import LeastFile
    from gpsfsm.cli._drive import Interrupt
    from gpsfsm.cli._runs import Prepared
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.registry import Maker
    from gpsfsm.generation.service import ModelService

__all__ = ["real", "real_maker", "refuse_unbound"]

_SERVICES = {
    "allow_host": "allow_hosts",
    "allow_program": "allow_programs",
    "allow_function": "allow_functions",
}
"""The options about what real runners may reach, and the services in which they find them."""

_NOT_REAL = "the plan cannot be run for real:"
_MOST_FILES = 8


def real_maker(prepared: Prepared, model: ModelService | None = None) -> Maker:
    """Where the real runners of a plan come from.

    Raises GpsfsmError if one is not described or not installed, or wants to ask a model and there
    is none.
    """
    maker, runners = _maker(prepared)
    problems = maker.problems(runners)
    if not problems and model is None:
        asking = [names for names in runners if hasattr(maker.runner_class(*names), "asks_model")]
        problems = [f"{name} asks a language model; name one with --model" for name, _ in asking]
    if problems:
        raise GpsfsmError("\n".join((_NOT_REAL, *problems, *_to_write(prepared, maker, runners))))
    return maker


def refuse_unbound(prepared: Prepared) -> None:
    """Raises GpsfsmError if names of a plan stand for no runner that a check knows.

    A check lets most of such plans pass: it finds nothing in what no file describes.
    """
    maker, runners = _maker(prepared)
    told = maker.unbound(runners)
    if told:
        lines = _to_write(prepared, maker, runners)
        raise GpsfsmError("\n".join((_NOT_REAL, *told, *lines)))


def _maker(prepared: Prepared) -> tuple[Maker, tuple[tuple[str, str], ...]]:
    from gpsfsm.execution.registry import Maker  # noqa: PLC0415

    kernel = prepared.kernel()
    allow = texts(prepared.heading.options, "allow_module")
    return Maker(prepared.library, allow=allow, bound=kernel.bound), kernel.runners


def _to_write(
    prepared: Prepared, maker: Maker, runners: Iterable[tuple[str, str]]
) -> Iterator[str]:
    """What to write so that runners are described that are not."""
    from gpsfsm.capabilities.describe import least_files  # noqa: PLC0415  (few plans need it)

    files: dict[LeastFile, None] = {}
    nameless: dict[str, None] = {}
    for key in maker.undescribed(runners):
        found = least_files(prepared.library, *key)
        files |= dict.fromkeys(found)
        if not found:
            nameless[key[1] or key[0]] = None
    for name in nameless:
        yield (
            f"no file can describe '{clip(name, 100)}': write the names as package/Name, "
            "in letters, digits and underscores"
        )
    if not files:
        return
    yield (
        "describe what is missing: write these files into a folder, say in them what the runners "
        "take, give and hold, and name the folder with --capabilities:"
    )
    for file in [*files][:_MOST_FILES]:
        yield f"  add to {file.path}:" if file.exists else f"  {file.path}:"
        yield from (f"    {line}" for line in file.lines)
    if len(files) > _MOST_FILES:
        yield f"  and {len(files) - _MOST_FILES} more files like these"


def real(
    prepared: Prepared,
    kernel: Kernel,
    sink: Sink,
    interrupt: Interrupt,
    *,
    plans: PlanService | None = None,
    model: ModelService | None = None,
    rows: Iterable[Row] = (),
) -> RealtimeDriver:
    """A driver in real time, with runners that really act; ``rows`` are what has happened.

    Raises GpsfsmError if a runner of the plan is not installed.
    """
    from gpsfsm.capabilities.specs import specs  # noqa: PLC0415
    from gpsfsm.execution.prompts import FillsWritten, PromptBuffers  # noqa: PLC0415
    from gpsfsm.execution.realtime import RealtimeDriver  # noqa: PLC0415  (loads asyncio)

    options = prepared.heading.options
    services: dict[str, Any] = {name: texts(options, key) for key, name in _SERVICES.items()}
    if plans is not None:
        services["plans"] = plans
    maker, prompts = real_maker(prepared, model), PromptBuffers()
    services |= {"prompts": prompts, "specs": specs(prepared.library)}
    if model is not None:
        services["model"] = model
    timeout_s = options.get("timeout_s")
    driver = RealtimeDriver(
        kernel,
        sink,
        maker,
        seed=prepared.heading.seed,
        run_id=str(options.get("nonce", "")),
        services=services,
        depends_on=maker.depends_on,
        timeout_s=timeout_s if isinstance(timeout_s, int | float) else None,
    )
    fills = FillsWritten(kernel, prompts, maker.runner_class)
    fills.take(rows)
    driver.watchers.append(fills)
    interrupt.action = lambda: driver.cancel("interrupted")
    interrupt.turned = lambda paused: driver.pause() if paused else driver.resume()
    return driver
