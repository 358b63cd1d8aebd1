"""The service under load: ``python benchmarks/service_load.py [REQUESTS [CYCLES]]``.

Sends REQUESTS plans (7,200: two a second for an hour) to the gate of a service on this machine as
fast as it answers, while hostile clients do what they can; then kills and stops a service CYCLES
times (6) while clients queue plans. Prints the result, and with that many requests writes it into
docs/service.md. It fails if a request fails, or a plan is lost or runs twice.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import random
import re
import sys
import tempfile
import textwrap
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.service.support import Service, ended, slow_plan  # noqa: E402
from tests.service.test_killed import PLAN, Load, check  # noqa: E402

PAGE = ROOT / "docs" / "service.md"
BLOCK = re.compile(r"(<!-- load -->\n).*?(<!-- /load -->)", re.DOTALL)
SHARED = ROOT.parent / "shared" / "corpus"
CLIENTS = 16
CROWD = 1_000
FULL = 7_200
_STATUS = re.compile(rb"HTTP/1.1 (\d+)")
_LENGTH = re.compile(rb"content-length: *(\d+)", re.IGNORECASE)


@dataclass
class Phase:
    """What came of the requests of one phase."""

    name: str
    seconds: list[float] = field(default_factory=list)
    statuses: Counter[int] = field(default_factory=Counter)
    began_s: float = field(default_factory=time.monotonic)
    took_s: float = 0.0

    def late_ms(self) -> float:
        """The 99th percentile."""
        return sorted(self.seconds)[int(len(self.seconds) * 0.99)] * 1000

    def row(self) -> str:
        ordered = sorted(self.seconds)
        parts = [ordered[int(len(ordered) * share)] * 1000 for share in (0.5, 0.99)]
        failed = sum(count for status, count in self.statuses.items() if status != 200)
        rate = len(ordered) / self.took_s
        middle, late = (f"{part:,.1f}" for part in parts)
        most = f"{ordered[-1] * 1000:,.0f}"
        return f"| {self.name} | {len(ordered):,} | {rate:,.0f} | {middle} | {late} | {most} | {failed} |"  # noqa: E501


def corpus() -> tuple[list[bytes], str]:
    """The texts of plans, and where they are from."""
    folder, name = (SHARED, "real plans") if SHARED.is_dir() else (ROOT / "corpus", "plans")
    texts = [
        text for file in sorted(folder.rglob("*.xml")) if b"<Plan" in (text := file.read_bytes())
    ]
    texts = [text for text in texts if len(text) < 100_000]
    random.Random(4).shuffle(texts)  # noqa: S311
    return texts, f"{len(texts):,} {name}"


def request(text: bytes, media: str = "application/xml") -> bytes:
    head = f"POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nContent-Type: {media}\r\n"
    return f"{head}Content-Length: {len(text)}\r\n\r\n".encode() + text


async def answer(reader: asyncio.StreamReader) -> int:
    head = await reader.readuntil(b"\r\n\r\n")
    length = _LENGTH.search(head)
    assert length is not None
    await reader.readexactly(int(length[1]))
    status = _STATUS.match(head)
    assert status is not None
    return int(status[1])


async def ask(service: Service, texts: itertools.cycle[bytes], left: list[int], to: Phase) -> None:
    """One client that keeps its connection."""
    reader, writer = await asyncio.open_connection(*service.place)
    while left[0] > 0:
        left[0] -= 1
        began_s = time.monotonic()
        writer.write(request(next(texts)))
        to.statuses[await answer(reader)] += 1
        to.seconds.append(time.monotonic() - began_s)
    writer.close()


async def phase(
    service: Service, name: str, texts: list[bytes], requests: int, clients: int = CLIENTS
) -> Phase:
    phase_, left, cycle = Phase(name), [requests], itertools.cycle(texts)
    await asyncio.gather(*(ask(service, cycle, left, phase_) for _ in range(clients)))
    phase_.took_s = time.monotonic() - phase_.began_s
    return phase_


async def slowloris(service: Service, seconds: float) -> None:
    """A client that sends a byte now and then, and comes again when it is cut off."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        with suppress(OSError):
            _, writer = await asyncio.open_connection(*service.place)
            writer.write(b"POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nX: ")
            while time.monotonic() < until_s and not writer.is_closing():
                writer.write(b"x")
                await writer.drain()
                await asyncio.sleep(0.5)
            writer.close()


async def once(service: Service, content: bytes) -> int:
    """The status of one request on a connection of its own; 0 if there was no answer."""
    try:
        reader, writer = await asyncio.open_connection(*service.place)
        writer.write(content)
        status = await answer(reader)
        writer.close()
    except (OSError, EOFError, asyncio.IncompleteReadError):
        return 0
    return status


async def hostile(
    service: Service, texts: list[bytes], requests: int
) -> tuple[Phase, Counter[int]]:
    """Ordinary requests while hostile clients do their worst; what the hostile ones were told."""
    slow = json.dumps({"plan": slow_plan(), "options": {"consistent": True}}).encode()
    deep = json.dumps({"plan": "<Plan>" + "<Control type='sequential'>" * 5_000}).encode()
    bad = [
        request(slow, "application/json"),
        request(deep, "application/json"),
        request(b"[" * 100_000, "application/json"),
        request(b"x" * (3 << 20)),
        b"nonsense\r\n\r\n",
    ]
    statuses: Counter[int] = Counter()

    async def attack() -> None:
        for content in itertools.islice(itertools.cycle(bad), 15):
            statuses[await once(service, content)] += 1

    drips = [asyncio.create_task(slowloris(service, 3_600)) for _ in range(100)]
    phase_result, _ = await asyncio.gather(
        phase(service, "100 slow senders, 15 hostile requests", texts, requests), attack()
    )
    for drip in drips:
        drip.cancel()
    await asyncio.gather(*drips, return_exceptions=True)
    return phase_result, statuses


