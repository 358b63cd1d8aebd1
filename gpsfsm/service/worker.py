"""A worker: a process that does what one request asks for, then what the next one does.

It is told once what all requests have in common, and how far it gives way to other processes; then
it gets a request after the other. It is ended from outside if one takes too long. Endpoints
work with its ``WorkerContext``: capabilities and limits of the service.
"""

from __future__ import annotations

import gc
import os
import sys
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm import logs
from gpsfsm.analysis.options import DEFAULT_TOTAL_RLIMIT
from gpsfsm.api import CheckSettings
from gpsfsm.checking.option_table import OPTIONS
from gpsfsm.errors import GpsfsmError, is_out_of_memory
from gpsfsm.service.registry import endpoint
from gpsfsm.service.shapes import CONTENT_TYPE, Problem
from gpsfsm.tracing import recording
from gpsfsm.workers import limit_memory
from gpsfsm.workers.parent_link import WARM_PLAN, serve

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Finding
    from gpsfsm.service.registry import Endpoint
    from gpsfsm.service.shapes import ShownFinding, Wishes
    from gpsfsm.syntax import Limits
    from gpsfsm.tasks.task import Task
    from gpsfsm.workers.frames import Message

_NO_MEMORY = "there is not enough memory to answer this"


def main() -> None:
    """Work until the service ends."""
    serve(_prepare)


def _prepare(head: dict[str, Any], _body: bytes) -> Any:
    """Get ready, and return the function that answers requests. Raises GpsfsmError."""
    limit_memory(head["memory_mb"])  # a bound that the system refuses ends this process
    context = _context(head)
    _warm(context)
    _lower_priority(head.get("nice", 0))  # to begin is urgent for all
    return partial(_answer, context)


def _answer(context: WorkerContext, head: dict[str, Any], body: bytes) -> Message:
    wanted, raw = endpoint(head["op"]), head.get("raw") is True
    spans: dict[str, Any] = {}
    if "traceparent" in head:
        with recording() as rows:
            status, answer = do(wanted, raw, body, context)
        spans = {"spans": rows}
    else:
        status, answer = do(wanted, raw, body, context)
    media = "application/json" if status == 200 else CONTENT_TYPE
    return {"status": status, "media": media, "memory_mb": _memory_mb(), **spans}, answer


def _lower_priority(nice: int) -> None:
    """Let others go first, if the system can.

    Linux may share the cores among sessions before it looks at processes; a worker is a session.
    """
    if nice:
        with suppress(AttributeError, OSError):
            os.nice(nice)
        with suppress(OSError):
            Path("/proc/self/autogroup").write_text(str(nice), encoding="ascii")


def do(wanted: Endpoint, raw: bool, body: bytes, context: WorkerContext) -> tuple[int, bytes]:
    """The status and the body of the answer; ``raw``: the body of the request is a plan alone.

    Never raises for what is in the request.
    """
    try:
        return 200, _done(wanted, raw, body, context)
    except Problem as problem:
        return problem.status, problem.body()
    except GpsfsmError as error:
        return 422, Problem(422, str(error)).body()
    except Exception as error:
        if is_out_of_memory(error):
            return 503, Problem(503, _NO_MEMORY).body()
        message = f"the request failed ({type(error).__name__}); this is a defect of gpsfsm"
        logs.failure("request_failed", message, error, endpoint=wanted.name)
        return 500, Problem(500, message).body()


def _done(wanted: Endpoint, raw: bool, body: bytes, context: WorkerContext) -> bytes:
    from gpsfsm.service.shapes import parsed

    assert wanted.request is not None
    assert wanted.work is not None
    if raw:
        request, plan = wanted.request(plan=""), body
    else:
        request = parsed(wanted.request, body)
        plan = str(request.plan).encode("utf-8", "surrogatepass")  # type: ignore[attr-defined]
    return wanted.work(request, plan, context).model_dump_json().encode()


def _context(head: dict[str, Any]) -> WorkerContext:
    """The context that all requests have in common. Raises GpsfsmError."""
    from gpsfsm.capabilities.library import choose_capabilities
    from gpsfsm.service.worker import WorkerContext
    from gpsfsm.syntax import Limits

    capabilities = choose_capabilities(
        head["capabilities"], builtin=head["builtin"], robot=head.get("robot")
    )
    if head.get("allow"):
        from gpsfsm.gating.gate_call import permitting

        capabilities = permitting(capabilities, [(kind, text) for kind, text in head["allow"]])
    return WorkerContext(capabilities, Limits(**head["limits"]))


def _warm(context: WorkerContext) -> None:
    """Load what requests need, so that none waits for it."""
    for module in ("gpsfsm.fixing.engine", "gpsfsm.grading.grader"):
        import_module(module)
    from gpsfsm.service.shapes import Wishes

    for solver in ("auto", "z3"):
        do(endpoint("gate"), True, WARM_PLAN, context)
        wishes = Wishes(solver=solver).model_dump_json().encode()
        body = b'{"plan": "<Plan/>", "options": ' + wishes + b"}"
        do(endpoint("check"), False, body, context)
    gc.collect()
    gc.freeze()  # what is there now stays: no need to look at it again and again


def _memory_mb() -> int:
    """The most memory that this process has ever used."""
    try:
        import resource
    except ImportError:
        return 0
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used >> (20 if sys.platform == "darwin" else 10)


@dataclass(frozen=True, slots=True)
class WorkerContext:
    """The capabilities and limits that all requests have in common."""

    capabilities: Capabilities
    limits: Limits

    def options(self, wishes: Wishes, total_rlimit: int = DEFAULT_TOTAL_RLIMIT) -> CheckOptions:
        """The options that a client wishes. Raises UsageError for what makes no sense.

        ``total_rlimit`` holds where the client does not wish another one.
        """
        wished = {
            option.keyword: getattr(wishes, option.keyword)
            for option in OPTIONS
            if option.service is not None
        }
        wished["total_rlimit"] = wishes.total_rlimit or total_rlimit
        options = CheckSettings(limits=self.limits, **wished).options(self.capabilities)
        return replace(
            options, named=options.named.intersection(wished)
        )  # the limits are the service's


def sent_task(text: str) -> Task:
    """A task that was sent; a client has no business with files of this machine.

    Raises UsageError for one that names files, ConfigError for one that is wrong.
    """
    from gpsfsm.capabilities.defects import Notes
    from gpsfsm.capabilities.reading import read_table
    from gpsfsm.errors import UsageError
    from gpsfsm.tasks.load import read_task

    content = text.encode("utf-8", "replace")
    table = read_table(content, Notes("<task>", kind="task"))
    if table is not None and "not_answers" in table:
        raise UsageError("a task in a request must not name files: leave out not_answers")
    return read_task(content)


def shown(finding: Finding) -> ShownFinding:
    """A finding as answers have it."""
    from gpsfsm.service.shapes import Place, ShownFinding

    place = finding.location
    return ShownFinding(
        rule=finding.rule,
        name=finding.name,
        severity=finding.severity.value,
        message=finding.message,
        hint=finding.hint,
        location=Place(line=place.line, column=place.column, element=place.element),
    )
