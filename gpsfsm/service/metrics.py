"""What the service counts, in the text format of Prometheus."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = ["MEDIA", "Gauge", "Metrics"]

MEDIA = "text/plain; version=0.0.4; charset=utf-8"

_BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


class Gauge(NamedTuple):
    """A value that is measured when somebody looks; ``labels`` as the format has them."""

    name: str
    help: str
    value: float
    labels: str = ""


class Metrics:
    """Counts requests. Labels are names of endpoints and statuses, never what a client sends."""

    def __init__(self) -> None:
        self._requests: Counter[tuple[str, int]] = Counter()
        self._buckets: dict[str, list[int]] = {}
        self._seconds: dict[str, float] = {}

    def answered(self, endpoint: str, status: int, seconds: float) -> None:
        """Count an answer."""
        self._requests[endpoint, status] += 1
        buckets = self._buckets.setdefault(endpoint, [0] * (len(_BOUNDS_S) + 1))
        buckets[bisect_left(_BOUNDS_S, seconds)] += 1
        self._seconds[endpoint] = self._seconds.get(endpoint, 0.0) + seconds

    def text(self, gauges: Iterable[Gauge]) -> str:
        """All of it; of ``gauges`` those of one name follow one another."""
        return "".join(f"{line}\n" for line in self._lines(gauges))

    def _lines(self, gauges: Iterable[Gauge]) -> Iterator[str]:
        yield from _head("gpsfsm_info", "gauge", "The version of gpsfsm.")
        yield f'gpsfsm_info{{version="{VERSION}"}} 1'
        yield from _head("gpsfsm_requests_total", "counter", "Requests by endpoint and status.")
        for (name, status), count in sorted(self._requests.items()):
            yield f'gpsfsm_requests_total{{endpoint="{name}",status="{status}"}} {count}'
        name = "gpsfsm_request_seconds"
        yield from _head(name, "histogram", "How long requests take.")
        for endpoint, buckets in sorted(self._buckets.items()):
            yield from self._histogram(name, endpoint, buckets)
        last = ""
        for gauge in sorted(gauges, key=lambda each: each.name):
            name = f"gpsfsm_{gauge.name}"
            if name != last:
                kind = "counter" if name.endswith("_total") else "gauge"
                yield from _head(name, kind, gauge.help)
            labels = f"{{{gauge.labels}}}" if gauge.labels else ""
            yield f"{name}{labels} {gauge.value:.15g}"
            last = name

    def _histogram(self, name: str, endpoint: str, buckets: list[int]) -> Iterator[str]:
        total = 0
        for bound, count in zip((*_BOUNDS_S, None), buckets, strict=True):
            total += count
            le = "+Inf" if bound is None else f"{bound:g}"
            yield f'{name}_bucket{{endpoint="{endpoint}",le="{le}"}} {total}'
        yield f'{name}_sum{{endpoint="{endpoint}"}} {self._seconds[endpoint]:.6f}'
        yield f'{name}_count{{endpoint="{endpoint}"}} {total}'


def _head(name: str, kind: str, text: str) -> Iterator[str]:
    yield f"# HELP {name} {text}"
    yield f"# TYPE {name} {kind}"
