"""Clients, their shares and turns, and the cost classes, without HTTP."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections import Counter
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.service.clients import Proxies, client_of, name_of
from gpsfsm.service.costs import GATE_MS, SMALL_BYTES, Kind, expected_ms, kind_of
from gpsfsm.service.pool import Pool
from gpsfsm.service.problems import Problem
from gpsfsm.service.settings import Settings
from gpsfsm.service.shares import Line, Share, Ticket
from tests.service.support import GOOD, slow_plan

if TYPE_CHECKING:
    from collections.abc import Sequence

HEAVY = {"consistent": True, "faults": ["hang", "no-start"], "solver": "z3"}


@given(st.lists(st.tuples(st.sampled_from("abcd"), st.integers(1, 40)), max_size=200))
def test_whatever_clients_take_something_is_left_for_the_next(
    wishes: list[tuple[str, int]],
) -> None:
    share = Share(1_000)
    held: Counter[str] = Counter()
    for client, units in wishes:
        if share.take(client, units):
            held[client] += units
    assert share.used == sum(held.values()) <= 1_000
    assert share.take("new", 3)
    for client, units in held.items():
        share.give_back(client, units)
    assert share.used == 3


def test_one_client_alone_gets_three_quarters_and_a_proxy_all() -> None:
    share = Share(100)
    assert sum(share.take("a") for _ in range(200)) == 75
    share = Share(100)
    assert sum(share.take("proxy", trusted=True) for _ in range(200)) == 100
    share = Share(1)
    assert share.take("a")


def in_loop(work: Any) -> Any:
    return asyncio.run(work())


def test_clients_have_turns_however_many_requests_they_have() -> None:
    async def work() -> list[str]:
        line = Line(100)
        for number in range(20):
            line.join("greedy", number, 1.0)
        line.join("modest", 20, 1.0)
        served = []
        while (ticket := line.head()) is not None:
            line.call(ticket)
            served.append(ticket.client)
        return served

    served = in_loop(work)
    assert served.index("modest") <= 1
    assert len(served) == 21


def test_a_cheap_request_goes_before_dear_ones_of_others() -> None:
    async def work() -> str:
        line = Line(100)
        for number in range(8):
            line.join(f"dear {number}", number, 10.0)
        line.join("cheap", 8, 0.1)
        head = line.head()
        assert head is not None
        return head.client

    assert in_loop(work) == "cheap"


def test_a_cheap_request_goes_before_dear_ones_of_its_client_for_a_while() -> None:
    async def work() -> list[int]:
        line, order = Line(100), []
        line.join("one", 0, 0.05)  # lets those go first that come within a second
        line.join("one", 1, 0.001)
        await asyncio.sleep(1.1)
        line.join("one", 2, 0.001)
        while (ticket := line.head()) is not None:
            line.call(ticket)
            order.append(ticket.number)
        return order

    assert in_loop(work) == [1, 0, 2]


def test_who_was_away_gets_no_turns_for_that() -> None:
    async def work() -> list[str]:
        line = Line(100)
        for number in range(50):
            line.call(line.join("busy", number, 1.0))
        for number in range(50, 60):
            line.join("busy", number, 1.0)
            line.join("late", number + 100, 1.0)
        served = []
        for _ in range(10):
            ticket = line.head()
            assert ticket is not None
            line.call(ticket)
            served.append(ticket.client)
        return served

    assert 4 <= in_loop(work).count("busy") <= 6


def test_a_full_line_turns_away_who_fills_it() -> None:
    async def work() -> tuple[list[Ticket], Ticket, Line]:
        line = Line(10)
        greedy = [line.join("greedy", number, 1.0) for number in range(10)]
        with pytest.raises(Problem) as refused:
            line.join("greedy", 10, 1.0)
        assert refused.value.status == 429
        assert not line.has_room("greedy")
        assert line.has_room("modest")
        return greedy, line.join("modest", 11, 1.0), line

    greedy, modest, line = in_loop(work)
    error = greedy[-1].granted.exception()
    assert isinstance(error, Problem)
    assert (error.status, error.headers["retry-after"]) == (429, "1")
    assert not any(each.granted.done() for each in (*greedy[:-1], modest))
    assert len(line) == 10
    assert line.leave(modest)
    assert not line.leave(modest)


@given(
    st.lists(
        st.tuples(st.sampled_from("abcde"), st.sampled_from(["join", "call", "leave"])),
        max_size=100,
    )
)
def test_a_line_loses_nobody(steps: list[tuple[str, str]]) -> None:
    async def work() -> None:
        line, waiting, refused = Line(7), [], 0
        for number, (client, step) in enumerate(steps):
            if step == "join":
                try:
                    waiting.append(line.join(client, number, 0.5))
                except Problem:
                    refused += 1
                    assert len(line) == 7
            elif step == "call" and (head := line.head()) is not None:
                line.call(head)
            elif step == "leave" and waiting:
                line.leave(waiting.pop(0))
            waiting = [each for each in waiting if not each.granted.done()]
            assert len(waiting) == len(line) <= 7

    in_loop(work)


def mark(
    peer: str,
    headers: Sequence[tuple[str, str]] = (),
    *,
    proxies: Sequence[str] = (),
    token: int | None = None,
) -> str:
    lines = [(name.encode(), value.encode()) for name, value in headers]
    scope: dict[str, Any] = {"type": "http", "client": (peer, 1), "headers": lines}
    Proxies(proxies).mark(scope, token)
    return client_of(scope)


@pytest.mark.parametrize(
    ("host", "client"),
    [
        ("203.0.113.9", "203.0.113.9"),
        ("::ffff:203.0.113.9", "203.0.113.9"),
        ("2001:db8:1:2::7", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::1", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("127.0.0.1", "this machine"),
        ("127.77.3.2", "this machine"),
        ("::1", "this machine"),
        ("::ffff:127.0.0.1", "this machine"),
        ("", "unknown"),
        ("a.sock", "unknown"),
    ],
)
def test_who_an_address_stands_for(host: str, client: str) -> None:
    assert name_of(host) == client


FORWARDED = "x-forwarded-for"
PROXY = "10.0.0.7"


@pytest.mark.parametrize(
    ("peer", "headers", "client"),
    [
        # nobody but a proxy that is trusted is believed
        ("203.0.113.9", [(FORWARDED, "198.51.100.1")], "203.0.113.9"),
        ("10.0.0.8", [("forwarded", "for=198.51.100.1")], "10.0.0.8"),
        (PROXY, [], PROXY),
        (PROXY, [(FORWARDED, "198.51.100.1")], "198.51.100.1"),
        (PROXY, [("forwarded", 'for="[2001:db8::1]:99";proto=https')], "2001:db8::/64"),
        (PROXY, [("forwarded", "proto=https;For=198.51.100.1:80")], "198.51.100.1"),
        # what the client has written itself stands on the left
        (PROXY, [(FORWARDED, "192.0.2.66, 198.51.100.1")], "198.51.100.1"),
        (PROXY, [(FORWARDED, "192.0.2.66"), (FORWARDED, "198.51.100.1")], "198.51.100.1"),
        (PROXY, [(FORWARDED, "192.0.2.66, 198.51.100.1, 10.1.0.3")], "198.51.100.1"),
        (PROXY, [(FORWARDED, "10.1.0.4, 10.1.0.3")], "10.1.0.4"),
        # nonsense leads back to whoever has sent it on
        (PROXY, [(FORWARDED, "192.0.2.66, nonsense")], PROXY),
        (PROXY, [(FORWARDED, "192.0.2.66, nonsense, 10.1.0.3")], "10.1.0.3"),
        (PROXY, [("forwarded", "for=unknown")], PROXY),
        (PROXY, [("forwarded", "for=_hidden")], PROXY),
        (PROXY, [(FORWARDED, "")], PROXY),
        # two headers: one of them the proxy has not looked at
        (PROXY, [(FORWARDED, "198.51.100.1"), ("forwarded", "for=192.0.2.66")], PROXY),
        (PROXY, [(FORWARDED, "192.0.2.66"), ("forwarded", "for=192.0.2.66")], "192.0.2.66"),
    ],
)
def test_for_whom_a_proxy_asks(peer: str, headers: list[tuple[str, str]], client: str) -> None:
    assert mark(peer, headers, proxies=(PROXY, "10.1.0.0/16")) == client


def test_a_token_that_was_verified_is_the_client() -> None:
    assert mark("203.0.113.9", token=3) == mark("198.51.100.1", token=3) == "token 3"
    headers = [("authorization", "Bearer whatever")]
    assert mark("203.0.113.9", headers) == "203.0.113.9"


@pytest.mark.parametrize("wrong", ["proxy.example", "10.0.0.1/8", "", "*"])
def test_proxies_are_addresses(wrong: str) -> None:
    with pytest.raises(UsageError, match="no address of a proxy"):
        Settings(proxies=(wrong,))


@given(st.binary(max_size=300), st.booleans(), st.sampled_from(["gate", "check", "view", "fix"]))
def test_there_is_an_estimate_of_everything(body: bytes, raw: bool, op: str) -> None:
    assert expected_ms(op, body, raw=raw) > 0


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(max_size=9),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["plan", "options", "engine", "faults", "assume"]), inner
            )
        ),
        max_leaves=12,
    )
)
def test_there_is_an_estimate_of_every_object(request: object) -> None:
    assert expected_ms("gate", json.dumps(request).encode(), raw=False) > 0


def body(plan: str, **options: Any) -> bytes:
    return json.dumps({"plan": plan, "options": options}).encode()


def flat(runners: int) -> str:
    one = '<Runner interface="a/Go" provider="a/Go"/>'
    return f"<Plan>{one * runners}</Plan>"


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (body(GOOD), Kind.GATE),
        (body(flat(40)), Kind.GATE),
        (body(flat(100)), Kind.SMALL),
        (body(flat(400)), Kind.LARGE),
        (body(flat(40), **HEAVY), Kind.SMALL),
        (body(flat(100), **HEAVY), Kind.LARGE),
        (body(flat(40), engine="fabric-v1"), Kind.LARGE),
        (body(GOOD, assume=["x" * 1_000]), Kind.LARGE),
        (body(slow_plan(), consistent=True), Kind.LARGE),
        (b"x" * (SMALL_BYTES + 1), Kind.LARGE),
        (b"{", Kind.GATE),
        (b"[]", Kind.GATE),
    ],
)
def test_the_class_of_a_gate_request(content: bytes, kind: Kind) -> None:
    cost_ms = expected_ms("gate", content, raw=False)
    assert kind_of("gate", cost_ms) is kind
    other = Kind.SMALL if kind is Kind.GATE else kind
    assert kind_of("check", expected_ms("check", content, raw=False)) is other


def test_who_was_wrong_is_judged_strictly_but_not_the_tiniest() -> None:
    cost_ms = expected_ms("gate", body(flat(40)), raw=False)
    assert kind_of("gate", cost_ms, strictness=4.0) is Kind.SMALL
    assert kind_of("gate", expected_ms("gate", body(GOOD), raw=False), strictness=1e9) is Kind.GATE
    assert kind_of("gate", math.inf) is Kind.LARGE
    assert GATE_MS < 100


def pooled(work: Any, **settings: Any) -> Any:
    async def run() -> Any:
        pool = Pool(Settings(**settings))
        await pool.start()
        try:
            return await work(pool)
        finally:
            await pool.close()

    return asyncio.run(run())


SLOW = body(slow_plan(), consistent=True)


def test_gates_do_not_wait_for_large_requests_of_the_same_client() -> None:
    async def work(pool: Pool) -> list[int]:
        slow = [asyncio.create_task(pool.do("gate", SLOW, client="a")) for _ in range(6)]
        while not pool.running(Kind.LARGE):
            await asyncio.sleep(0.01)
        statuses = [(await pool.do("gate", body(GOOD), client="a")).status for _ in range(20)]
        assert not any(each.done() for each in slow)  # all that time
        assert pool.clients == 1
        for each in slow:
            each.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        assert (pool.busy, pool.waiting(Kind.LARGE), pool.running(Kind.LARGE)) == (0, 0, 0)
        return statuses

    assert pooled(work, workers=1, request_s=600) == [200] * 20


def test_large_requests_leave_a_worker_to_small_ones() -> None:
    async def work(pool: Pool) -> int:
        slow = [asyncio.create_task(pool.do("check", SLOW, client=str(n))) for n in range(6)]
        while not pool.running(Kind.LARGE):
            await asyncio.sleep(0.01)
        found = (await pool.do("check", body(GOOD), client="b")).status
        assert pool.running(Kind.LARGE) == 1
        for each in slow:
            each.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        return found

    assert pooled(work, workers=2, gate_workers=1, request_s=600) == 200


def test_what_turns_out_to_be_large_is_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    """With an estimate that takes everything for small: it is the budget that protects."""
    monkeypatch.setattr("gpsfsm.service.pool.expected_ms", lambda *_, **__: 1.0)

    async def work(pool: Pool) -> tuple[int, int, Counter[tuple[str, str]]]:
        with pytest.raises(Problem) as late:
            await pool.do("gate", SLOW, client="a")
        status = (await pool.do("gate", body(GOOD), client="b")).status
        return late.value.status, status, pool.outcomes

    late, status, outcomes = pooled(work, workers=1, request_s=1, small_s=0.1)
    assert (late, status) == (504, 200)
    assert outcomes["gate", "overrun"] == 1
    assert outcomes["gate", "answered"] == 1


def test_a_worker_that_is_ended_is_replaced_before_it_is_missed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("gpsfsm.service.pool.expected_ms", lambda *_, **__: 1.0)

    async def work(pool: Pool) -> int:
        until_s = time.monotonic() + 60
        while len(pool.gates._able) < 2:  # the spare one
            assert time.monotonic() < until_s
            await asyncio.sleep(0.05)
        slow = asyncio.create_task(pool.do("gate", SLOW, client="a"))
        while not pool.outcomes["gate", "overrun"]:
            assert time.monotonic() < until_s
            await asyncio.sleep(0.01)
        assert pool.gates.alive == 1
        status = (await pool.do("gate", body(GOOD), client="b")).status
        slow.cancel()
        await asyncio.gather(slow, return_exceptions=True)
        return status

    assert pooled(work, workers=1, request_s=60, small_s=0.05) == 200


def test_no_outcome_is_forgotten_when_nobody_waits_any_more() -> None:
    """Requests that are cancelled at any moment leave no worker busy and no place taken."""

    async def work(pool: Pool) -> None:
        for pause_s in (0, 0, 0.001, 0.005, 0.02):
            tasks = [
                asyncio.create_task(pool.do("gate", body(GOOD), client=str(n))) for n in range(4)
            ]
            await asyncio.sleep(pause_s)
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            assert (pool.busy, pool.waiting(Kind.GATE), pool.running(Kind.GATE)) == (0, 0, 0)
        assert (await pool.do("gate", body(GOOD), client="z")).status == 200

    pooled(work, workers=1, request_s=60)
