"""The shares and turns of clients, and the cost classes, without HTTP."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections import Counter
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import Request

from gpsfsm.service.clients import Line, Proxies, Share, Ticket
from gpsfsm.service.core import Core
from gpsfsm.service.costs import GATE_MS, SMALL_BYTES, Kind, expected_ms, kind_of
from gpsfsm.service.pool import Answered, Pool
from gpsfsm.service.settings import Settings
from gpsfsm.service.shapes import Problem
from tests.service.support import GOOD, loops, nested_trees, slow_plan

HEAVY = {"consistent": True, "faults": ["hang", "no-start"], "solver": "z3"}


@given(st.lists(st.tuples(st.sampled_from("abcd"), st.integers(1, 40)), max_size=200))
def test_whatever_clients_take_something_is_left_for_the_next(
    wishes: list[tuple[str, int]],
) -> None:
    """Once they hold something."""
    share = Share(1_000)
    held: Counter[str] = Counter()
    for client, units in (*((each, 1) for each in "abcd"), *wishes):
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


def test_who_holds_nothing_may_have_what_is_left() -> None:
    share = Share(2)
    assert share.take("a")
    assert not share.take("a")
    assert share.take("b")
    assert not share.take("c")
    share = Share(1_000)
    assert share.take("a", 700)
    assert not share.take("b", 301)
    assert share.take("b", 300)


@pytest.mark.parametrize("senders", ["aaaa", "aaab", "aabb", "abcd"])
@pytest.mark.parametrize("max_body", [1, 5_000, 64 << 20])
def test_there_is_room_for_four_bodies_whoever_sends_them(senders: str, max_body: int) -> None:
    share, piece = Share(Settings(max_body=max_body, max_bodies=1).bodies), max(1, max_body // 100)
    for client in senders:
        left = max_body
        while left:
            assert share.take(client, min(piece, left))
            left -= min(piece, left)


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


def test_a_place_of_somebody_who_has_gone_is_nobodys() -> None:
    async def work() -> None:
        line = Line(3)
        gone, last = (line.join(client, number, 1.0) for number, client in enumerate("aa"))
        gone.granted.cancel()
        head = line.head()
        assert head is last
        line.call(head)
        assert last.granted.result() is None
        greedy = [line.join("greedy", number, 1.0) for number in range(2, 5)]
        greedy[-1].granted.cancel()  # it would be the one to lose its place
        assert line.has_room("modest")
        line.join("modest", 6, 1.0)
        assert not any(each.granted.done() for each in greedy[:-1])
        assert len(line) == 3

    in_loop(work)


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


@given(st.binary(max_size=300), st.booleans(), st.sampled_from(["gate", "check", "view", "fix"]))
def test_there_is_an_estimate_of_everything(body: bytes, raw: bool, op: str) -> None:
    assert expected_ms(op, body, raw=raw) > 0


def test_an_estimate_is_a_number() -> None:
    """Else whose turn it is would be nobody's choice."""
    for plan in ("", "<Plan/>", None):
        request = {"plan": plan, "options": {"assume": ["x" * 1_000]}}
        assert expected_ms("gate", json.dumps(request).encode(), raw=False) == math.inf


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


def of_trees(text: str) -> bytes:
    return json.dumps({"plan": text, "trees": True}).encode()


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


NUMBER = '<Repeat num_cycles="10000">'


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (loops(1), Kind.GATE),
        (loops(3, 3), Kind.GATE),
        (nested_trees(1, 1), Kind.GATE),
        (nested_trees(3, 2), Kind.SMALL),
        (nested_trees(14, 2), Kind.LARGE),
        (nested_trees(6, 5), Kind.LARGE),
        (nested_trees(300, 1), Kind.LARGE),
        (loops(10_000), Kind.LARGE),
        (loops(9_999_999), Kind.LARGE),
        (loops(*(10,) * 4), Kind.LARGE),
        (loops(*(999_999,) * 99), Kind.LARGE),
        (loops(10_000).replace(NUMBER, "<Repeat num_cycles  =\n' 10000'>"), Kind.LARGE),
        (loops(10_000).replace(NUMBER, '<Repeat num_cycles="1000&#48;">'), Kind.LARGE),
        (loops(10_000).replace(NUMBER, '<Repeat num_cycles="{n}">'), Kind.LARGE),
        (loops(10_000).replace(NUMBER, f'<!-- {NUMBER.replace("10000", "1")} -->{NUMBER}'),
         Kind.LARGE),
        ("num_cycles", Kind.LARGE),
    ],
)  # fmt: skip
def test_the_class_of_behaviour_trees(text: str, kind: Kind) -> None:
    """As long as they are written out; for a gate that takes none they are read, and no more."""
    assert kind_of("gate", expected_ms("gate", of_trees(text), raw=False)) is kind
    if len(text) < 1_000:
        assert kind_of("gate", expected_ms("gate", body(text), raw=False)) is Kind.GATE
    for codec in ("utf-8", "utf-16", "utf-16-be"):
        raw = expected_ms("check", text.encode(codec), raw=True)
        assert kind is not Kind.LARGE or raw > GATE_MS * 5


def test_who_was_wrong_is_judged_strictly_but_not_what_a_gate_takes() -> None:
    cost_ms = expected_ms("gate", body(flat(40)), raw=False)
    assert kind_of("gate", cost_ms, strictness=1e9) is Kind.GATE
    assert kind_of("check", cost_ms, strictness=1e9) is Kind.SMALL
    cost_ms = expected_ms("gate", body(flat(100)), raw=False)
    assert kind_of("gate", cost_ms) is kind_of("gate", cost_ms, strictness=4.0) is Kind.SMALL
    assert kind_of("gate", cost_ms, strictness=16.0) is Kind.LARGE
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
        status = (await pool.do("check", body(GOOD), client="b")).status
        assert pool.running(Kind.LARGE) == 1
        for each in slow:
            each.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        return status

    assert pooled(work, workers=2, gate_workers=1, request_s=600) == 200


