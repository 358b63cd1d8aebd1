"""Who is served while others send what is slow: ``python benchmarks/service_shares.py [SECONDS]``.

Honest clients send real plans to the gate of a service on this machine for SECONDS (20), each plan
as soon as the one before is answered: alone, then beside hostile clients. Those send plans of some
100 kB with all options that take long, as fast as they are answered, and never wait when they are
told to; in one case every other one sends short behaviour trees that are long when their SubTrees
and loops are written out. Prints a table, and with that many seconds writes it into
docs/service.md. It fails if an honest request does, or if the service is not there in the end.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import multiprocessing
import os
import re
import sys
import tempfile
import textwrap
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.service_load import Phase, answer, corpus  # noqa: E402
from tests.service.support import Service, loops, nested_trees  # noqa: E402

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

PAGE = ROOT / "docs" / "service.md"
BLOCK = re.compile(r"(<!-- shares -->\n).*?(<!-- /shares -->)", re.DOTALL)
FULL_S = 20.0
HONEST = 2
CONNECTIONS = 2
AIM_MS = 250.0
CLIENTS = 9
_RUNNERS = 1_400
_PAUSE_S = 0.001


def token(number: int) -> str:
    return f"a-token-for-client-{number:04}"


def heavy(number: int) -> bytes:
    """A request of some 100 kB that takes as long as it may; each is another one."""
    inner = "".join(
        f'<Control type="parallel_any"><Runner interface="a/R{each % 7}" provider="a/R{number}"/>'
        f'<Runner interface="a/S{each}" provider="a/S"/></Control>'
        for each in range(_RUNNERS // 2)
    )
    options = {"faults": ["hang", "no-start"], "consistent": True, "solver": "z3"}
    return json.dumps({"plan": f"<Plan>{inner}</Plan>", "options": options}).encode()


def written_out(number: int) -> bytes:
    """A short request that takes long; each is another one."""
    plan = nested_trees(10 + number % 5) if number % 4 else loops(10_000 - number)
    return json.dumps({"plan": plan, "trees": True}).encode()


def request(body: bytes, media: str, shown: str) -> bytes:
    secret = f"Authorization: Bearer {shown}\r\n" if shown else ""
    head = f"POST /v1/gate HTTP/1.1\r\nHost: localhost\r\nContent-Type: {media}\r\n{secret}"
    return f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body


class Crowd(NamedTuple):
    """Hostile clients; with ``trees`` half of them send behaviour trees."""

    clients: int
    tokens: bool
    trees: bool = False


async def attack(place: tuple[str, int], crowd: Crowd, seconds: float) -> Counter[int]:
    """What hostile clients were answered; 0 is a connection that was closed."""
    until_s, statuses = time.monotonic() + seconds, Counter[int]()

    async def one(number: int) -> None:
        body = written_out(number) if crowd.trees and number % 2 == 0 else heavy(number)
        content = request(body, "application/json", token(number) if crowd.tokens else "")
        while time.monotonic() < until_s:
            writer = None
            try:
                reader, writer = await asyncio.open_connection(*place)
                writer.write(content)
                async with asyncio.timeout(max(0.1, until_s - time.monotonic())):
                    statuses[await answer(reader)] += 1
            except (OSError, EOFError):
                statuses[0] += 1
                await asyncio.sleep(_PAUSE_S)
            finally:
                if writer is not None:
                    writer.close()

    numbers = [number for number in range(1, crowd.clients + 1) for _ in range(CONNECTIONS)]
    with suppress(TimeoutError):
        await asyncio.gather(*map(one, numbers), return_exceptions=True)
    return statuses


def hostile(place: tuple[str, int], crowd: Crowd, seconds: float, to: Queue[Counter[int]]) -> None:
    to.put(asyncio.run(attack(place, crowd, seconds)))


async def honest(
    service: Service, name: str, texts: list[bytes], seconds: float, shown: str
) -> Phase:
    phase, cycle = Phase(name), itertools.cycle(texts)
    until_s = time.monotonic() + seconds

    async def one() -> None:
        reader, writer = await asyncio.open_connection(*service.place)
        while time.monotonic() < until_s:
            began_s = time.monotonic()
            writer.write(request(next(cycle), "application/xml", shown))
            phase.statuses[await answer(reader)] += 1
            phase.seconds.append(time.monotonic() - began_s)
        writer.close()

    await asyncio.gather(*(one() for _ in range(HONEST)))
    phase.took_s = time.monotonic() - phase.began_s
    return phase


def scenario(
    service: Service, texts: list[bytes], crowd: Crowd, seconds: float
) -> tuple[Phase, Counter[int]]:
    place = "each with its token" if crowd.tokens else "all from one address"
    alone = "alone, with a token" if crowd.tokens else "alone, without a token"
    place += ", half of them with behaviour trees" if crowd.trees else ""
    name = f"{crowd.clients} hostile clients, {place}" if crowd.clients else alone
    results: Queue[Counter[int]] = multiprocessing.Queue()
    args = (service.place, crowd, seconds + 2, results)
    process = multiprocessing.Process(target=hostile, args=args) if crowd.clients else None
    if process is not None:
        process.start()
        time.sleep(1)
    phase = asyncio.run(honest(service, name, texts, seconds, token(0) if crowd.tokens else ""))
    statuses = Counter[int]()
    if process is not None:
        statuses = results.get(timeout=60)
        process.join(60)
    return phase, statuses


def measured(seconds: float) -> list[str]:
    texts, name = corpus()
    rows: list[tuple[Phase, Counter[int]]] = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tokens"
        file.write_text("".join(f"{token(each)}\n" for each in range(CLIENTS)), encoding="ascii")
        for tokens, sizes in ((True, (0, 2, 8)), (False, (0, 8))):
            words = ("--token-file", file) if tokens else ()
            with Service(*words) as service:
                asyncio.run(honest(service, "warming up", texts, 1, token(0) if tokens else ""))
                crowds = [Crowd(clients, tokens) for clients in sizes]
                if not tokens:
                    crowds.append(Crowd(sizes[-1], tokens, trees=True))
                for crowd in crowds:
                    rows.append(scenario(service, texts, crowd, seconds))
                    print(rows[-1][0].row(), dict(rows[-1][1]), flush=True)
                with service.client() as client:
                    assert client.get("/health").status_code == 200
                assert service.stop() == 0
    for phase, _ in rows:
        assert set(phase.statuses) == {200}, (phase.name, phase.statuses)
    late = [phase for phase, _ in rows if phase.late_ms() > AIM_MS]
    total = sum((statuses for _, statuses in rows), Counter[int]())
    kept = "kept" if not late else "missed"
    return [
        f"| beside {HONEST} honest connections, {name} | requests | a second | median, ms "
        "| 99th percentile, ms | longest, ms | not 200 |",
        "|---|---:|---:|---:|---:|---:|---:|",
        *(phase.row() for phase, _ in rows),
        "",
        f"The aim, a 99th percentile below {AIM_MS:.0f} ms and no failure, was {kept}. The hostile "
        f"requests were answered with {listed(total)}.",
    ]


def listed(statuses: Counter[int]) -> str:
    answered = [f"{each} ({count:,} times)" for each, count in sorted(statuses.items()) if each]
    return f"{', '.join(answered)}; {statuses[0]:,} waited in vain when it ended"


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else FULL_S
    began_s = time.monotonic()
    lines = measured(seconds)
    print("\n".join(lines), f"\n{time.monotonic() - began_s:.0f} s on {os.cpu_count()} cores")
    if seconds >= FULL_S:
        text = "\n".join((*lines[:-1], textwrap.fill(lines[-1], 100)))
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(BLOCK.sub(rf"\g<1>\n{text}\n\n\g<2>", page), encoding="utf-8")


if __name__ == "__main__":
    main()
