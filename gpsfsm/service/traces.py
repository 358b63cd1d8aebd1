"""Traces of the service, by OpenTelemetry, which the extra ``otel`` brings.

The service alone speaks to the collector. Workers, and the process that runs the plans, hand their
spans over as data (``gpsfsm.tracing``), beneath the span whose ``traceparent`` came with their
work. Without traces nothing of OpenTelemetry is loaded.

    POST /v1/plans                      of the service
    ├── wait for a worker
    ├── gpsfsm.gate ── gpsfsm.check …   of a worker
    ├── wait in the plan queue          of the process that runs the plans
    └── run the plan
"""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from gpsfsm import logs
from gpsfsm.errors import UsageError, installing
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.trace import Tracer
    from starlette.types import Scope

    from gpsfsm.tracing import Row

_ENDPOINTS = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
_PROTOCOLS = ("OTEL_EXPORTER_OTLP_TRACES_PROTOCOL", "OTEL_EXPORTER_OTLP_PROTOCOL")
_NAME, _RESOURCE = "OTEL_SERVICE_NAME", "OTEL_RESOURCE_ATTRIBUTES"
_PARENT = "traceparent"
_METHODS = frozenset(
    ("CONNECT", "DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT", "TRACE")
)
_OTHER = "_OTHER"
"""What the conventions call a method that nobody knows."""
_FLUSH_S = 3.0
_INSTALL = installing("otel")


class Traces:
    """The spans of a service; without a provider there are none, and nothing costs time."""

    def __init__(self, provider: TracerProvider | None = None) -> None:
        self._provider = provider
        self._tracer: Tracer | None = None
        if provider is not None:
            self._tracer = provider.get_tracer("gpsfsm", VERSION)

    def __bool__(self) -> bool:
        return self._tracer is not None

    def request(self, scope: Scope, address: str) -> AbstractContextManager[RequestSpan]:
        """The span of a request, in the trace that its ``traceparent`` names."""
        if self._tracer is None:
            return nullcontext(_NO_SPAN)
        return self._request(self._tracer, scope, address)

    @contextmanager
    def _request(self, tracer: Tracer, scope: Scope, address: str) -> Iterator[RequestSpan]:
        from opentelemetry import propagate, trace

        sent = {key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]}
        method = scope["method"] if scope["method"] in _METHODS else _OTHER
        attributes: dict[str, Any] = {
            "http.request.method": method,
            "url.path": scope["path"][:1_000],
            "url.scheme": scope["scheme"],
            "network.protocol.version": scope["http_version"],
            "client.address": address,
        }
        if method == _OTHER:
            attributes["http.request.method_original"] = scope["method"][:100]
        if scope.get("server"):
            attributes["server.address"], attributes["server.port"] = scope["server"]
        with tracer.start_as_current_span(
            "HTTP" if method == _OTHER else method,
            context=propagate.extract(sent),
            kind=trace.SpanKind.SERVER,
            attributes={name: value for name, value in attributes.items() if value is not None},
            record_exception=False,  # its text may hold a plan
            set_status_on_exception=False,
        ) as span:
            yield RequestSpan(span)

    def span(self, name: str) -> AbstractContextManager[object]:
        """A span of the service itself, below that of the request."""
        if self._tracer is None:
            return nullcontext()
        return self._tracer.start_as_current_span(
            name, record_exception=False, set_status_on_exception=False
        )

    def header(self) -> str:
        """The ``traceparent`` of the span of this moment; "" if nobody records it."""
        if self._tracer is None:
            return ""
        from opentelemetry import trace
        from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

        if not trace.get_current_span().is_recording():
            return ""
        carrier: dict[str, str] = {}
        TraceContextTextMapPropagator().inject(carrier)
        return carrier.get(_PARENT, "")

    def add(self, rows: Sequence[Row], parent: str) -> None:
        """Add the spans of another process, below the one with this ``traceparent``."""
        if self._tracer is None or not rows:
            return
        from opentelemetry import trace
        from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

        above = TraceContextTextMapPropagator().extract({_PARENT: parent})
        spans: list[trace.Span] = []
        for name, began_ns, _, at, attributes, error in rows:
            assert at < len(spans), "a span comes before its parent"
            context = above if at < 0 else trace.set_span_in_context(spans[at])
            span = self._tracer.start_span(
                name, context, attributes=attributes, start_time=began_ns
            )
            if error:
                span.set_attribute("error.type", error)
                span.set_status(trace.StatusCode.ERROR)
            spans.append(span)
        for span, row in zip(spans, rows, strict=True):
            span.end(row[2] or row[1])

    def close(self) -> None:
        """Send what is left, if the collector takes it soon; may take some seconds."""
        if self._provider is not None:
            ending = threading.Thread(target=self._provider.shutdown, daemon=True)
            ending.start()
            ending.join(_FLUSH_S)