def test_what_turns_out_to_be_large_is_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    """With an estimate that takes everything for small: it is the budget that protects."""
    monkeypatch.setattr("gpsfsm.service.pool.expected_ms", lambda *_, **__: 1.0)
    monkeypatch.setattr("gpsfsm.service.pool._WAITS", 600)  # a new worker may be slow to begin

    async def work(pool: Pool) -> tuple[int, int, Counter[tuple[str, str]]]:
        with pytest.raises(Problem) as late:
            await pool.do("gate", SLOW, client="a")
        status = (await pool.do("gate", body(GOOD), client="b")).status
        return late.value.status, status, pool.outcomes

    late, status, outcomes = pooled(work, workers=1, request_s=1, small_s=0.1)
    assert (late, status) == (504, 200)
    assert outcomes["gate", "overrun"] == 1
    assert outcomes["gate", "answered"] == 1


def test_who_was_wrong_turns_the_protection_off_for_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Small gate requests from the same address stay what they are."""
    monkeypatch.setattr("gpsfsm.service.pool.expected_ms", wrong_about_slow)

    async def work(pool: Pool) -> tuple[int, Counter[tuple[str, str]]]:
        slow = [asyncio.create_task(pool.do("gate", SLOW, client="a")) for _ in range(5)]
        until_s = time.monotonic() + 60
        while pool.outcomes["gate", "overrun"] < 5:
            assert time.monotonic() < until_s
            await asyncio.sleep(0.01)
        status = (await pool.do("gate", body(flat(30)), client="a")).status
        for each in slow:
            each.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        return status, pool.outcomes

    status, outcomes = pooled(work, workers=1, request_s=60, small_s=0.4)
    assert status == 200
    assert outcomes["gate", "answered"] == 1


def wrong_about_slow(op: str, content: bytes, *, raw: bool) -> float:
    return 1.0 if content == SLOW else expected_ms(op, content, raw=raw)


@pytest.mark.parametrize("small_s", [0.5, 0.125, 5.0])
def test_who_has_no_more_time_than_a_small_request_is_late(
    small_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not one that turned out to be large in the same moment."""
    monkeypatch.setattr("gpsfsm.service.pool.expected_ms", lambda *_, **__: 1.0)
    monkeypatch.setattr("gpsfsm.workers.child_process.AsyncChildProcess.cpu_s", lambda _: None)
    wrong: list[dict[str, Any]] = []
    op = "gate" if small_s > 0.2 else "check"

    async def work(pool: Pool) -> Counter[tuple[str, str]]:
        asyncio.get_running_loop().set_exception_handler(lambda _, what: wrong.append(what))
        with pytest.raises(Problem) as late:
            await pool.do(op, SLOW, client="a")
        assert late.value.status == 504
        return pool.outcomes

    kind = Kind.GATE if op == "gate" else Kind.SMALL
    assert pooled(work, workers=1, request_s=0.5, small_s=small_s) == {(kind, "late"): 1}
    assert not wrong


def test_a_request_whose_time_is_over_does_not_grow() -> None:
    async def work() -> None:
        pool, work = Pool(Settings(workers=1)), SimpleNamespace(kind=Kind.GATE, overrun=False)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0) as limit:
                await asyncio.sleep(1)
        pool._grow(cast("Any", work), limit, [])
        assert not work.overrun

    in_loop(work)


def test_after_a_large_request_it_is_the_turn_of_a_small_one() -> None:
    """With one worker for both."""

    async def work(pool: Pool) -> int:
        slow = [asyncio.create_task(pool.do("check", SLOW, client=f"h{n}")) for n in range(5)]
        while not pool.running(Kind.LARGE):
            await asyncio.sleep(0.01)
        status = (await pool.do("check", body(GOOD), client="b")).status
        assert sum(each.done() for each in slow) == 1
        for each in slow:
            each.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        return status

    assert pooled(work, workers=1, request_s=2) == 200


def test_a_body_of_unknown_length_is_read_before_it_is_refused() -> None:
    """It may be a small one: only a large one that was announced comes for nothing."""

    async def read(core: Core, name: bytes, value: bytes) -> bytes:
        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": b"small", "more_body": False}

        scope: dict[str, Any] = {"type": "http", "client": ("127.0.0.1", 1), "headers": []}
        Proxies(()).mark(scope, None)
        async with core.body(Request({**scope, "headers": [(name, value)]}, receive)) as content:
            return content

    async def work() -> None:
        core = Core(Settings(waiting=1))
        core.pool._lines[Kind.LARGE].join("this machine", 1, 1.0)
        assert await read(core, b"transfer-encoding", b"chunked") == b"small"
        with pytest.raises(Problem) as refused:
            await read(core, b"content-length", b"100000")
        assert refused.value.status == 429

    in_loop(work)


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
            for one in await asyncio.gather(*tasks, return_exceptions=True):
                assert isinstance(one, Answered | asyncio.CancelledError), one
            assert (pool.busy, pool.waiting(Kind.GATE), pool.running(Kind.GATE)) == (0, 0, 0)
        assert (await pool.do("gate", body(GOOD), client="z")).status == 200

    pooled(work, workers=1, request_s=60)
