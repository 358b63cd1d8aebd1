"""A Ray cluster: ``--jobs ray`` or ``--jobs ray://HOST:PORT`` (docs/scale.md).

A chunk is a task. Ray itself tries none of them again: what is lost is for ``workers.engines`` to
decide, which divides a chunk that ends its process instead of losing another process to it.
"""

from __future__ import annotations

import math
import os
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InternalError, UsageError, installing
from gpsfsm.late import pattern
from gpsfsm.version import VERSION
from gpsfsm.workers.engines import Kind, Lost

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.workers.engines import Chunk, Item, Result, Source, Work

LARGEST = 200
"""The most items of a chunk: what a task costs is next to nothing then."""
_ROUNDS = 4
"""A cluster gets so many chunks for each core at least, so that all cores end at the same time."""
_AHEAD = 2
"""So many chunks are under way for each core: one is worked on, one waits at its side."""
_PATIENCE_S = 60.0
"""A cluster that has had no core for so many seconds will get none."""
_LOOK_S = 5.0
_ADDRESS = pattern(r"ray(://[A-Za-z0-9_.\-\[\]:]{1,200}:[0-9]{1,5})?")
_SILENCE = "RAY_DEDUP_LOGS_SKIP_REGEX"


def _do(work: Work[Item, Result], items: Sequence[Item]) -> tuple[str, list[Result] | UsageError]:
    """The task: the version of gpsfsm that did it, and the results."""
    try:
        return VERSION, [work(item) for item in items]
    except UsageError as error:
        return VERSION, error


class RayCluster:
    """An engine that is a Ray cluster.

    ``ray``: the one that RAY_ADDRESS names or that runs on this machine, or else one that lives as
    long as the engine does. ``ray://HOST:PORT``: a remote one, through Ray's client.
    """

    def __init__(self, address: str, items: int | None) -> None:
        self._ray = _import(address)
        self._address = address if "://" in address else None
        self._items = items
        self._ours = False
        self.ahead = 1
        self.chunk_size = LARGEST

    def __enter__(self) -> RayCluster:
        ray = self._ray
        self._ours = not ray.is_initialized()  # whoever calls us may use Ray as well
        if self._ours:
            self._begin()
        cores = max(1, int(self._cores()))
        self.ahead = _AHEAD * cores
        if self._items is not None:
            self.chunk_size = max(1, min(LARGEST, math.ceil(self._items / (_ROUNDS * cores))))
        return self

    def __exit__(self, *_: object) -> None:
        if self._ours:
            self._ray.shutdown()

    def map(
        self, work: Work[Item, Result], source: Source[Item], /
    ) -> Iterator[tuple[Chunk[Item], Sequence[Result] | Lost]]:
        """Each chunk with its results, as they come in."""
        ray = self._ray
        task = ray.remote(max_retries=0)(_do)
        shared = ray.put(work)
        flying: dict[Any, Chunk[Item]] = {}
        try:
            while True:
                while len(flying) < self.ahead and (chunk := source.take()) is not None:
                    flying[task.remote(shared, chunk.items)] = chunk
                if not flying:
                    return
                for reference in self._wait(list(flying)):
                    chunk = flying.pop(reference)
                    yield chunk, self._results(reference)
        finally:
            for reference in flying:
                with suppress(Exception):  # whatever Ray says, it is not wanted any more
                    ray.cancel(reference, force=True)

    def _begin(self) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # a check tells nobody of itself
        where = {} if self._address is None else {"address": self._address}
        try:
            self._ray.init(logging_level="ERROR", log_to_driver=False, **where)
        except Exception as error:  # its kinds are as many as the ways to fail
            named = self._address or os.environ.get("RAY_ADDRESS") or "on this machine"
            message = f"Ray {named} cannot be used: {_short(error)}"
            hint = "see 'ray status' there; a remote cluster needs the same versions of Ray"
            raise UsageError(f"{message}\n  {hint} and Python") from error

    def _cores(self) -> float:
        return float(self._ray.cluster_resources().get("CPU", 0.0))

    def _wait(self, references: list[Any]) -> list[Any]:
        """The tasks that have ended, at least one. Raises UsageError if nobody is left to work."""
        since = time.monotonic()
        while True:
            ended, _ = self._ray.wait(references, timeout=_LOOK_S)
            if ended:
                return list(ended)
            if self._cores() >= 1:
                since = time.monotonic()
            elif time.monotonic() - since > _PATIENCE_S:
                raise UsageError(f"the Ray cluster has had no core for {_PATIENCE_S:g} s")

    def _results(self, reference: Any) -> Sequence[Any] | Lost:
        """The results of a task that has ended, or how it was lost. Raises UsageError."""
        errors = self._ray.exceptions
        try:
            version, results = self._ray.get(reference)
        except errors.NodeDiedError:
            return Lost("was lost with its machine", with_node=True)
        except (errors.ObjectLostError, errors.LocalRayletDiedError):  # answered, then lost
            return Lost("was lost with its machine", with_node=True)
        except (errors.WorkerCrashedError, errors.OutOfMemoryError):
            return Lost("was ended; the memory may have run out")
        except errors.RayTaskError as error:
            raise InternalError(f"the work failed on Ray: {_short(error.cause)}") from error
        except Exception as error:
            message = f"Ray's workers cannot run gpsfsm: {_short(error)}"
            raise UsageError(f"{message}\n  install gpsfsm {VERSION} on every machine") from error
        if version != VERSION:
            message = f"a machine of the Ray cluster has gpsfsm {version}, this one has {VERSION}"
            raise UsageError(
                f"{message}; results could differ: install the same version everywhere"
            )
        if isinstance(results, UsageError):
            raise results
        whole: Sequence[Any] = results
        return whole


def _import(jobs: str) -> Any:
    """Ray. Raises UsageError if it is not installed.

    Ray prints what happens to its machines to standard output, where a report is to stand, unless
    this variable tells it not to when it is imported.
    """
    silent = "ray" not in sys.modules and _SILENCE not in os.environ
    if silent:
        os.environ[_SILENCE] = "."
    try:
        import ray
    except ImportError as error:
        needed = f"--jobs {jobs} needs Ray, which is not installed"
        raise UsageError(f"{needed}: {installing('ray')}") from error
    finally:
        if silent:
            del os.environ[_SILENCE]
    return ray


def _short(error: object) -> str:
    """The last line that says something: Ray puts whole logs into its errors."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[-1] if lines else type(error).__name__)[:300]


KIND = Kind(
    order=3,
    forms="ray, or ray://HOST:PORT",
    accepts=lambda jobs: _ADDRESS.fullmatch(jobs) is not None,
    make=RayCluster,
)
