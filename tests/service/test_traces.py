"""Traces: what a service sends to a collector over OTLP, and nothing without one."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm import logs
from gpsfsm.errors import UsageError
from gpsfsm.running import queue_answers
from gpsfsm.service.traces import Traces, start_traces
from tests.cli.support import environment
from tests.service.support import GOOD, Service, ended

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytest.importorskip("opentelemetry.sdk", reason="the extra 'otel' is not installed")
pytest.importorskip("opentelemetry.proto", reason="the extra 'otel' is not installed")

TRACE, PARENT = "0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331"
TRACEPARENT = f"00-{TRACE}-{PARENT}-01"


class Collector:
    """A collector of OTLP over HTTP: it decodes what it gets, and keeps it."""

    def __init__(self) -> None:
        from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import (
            ExportTraceServiceRequest,
        )

        self.spans: list[dict[str, Any]] = []
        self.resources: list[dict[str, Any]] = []
        collector = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                assert self.path == "/v1/traces"
                assert self.headers["Content-Type"] == "application/x-protobuf"
                body = self.rfile.read(int(self.headers["Content-Length"]))
                if self.headers.get("Content-Encoding") == "gzip":
                    import gzip

                    body = gzip.decompress(body)
                collector.take(ExportTraceServiceRequest.FromString(body))
                self.send_response(200)
                self.send_header("Content-Type", "application/x-protobuf")
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_: Any) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}"

    def take(self, request: Any) -> None:
        for group in request.resource_spans:
            self.resources.append(attributes(group.resource.attributes))
            for scope in group.scope_spans:
                for span in scope.spans:
                    self.spans.append(
                        {
                            "name": span.name,
                            "trace": span.trace_id.hex(),
                            "id": span.span_id.hex(),
                            "parent": span.parent_span_id.hex(),
                            "kind": span.kind,
                            "status": span.status.code,
                            "ns": (span.start_time_unix_nano, span.end_time_unix_nano),
                            "is": attributes(span.attributes),
                        }
                    )

    def named(self, name: str) -> dict[str, Any]:
        (span,) = (each for each in self.spans if each["name"] == name)
        return span

    def until(self, *names: str) -> None:
        end_s = time.monotonic() + 30
        while not set(names) <= {each["name"] for each in self.spans}:
            assert time.monotonic() < end_s, sorted(each["name"] for each in self.spans)
            time.sleep(0.05)

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def attributes(pairs: Any) -> dict[str, Any]:
    return {
        each.key: each.value.int_value
        if each.value.HasField("int_value")
        else each.value.string_value
        for each in pairs
    }


@pytest.fixture
def collector() -> Iterator[Collector]:
    result = Collector()
    yield result
    result.close()


class Traced(Service):
    """A service with these variables in its environment."""

    def __init__(self, variables: dict[str, str], *words: object) -> None:
        super().__init__(*words)
        self._variables = variables

    def _begun(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, *self.command, *self._words],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=environment(**self._variables),
        )


def test_a_plan_from_its_request_to_its_end(collector: Collector, tmp_path: Path) -> None:
    around = {"OTEL_EXPORTER_OTLP_ENDPOINT": collector.url, "OTEL_BSP_SCHEDULE_DELAY": "100"}
    words = ("--journal", tmp_path / "q.db", "--failure", "0", "--workers", "1")
    with Traced(around, *words) as service:
        with service.client(headers={"traceparent": TRACEPARENT}) as client:
            plan = client.post("/v1/plans?x=secret", json={"plan": GOOD}).json()["plan_id"]
        with service.client() as client:
            ended(client, plan)
        collector.until("run the plan", "POST /v1/plans")
        assert service.stop() == 0
    request, run = collector.named("POST /v1/plans"), collector.named("run the plan")
    assert (request["trace"], request["parent"], request["kind"]) == (TRACE, PARENT, 2)
    said = dict(request["is"])
    assert said.pop("client.address") == "127.0.0.1"
    assert said.pop("server.port") == service.place[1]
    assert said == {
        "http.request.method": "POST",
        "http.response.status_code": 200,
        "http.route": "/v1/plans",
        "network.protocol.version": "1.1",
        "server.address": "127.0.0.1",
        "url.path": "/v1/plans",
        "url.scheme": "http",
    }
    own = [each for each in collector.spans if each["trace"] == TRACE]
    above = {each["id"]: each["name"] for each in own}
    below = {each["name"]: above.get(each["parent"], "") for each in own}
    assert below == {
        "POST /v1/plans": "",
        "wait for a worker": "POST /v1/plans",
        "gpsfsm.gate": "POST /v1/plans",
        "gpsfsm.check": "gpsfsm.gate",
        **dict.fromkeys(("gpsfsm.read", "gpsfsm.compile", "gpsfsm.decide"), "gpsfsm.check"),
        "gpsfsm.rules": "gpsfsm.check",
        "wait in the plan queue": "POST /v1/plans",
        "run the plan": "POST /v1/plans",
    }
    assert run["is"] == {"gpsfsm.plan": plan}
    waited = collector.named("wait in the plan queue")
    assert waited["ns"][0] <= waited["ns"][1] == run["ns"][0] <= run["ns"][1]
    assert {each["service.name"] for each in collector.resources} == {"gpsfsm"}
    others = [each for each in collector.spans if each["name"].endswith("/completion")]
    assert {each["name"] for each in others} == {"POST /v1/plans/{plan}/completion"}
    assert TRACE not in {each["trace"] for each in others}
    assert not any("secret" in str(each) or "a/Go" in str(each) for each in collector.spans)


def test_errors_and_unknown_methods(collector: Collector, tmp_path: Path) -> None:
    around = {
        "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT": f"{collector.url}/v1/traces",
        "OTEL_SERVICE_NAME": "gate-of-hall-3",
    }
    with Traced(around, "--workers", "1", "--time-limit", "0.001") as service:
        with service.client() as client:
            assert client.post("/v1/check", json={"plan": GOOD}).status_code == 504
            assert client.request("BREW", "/v1/rules").status_code == 405
            assert client.get("/v1/rules/x").status_code == 404
        assert service.stop() == 0  # what waits is sent at the end
    late = collector.named("POST /v1/check")
    assert (late["status"], late["is"]["error.type"]) == (2, "504")
    odd = collector.named("HTTP")
    assert (odd["status"], odd["is"]["http.request.method_original"]) == (0, "BREW")
    assert odd["is"]["http.request.method"] == "_OTHER"
    missing = collector.named("GET /v1/rules/{rule}")
    assert (missing["status"], missing["is"]["http.response.status_code"]) == (0, 404)
    assert {each["service.name"] for each in collector.resources} == {"gate-of-hall-3"}


def test_a_client_behind_a_trusted_proxy_is_the_one_that_is_named(collector: Collector) -> None:
    around = {"OTEL_EXPORTER_OTLP_ENDPOINT": collector.url}
    with Traced(around, "--workers", "1", "--trust-proxy", "127.0.0.1") as service:
        with service.client(headers={"x-forwarded-for": "203.0.113.9"}) as client:
            assert client.get("/v1/rules/GP101").status_code == 200
        assert service.stop() == 0
    assert collector.named("GET /v1/rules/{rule}")["is"]["client.address"] == "203.0.113.9"


def test_who_is_not_sampled_is_not_recorded(collector: Collector, tmp_path: Path) -> None:
    around = {"OTEL_EXPORTER_OTLP_ENDPOINT": collector.url}
    with Traced(around, "--workers", "1") as service:
        with service.client(headers={"traceparent": TRACEPARENT[:-1] + "0"}) as client:
            assert client.post("/v1/gate", json={"plan": GOOD}).status_code == 200
        assert service.stop() == 0
    assert collector.spans == []


def test_a_collector_that_is_gone_stops_nobody() -> None:
    around = {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:9", "OTEL_BSP_SCHEDULE_DELAY": "50"}
    with Traced(around, "--workers", "1") as service:
        with service.client() as client:
            for _ in range(3):
                assert client.post("/v1/gate", json={"plan": GOOD}).status_code == 200
        began_s = time.monotonic()
        assert service.stop() == 0
        assert time.monotonic() - began_s < 30
    assert not any("Traceback" in line for line in service.said)


def test_plans_that_were_traced_are_forgotten_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue_answers, "_MOST_TRACED", 3)
    traced = queue_answers.TracedPlans()
    for plan in range(1, 9):
        traced.submitted(plan, {"traceparent": f"parent {plan}"})
        ended = traced.begun(SimpleNamespace(plan=plan, continues=0))  # type: ignore[arg-type]
        message = ended()
        assert message is not None
        assert message["traceparent"] == f"parent {plan}"
    next_one = traced.begun(SimpleNamespace(plan=9, continues=8))()  # type: ignore[arg-type]
    assert next_one is not None
    assert next_one["traceparent"] == "parent 8", "a plan that goes on for another is of its trace"
    assert traced.begun(SimpleNamespace(plan=10, continues=1))() is None  # type: ignore[arg-type]


def test_spans_of_another_process_keep_their_times_and_parents() -> None:
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import SimpleSpanProcessor
    from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

    exporter, provider = InMemorySpanExporter(), TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(exporter))
    traces = Traces(provider)
    assert traces
    assert traces.header() == ""
    with traces.span("outer"):
        header = traces.header()
        assert header.startswith("00-")
        assert int(header[-2:], 16) & 1, "it is sampled"
    rows = [
        ["a", 10, 90, -1, {"n": 1}, ""],
        ["b", 20, 30, 0, {}, "KeyError"],
        ["c", 40, 0, 0, {}, ""],
    ]
    traces.add(rows, TRACEPARENT)
    spans = {each.name: each for each in exporter.get_finished_spans()}
    parent = {name: each.parent.span_id for name, each in spans.items() if each.parent}
    assert parent["a"] == int(PARENT, 16)
    assert parent["b"] == parent["c"] == spans["a"].context.span_id
    assert (spans["a"].start_time, spans["a"].end_time) == (10, 90)
    assert (spans["c"].start_time, spans["c"].end_time) == (40, 40)
    assert spans["b"].attributes == {"error.type": "KeyError"}


@pytest.mark.parametrize(
    ("wanted", "around", "on"),
    [
        (None, {}, False),
        (False, {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://x"}, False),
        (True, {"OTEL_SDK_DISABLED": "true"}, False),
        (True, {"OTEL_TRACES_EXPORTER": "none"}, False),
        (True, {}, True),
        (None, {"OTEL_EXPORTER_OTLP_TRACES_ENDPOINT": "http://x"}, True),
        (
            True,
            {
                "OTEL_EXPORTER_OTLP_PROTOCOL": "grpc",
                "OTEL_EXPORTER_OTLP_TRACES_PROTOCOL": "http/protobuf",
            },
            True,
        ),
    ],
)
def test_what_turns_them_on(wanted: bool | None, around: dict[str, str], on: bool) -> None:
    traces = start_traces(wanted, around)
    assert bool(traces) is on
    traces.close()


@pytest.mark.parametrize(
    ("around", "names"),
    [
        ({"OTEL_TRACES_EXPORTER": "console"}, "OTEL_TRACES_EXPORTER"),
        ({"OTEL_EXPORTER_OTLP_PROTOCOL": "grpc"}, "OTEL_EXPORTER_OTLP_PROTOCOL"),
    ],
)
def test_what_it_cannot_do_it_says(around: dict[str, str], names: str) -> None:
    with pytest.raises(UsageError, match=f"{names} is '(console|grpc)', but gpsfsm"):
        start_traces(True, around)


@pytest.mark.parametrize("name", ["OTEL_BSP_MAX_QUEUE_SIZE", "OTEL_SPAN_ATTRIBUTE_COUNT_LIMIT"])
def test_a_variable_that_opentelemetry_refuses_is_no_defect(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv(name, "-1")
    with pytest.raises(UsageError, match="OpenTelemetry cannot start with these OTEL_ variables: "):
        start_traces(True, {})


def test_without_the_extra_it_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "opentelemetry.sdk.trace", None)
    with pytest.raises(UsageError, match=r"pip install 'gpsfsm\[otel\]'"):
        start_traces(True, {})
    with logs.writing("info", "text"):
        assert not start_traces(None, {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://x"})
    assert "OTEL_EXPORTER_OTLP_ENDPOINT is set, but OpenTelemetry" in capsys.readouterr().err


def test_without_traces_nothing_of_it_is_loaded() -> None:
    code = (
        "import sys, asyncio\n"
        "from gpsfsm.service import Settings, app\n"
        "app(Settings())\n"
        "print([name for name in sys.modules if name.startswith('opentelemetry')])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"
