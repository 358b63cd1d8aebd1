"""Whatever a server does, a model answers or says what is wrong, soon, and shows no key."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import threading
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.generation.language_model import Constraint, Finish, ModelError
from gpsfsm.generation.providers import Constrain, transport
from tests.generation.fake_faults import FAULTS
from tests.generation.fake_server import FakeServer
from tests.generation.providers.asking import (
    KEY,
    answer,
    ask,
    everything_of,
    fails,
    model_at,
    request,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.generation.language_model import Answer, LanguageModel

PERMANENT = {  # fault: what the message says, and whether to ask again later
    "403": ("says 403: Project does not have access to model; the key in THE_KEY does not", False),
    "quota": ("the account has no credit left", False),
    "bad-grammar": ("says 400: Failed to parse grammar", False),
    "too-long": ("--context says how much the model can read", False),
    "chat-template": ("with 'thinking = true' in the configuration", False),
    "echo-refusal": ("says 401: bad key Bearer ***; the key in THE_KEY is not accepted", False),
    "redirect": ("says 307; redirects are not followed", False),
    "html": ("answered, but with 'text/html' and not with JSON", False),
    "stream": ("answered, but with 'text/event-stream' and not with JSON", False),
    "gzip-bomb": ("it is compressed, although that was not requested", False),
    "huge": ("with more than 8,388,608 bytes (max-answer-bytes)", False),
    "huge-error": ("says 400: xxxx", False),
    "garbage": ("what came is not JSON", True),
    "not-utf8": ("answered, but not in UTF-8 (byte 39)", True),
    "cut-json": ("what came is not JSON", True),
    "deep": ("what came is not JSON", True),
    "number": ("what came is not JSON", True),
    "empty": ("what came is not JSON", True),
    "null": ("the server's reply has no answer in it", False),
    "list": ("the server's reply has no answer in it", False),
    "no-choices": ("the server's reply has no answer in it", False),
    "odd-choices": ("the answer is empty", True),
    "error-in-200": ("the server says: upstream is overloaded", True),
    "empty-answer": ("the answer is empty", True),
    "all-thought": ("it used up its 4096 tokens before it wrote an answer", False),
    "refusal": ("the model refuses to answer: I cannot help with that.", False),
    "filter": ("the model refuses to answer: the answer was withheld by a content filter", False),
}
PASSING = ("408", "409", "429", "500", "503", "cut", "reset", "garbled")
ANSWERED = ("slow", "length", "thinking", "reasoning", "parts", "half-character", "echo-headers")
WITHOUT_END = ("hang", "hang-inside", "endless")


@pytest.fixture(autouse=True)
def _logged(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """No key in any log, of whatever level."""
    caplog.set_level(logging.DEBUG)
    yield
    assert KEY not in caplog.text


def test_every_fault_is_tried() -> None:
    assert {*PERMANENT, *PASSING, *ANSWERED, *WITHOUT_END, "raw"} == set(FAULTS)


async def answer_or_error(model: LanguageModel) -> Answer | ModelError:
    try:
        return await model.answer(request())
    except ModelError as error:
        return error


@pytest.fixture(scope="module")
def odd_server() -> Iterator[FakeServer]:
    with FakeServer(key=KEY) as server:
        yield server


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["choices", "message", "content", "error", "usage", "model", "tool_calls", "custom"]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@given(
    st.binary(max_size=200)
    | st.binary(max_size=100).map(lambda body: b"HTTP/1.1 200 OK\r\n\r\n" + body)
    | _JSON.map(lambda data: b"HTTP/1.1 200 OK\r\n\r\n" + json.dumps(data).encode()),
    st.sampled_from(["vllm", "ollama"]),
)
def test_any_bytes_are_an_answer_or_an_error(
    odd_server: FakeServer, content: bytes, provider: str
) -> None:
    odd_server.fail_with(f"raw:{content.hex()}")
    model = model_at(odd_server, provider, key=KEY, retries=0, timeout_s=5.0)
    result = asyncio.run(answer_or_error(model))
    if isinstance(result, ModelError):
        assert str(result).startswith(f"{provider}:tiny: ")
        assert str(result).isprintable()
        assert KEY not in everything_of(result)
    else:
        assert result.text.strip()


@pytest.mark.parametrize("fault", PERMANENT)
def test_what_does_not_pass_is_told_at_once(fault: str) -> None:
    said, again = PERMANENT[fault]
    with FakeServer(faults=[fault], key=KEY) as server:
        error = fails(model_at(server, key=KEY))
        assert len(server.received) == 1
    assert str(error).startswith("vllm:tiny: ")
    assert said in str(error)
    assert len(str(error)) < 800
    assert error.again is again
    assert KEY not in everything_of(error)


@pytest.mark.parametrize("fault", PASSING)
def test_what_passes_is_tried_again(fault: str) -> None:
    with FakeServer(faults=[fault, fault], key=KEY) as server:
        reply = answer(model_at(server, key=KEY))
        assert len(server.received) == 3
    assert (reply.text, reply.requests) == ("<Plan/>", 3)


@pytest.mark.parametrize("fault", PASSING)
def test_what_does_not_pass_after_all_is_told(fault: str) -> None:
    with FakeServer(faults=[fault] * 9, key=KEY) as server:
        error = fails(model_at(server, key=KEY, retries=2))
        assert len(server.received) == 3
    assert "(asked 3 times)" in str(error)
    assert error.again
    assert KEY not in everything_of(error)


@pytest.mark.parametrize("fault", WITHOUT_END)
def test_what_never_ends_is_ended(fault: str) -> None:
    with FakeServer(faults=[fault], key=KEY) as server:
        error = fails(model_at(server, key=KEY, timeout_s=0.3))
    assert "within 0.3 s; --timeout allows more" in str(error)
    assert error.again
    assert KEY not in everything_of(error)


@pytest.mark.parametrize("fault", WITHOUT_END)
def test_cancelling_ends_a_request_at_once(fault: str) -> None:
    async def cancelled(server: FakeServer) -> BaseException:
        model = model_at(server, key=KEY)
        task = asyncio.create_task(model.answer(request()))
        while not server.received:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)
        task.cancel()
        (phase_result,) = await asyncio.gather(task, return_exceptions=True)
        await model.close()
        assert isinstance(phase_result, BaseException)
        return phase_result

    with FakeServer(faults=[fault], key=KEY) as server:
        result = asyncio.run(cancelled(server))
    assert isinstance(result, asyncio.CancelledError)
    assert KEY not in everything_of(result)


@pytest.mark.parametrize("fault", ANSWERED)
def test_what_is_odd_and_yet_an_answer(fault: str) -> None:
    with FakeServer(faults=[fault], key=KEY) as server:
        reply = answer(model_at(server, key=KEY))
    assert reply.text.startswith("<Plan/>")
    assert reply.finish is (Finish.LENGTH if fault == "length" else Finish.STOP)
    assert KEY not in repr(reply)
    reply.text.encode()
    if fault in ("thinking", "reasoning"):
        assert reply.text == "<Plan/>"
        assert "<think>Where to?</think>" in reply.raw


def test_a_model_that_thought_until_the_end_hears_of_max_tokens() -> None:
    with FakeServer(faults=["all-thought"]) as server:
        error = fails(model_at(server), request(max_tokens=77))
    assert "it used up its 77 tokens before it wrote an answer" in str(error)


def test_a_storm_of_429_waits_as_long_as_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float] = []

    async def sleep(seconds: float) -> None:
        waited.append(seconds)

    faults = ["429:7", "429:1000", "429:Wed, 21 Oct 2015 07:28:00 GMT", "429:soon"]
    with FakeServer(faults=faults) as server:
        model = model_at(server, retries=4, max_wait_s=20.0)
        monkeypatch.setattr(model._transport, "_sleep", sleep)  # type: ignore[attr-defined]
        assert answer(model).requests == 5
    assert waited[:3] == [7.0, 20.0, 0.0]
    assert 4.0 <= waited[3] <= 8.0


def test_no_server() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and not listening: nobody else gets the port
        url = f"http://127.0.0.1:{taken.getsockname()[1]}"
        error = fails(model_at(url, "ollama", key=KEY, retries=1))
    assert str(error) == (
        f"ollama:tiny: no one answers at {url}; is the server running? ollama serve (asked 2 times)"
    )
    assert error.again
    assert KEY not in everything_of(error)


def test_no_such_host() -> None:
    error = fails(model_at("http://no-such-host.invalid:1", retries=0, key=KEY))
    assert "the host in http://no-such-host.invalid:1/v1 does not exist" in str(error)
    assert KEY not in everything_of(error)


def test_no_encryption_where_it_was_asked_for() -> None:
    with FakeServer() as server:
        error = fails(model_at(server.url.replace("http:", "https:"), key=KEY))
        assert server.received == []
    assert "is it perhaps http:// and not https://?" in str(error)
    assert not error.again
    assert KEY not in everything_of(error)


def test_a_model_that_is_not_there() -> None:
    with FakeServer(models=["qwen3:8b", "llama3.2:3b", "qwen3:4b"]) as server:
        error = fails(model_at(server, "ollama", "qwen3:9b"))
    assert str(error).startswith(
        f"ollama:qwen3:9b: there is no model 'qwen3:9b' at {server.url}; it has qwen3:"
    )
    assert "llama3.2:3b" in str(error)
    assert not error.again


def test_of_many_models_few_are_named() -> None:
    with FakeServer(models=[f"m{number}" for number in range(99)]) as server:
        error = fails(model_at(server, "vllm", "x"))
    assert str(error).endswith(" and 89 more")
    assert len(str(error)) < 300


def test_an_address_that_is_not_there() -> None:
    with FakeServer() as server:
        error = fails(model_at(f"{server.url}/api/v2"))
    assert f"is {server.url}/api/v2 the right address (--base-url)?" in str(error)


def test_a_key_that_is_needed_and_one_that_is_wrong() -> None:
    with FakeServer(key=KEY) as server:
        error = fails(model_at(server, "openai", "gpt-5"))
        assert "no key was sent" in str(error)
        error = fails(model_at(server, key="sk-other-key-abcdef"))
        assert "Incorrect API key provided: sk-a***b.; the key in THE_KEY is not" in str(error)
        assert "sk-other" not in everything_of(error)
        assert answer(model_at(server, key=KEY)).text == "<Plan/>"


def test_a_grammar_that_is_refused() -> None:
    response = request(grammars=((Constraint.GBNF, "root ::= ("),))
    with FakeServer(faults=["bad-grammar"]) as server:
        error = fails(model_at(server, "llamacpp", constrain=Constrain.ALWAYS), response)
    assert "it does not accept the grammar: use --no-constrain" in str(error)


def test_a_model_works_in_one_event_loop_after_the_other() -> None:
    with FakeServer(["<Plan/>", "<Plan></Plan>"]) as server:
        model = model_at(server)
        assert answer(model).text == "<Plan/>"
        assert answer(model).text == "<Plan></Plan>"
        assert [each.text for each in ask(model, request(), request())] == ["<Plan></Plan>"] * 2


def test_a_model_works_in_several_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    actual: list[str] = []
    with FakeServer() as server:
        model = model_at(server)
        threads = [
            threading.Thread(target=lambda: actual.append(answer(model).text)) for _ in range(4)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert actual == ["<Plan/>"] * 4


def test_many_candidates_at_once_are_one_probe() -> None:
    async def many(server: FakeServer) -> list[Constraint | None]:
        model = model_at(server, "sglang", constrain=Constrain.PROBE)
        response = request(grammars=((Constraint.GBNF, "root ::= [a]"),))
        answers = await asyncio.gather(*(model.answer(response) for _ in range(8)))
        return [each.constrained for each in answers]

    with FakeServer(heeds=["ebnf"]) as server:
        assert asyncio.run(many(server)) == [Constraint.GBNF] * 8
        assert [result.probes for result in server.received].count(True) == 1


def test_candidates_do_not_wait_for_one_probe_in_vain_after_the_other() -> None:
    async def many(server: FakeServer) -> list[str]:
        model = model_at(server, "sglang", constrain=Constrain.PROBE, timeout_s=2)
        response = request(grammars=((Constraint.GBNF, "root ::= [a]"),))
        answers = await asyncio.gather(*(model.answer(response) for _ in range(8)))
        return [each.text for each in answers]

    with FakeServer(heeds=["ebnf"], faults=["hang"]) as server:
        assert asyncio.run(many(server)) == ["<Plan/>"] * 8
        assert [result.probes for result in server.received].count(True) == 1


class TestProxies:
    """As httpx takes them from the environment, but never for this computer."""

    def test_they_are_used(self, monkeypatch: pytest.MonkeyPatch) -> None:
        with FakeServer(key=KEY) as proxy:
            monkeypatch.setenv("HTTP_PROXY", proxy.url)
            error = fails(model_at("http://model.example:8000/v1", key=KEY))
        assert "says 404" in str(error)  # the proxy is asked for a whole address

    def test_not_for_this_computer(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:1")
        with FakeServer() as server:
            assert answer(model_at(server)).text == "<Plan/>"

    def test_what_is_no_proxy(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("HTTP_PROXY", f"gopher://user:{KEY}@proxy.example")
        error = fails(model_at("http://model.example:8000/v1", retries=0))
        assert "look at the proxies in the environment" in str(error)
        assert KEY not in everything_of(error)


def test_a_client_that_is_not_installed_is_an_error_of_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing(_: object) -> None:
        raise ImportError("socksio")

    monkeypatch.setattr(transport.Transport, "_client", missing)
    with pytest.raises(ModelError, match="no request can be sent"):
        ask(model_at("http://127.0.0.1:1"))