async def crowd(service: Service, texts: list[bytes]) -> Counter[int]:
    """What 1,000 clients are told that all ask at the same time."""
    content = request(texts[0])
    return Counter(await asyncio.gather(*(once(service, content) for _ in range(CROWD))))


def memory_mb(service: Service) -> tuple[float, float]:
    """What the service uses, and its largest worker."""
    own = rss_mb(service.process.pid)
    return own, max(map(rss_mb, service.children()), default=0.0)


def rss_mb(process: int) -> float:
    with suppress(OSError):
        for line in Path(f"/proc/{process}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                return int(line.split()[1]) / 1024
    return 0.0


def under_load(requests: int) -> list[str]:
    texts, name = corpus()
    with Service("--time-limit", "5") as service:
        first = asyncio.run(phase(service, "warming up", texts, min(requests, 500)))
        before = memory_mb(service)
        whole = asyncio.run(phase(service, f"{CLIENTS} clients, {name}", texts, requests))
        after = memory_mb(service)
        alone = asyncio.run(phase(service, "1 client", texts, min(requests, 500), 1))
        attacked, statuses = asyncio.run(hostile(service, texts, min(requests, 1_000)))
        crowded = asyncio.run(crowd(service, texts))
        with service.client() as client:
            assert client.get("/health").status_code == 200
        assert service.stop() == 0
    failed = [first, whole, alone]
    assert all(set(each.statuses) == {200} for each in failed), [each.statuses for each in failed]
    assert set(attacked.statuses) <= {200, 429, 503}, attacked.statuses
    assert 0 not in crowded, crowded
    return [
        "| load | requests | a second | median, ms | 99th percentile, ms | longest, ms | not 200 |",
        "|---|---:|---:|---:|---:|---:|---:|",
        *(each.row() for each in (whole, alone, attacked)),
        "",
        f"Memory before and after the {requests:,} requests: the service {before[0]:.0f} and "
        f"{after[0]:.0f} MB, its largest worker {before[1]:.0f} and {after[1]:.0f} MB. The hostile "
        f"requests were answered with {listed(statuses)}. Of {CROWD:,} clients that asked at the "
        f"same time {listed(crowded)}.",
    ]


def listed(statuses: Counter[int]) -> str:
    parts = [f"{status} ({count} times)" for status, count in sorted(statuses.items())]
    return " and ".join(parts) if len(parts) < 3 else ", ".join(parts)


def under_fire(cycles: int) -> list[str]:
    """Ends the service again and again while clients queue plans."""
    accepted: dict[str, str] = {}
    unknown: set[str] = set()
    numbers, chance = itertools.count(), random.Random(cycles)  # noqa: S311
    with tempfile.TemporaryDirectory() as folder:
        journal = Path(folder) / "queue.db"
        words = ("--journal", journal, "--failure", "0", "--workers", "1", "--queue", "100000")
        for cycle in range(cycles):
            service = Service(*words, "--speed", "1000").start()
            load = Load(service, numbers)
            time.sleep(chance.uniform(0.3, 1.5))
            if cycle % 2:
                service.stop()
            else:
                service.kill()
            load.end()
            accepted |= load.accepted
            unknown |= load.unknown
        with Service(*words) as service, service.client() as client:
            for key in sorted(unknown):  # who got no answer asks again
                body = {"plan": PLAN, "request_id": key}
                accepted[key] = client.post("/v1/plans", json=body).json()["plan_id"]
            plans = client.get("/v1/plans").json()["total"]
            assert ended(client, str(plans), within_s=600)["completed"]
            assert service.stop() == 0
        check(journal, accepted, plans)
    return [
        f"Ended {cycles} times under load, half of them by SIGKILL, half by SIGTERM: {plans:,} "
        f"plans were accepted, none was lost and none ran twice; {len(unknown)} requests got no "
        "answer, were sent again with the same `request_id`, and were queued once.",
    ]


def main() -> None:
    requests = int(sys.argv[1]) if len(sys.argv) > 1 else FULL
    cycles = int(sys.argv[2]) if len(sys.argv) > 2 else 6
    began_s = time.monotonic()
    lines = under_load(requests)
    print("\n".join(lines), flush=True)
    fired = under_fire(cycles)
    print("\n".join(fired), f"\n{time.monotonic() - began_s:.0f} s on {os.cpu_count()} cores")
    text = "\n".join((*lines, "", *fired)) + "\n"
    if requests >= FULL:
        page = PAGE.read_text(encoding="utf-8")
        parts = text.split("\n\n")
        filled = "\n\n".join(part if part[0] == "|" else textwrap.fill(part, 100) for part in parts)
        PAGE.write_text(BLOCK.sub(rf"\g<1>\n{filled}\n\n\g<2>", page), encoding="utf-8")


if __name__ == "__main__":
    main()
