"""A worker: a process that does what one request asks for, then what the next one does.

``python -m gpsfsm.service.worker [NICE]``. It is told once what all requests have in common, and
then gets a request after the other; it is ended from outside if one takes too long. NICE is how far
it gives way to other processes.
"""

from __future__ import annotations

import gc
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError, is_out_of_memory
from gpsfsm.service.problems import CONTENT_TYPE, Problem
from gpsfsm.service.registry import endpoint
from gpsfsm.workers.line import Line
from gpsfsm.workers.memory import limit_memory

if TYPE_CHECKING:
    from gpsfsm.service.kitchen import Kitchen
    from gpsfsm.service.registry import Endpoint

__all__ = ["do", "main"]

_WARM = b"""<Plan><Control type="parallel_all"><Runner interface="a/A" provider="a/A"/>
<Runner interface="a/B" provider="a/B"/></Control></Plan>"""
_NO_MEMORY = "there is not enough memory to answer this"


def main() -> None:
    """Work until the service ends."""
    line = Line()
    head, _ = line.messages.get()
    limit_memory(head["memory_mb"])
    try:
        kitchen = _kitchen(head)
        _warm(kitchen)
    except GpsfsmError as error:
        line.say({"failed": str(error)})
        return
    _give_way(int(sys.argv[1]) if len(sys.argv) > 1 else 0)  # to begin is urgent for all
    line.say({"ready": True})
    while True:
        head, body = line.messages.get()
        status, answer = do(endpoint(head["op"]), head.get("raw") is True, body, kitchen)
        media = "application/json" if status == 200 else CONTENT_TYPE
        line.say({"status": status, "media": media, "memory_mb": _memory_mb()}, answer)


def _give_way(nice: int) -> None:
    """Let others go first, if the system can.

    Linux may share the cores among sessions before it looks at processes; a worker is a session.
    """
    if nice:
        with suppress(AttributeError, OSError):
            os.nice(nice)
        with suppress(OSError):
            Path("/proc/self/autogroup").write_text(str(nice), encoding="ascii")


def do(wanted: Endpoint, raw: bool, body: bytes, kitchen: Kitchen) -> tuple[int, bytes]:
    """The status and the body of the answer; ``raw``: the body of the request is a plan alone.

    Never raises for what is in the request.
    """
    try:
        return 200, _done(wanted, raw, body, kitchen)
    except Problem as problem:
        return problem.status, problem.body()
    except GpsfsmError as error:
        return 422, Problem(422, str(error)).body()
    except Exception as error:
        if is_out_of_memory(error):
            return 503, Problem(503, _NO_MEMORY).body()
        message = f"the request failed ({type(error).__name__}); this is a defect of gpsfsm"
        return 500, Problem(500, message).body()


def _done(wanted: Endpoint, raw: bool, body: bytes, kitchen: Kitchen) -> bytes:
    from gpsfsm.service.bodies import parsed  # noqa: PLC0415  (loads pydantic)

    assert wanted.request is not None
    assert wanted.work is not None
    if raw:
        request, plan = wanted.request(plan=""), body
    else:
        request = parsed(wanted.request, body)
        plan = str(request.plan).encode("utf-8", "surrogatepass")  # type: ignore[attr-defined]
    return wanted.work(request, plan, kitchen).model_dump_json().encode()


def _kitchen(head: dict[str, Any]) -> Kitchen:
    """What all requests have in common. Raises GpsfsmError."""
    from gpsfsm.capabilities.choice import choose_capabilities  # noqa: PLC0415
    from gpsfsm.service.kitchen import Kitchen  # noqa: PLC0415
    from gpsfsm.syntax import Limits  # noqa: PLC0415

    capabilities = choose_capabilities(head["capabilities"], builtin=head["builtin"])
    return Kitchen(capabilities, Limits(**head["limits"]))


def _warm(kitchen: Kitchen) -> None:
    """Load what requests need, so that none waits for it."""
    import gpsfsm.fixing.engine  # noqa: PLC0415
    import gpsfsm.grading  # noqa: F401, PLC0415
    from gpsfsm.service.shapes import Wishes  # noqa: PLC0415

    for solver in ("auto", "z3"):
        do(endpoint("gate"), True, _WARM, kitchen)
        wishes = Wishes(solver=solver).model_dump_json().encode()
        body = b'{"plan": "<Plan/>", "options": ' + wishes + b"}"
        do(endpoint("check"), False, body, kitchen)
    gc.collect()
    gc.freeze()  # what is there now stays: no need to look at it again and again


def _memory_mb() -> int:
    """The most memory that this process has ever used."""
    try:
        import resource  # noqa: PLC0415  (not on every system)
    except ImportError:
        return 0
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used >> (20 if sys.platform == "darwin" else 10)


if __name__ == "__main__":
    main()