class RequestSpan:
    """The span of a request; ``span`` None: there is none."""

    def __init__(self, span: Any = None) -> None:
        self._span = span

    @property
    def trace_id(self) -> str | None:
        """The number of the trace, in hexadecimal digits."""
        if self._span is None:
            return None
        return format(self._span.get_span_context().trace_id, "032x")

    def answered(self, method: str, route: str, status: int, address: str) -> None:
        """Note how it was answered; ``route`` is "" where nothing stands.

        ``address`` is that of the client, which a trusted proxy may have named since.
        """
        if self._span is None:
            return
        self._span.set_attribute("http.response.status_code", status)
        self._span.set_attribute("client.address", address)
        if route:
            self._span.set_attribute("http.route", route)
            self._span.update_name(f"{method} {route}")
        if status >= 500:
            from opentelemetry.trace import StatusCode

            self._span.set_attribute("error.type", str(status))
            self._span.set_status(StatusCode.ERROR)


_NO_SPAN = RequestSpan()


def start_traces(wanted: bool | None, environment: Mapping[str, str] | None = None) -> Traces:
    """The traces of a service, which the variables of OpenTelemetry configure.

    ``wanted`` None: if one of them names a collector. Raises UsageError for what cannot be done.
    """
    around = os.environ if environment is None else environment
    named = next((name for name in _ENDPOINTS if around.get(name)), "")
    switched_off = around.get("OTEL_SDK_DISABLED", "").strip().lower() == "true"
    exporter = around.get("OTEL_TRACES_EXPORTER", "").strip() or "otlp"
    if wanted is False or (wanted is None and not named) or switched_off or exporter == "none":
        return Traces()
    if exporter != "otlp":
        what = f"OTEL_TRACES_EXPORTER is '{exporter[:40]}'"
        raise UsageError(f"{what}, but gpsfsm exports traces as otlp only; set otlp or none")
    # That of traces counts for traces; the other one may be for what else is exported.
    chosen = next((name for name in _PROTOCOLS if around.get(name, "").strip()), "")
    protocol = around.get(chosen, "").strip() or "http/protobuf"
    if protocol != "http/protobuf":
        what = f"{chosen} is '{protocol[:40]}'"
        raise UsageError(f"{what}, but gpsfsm speaks http/protobuf only (usually port 4318)")
    try:
        return Traces(_provider(around))
    except ValueError as error:  # of a variable that OpenTelemetry itself reads
        what = "OpenTelemetry cannot start with these OTEL_ variables"
        raise UsageError(f"{what}: {error}") from None
    except ImportError as error:
        if wanted:
            raise UsageError(f"--otel needs OpenTelemetry: {_INSTALL} ({error})") from error
        logs.event(
            "warning",
            "traces_off",
            f"{named} is set, but OpenTelemetry is not installed, so there are no traces: "
            f"{_INSTALL}, or start with --no-otel",
        )
        return Traces()


def _provider(around: Mapping[str, str]) -> TracerProvider:
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
    from opentelemetry.sdk.resources import Resource
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor

    about = {"service.version": VERSION}
    if not around.get(_NAME) and "service.name=" not in around.get(_RESOURCE, ""):
        about["service.name"] = "gpsfsm"
    provider = TracerProvider(resource=Resource.create(about), shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    return provider
