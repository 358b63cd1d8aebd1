"""What is sent to each kind of server, to the letter, and how its replies are read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.generation.language_model import Constraint, Finish, Message, Request, Role, Usage
from gpsfsm.generation.prompt_builder import find_template
from gpsfsm.generation.providers import Constrain, ModelSettings, builtin, find_model, find_provider
from gpsfsm.generation.providers.dialect import said_wrong
from tests.generation.fake_server import FakeServer
from tests.generation.providers.asking import GRAMMARS, answer, fails, model_at, request

TURNS = [{"role": "system", "content": "You plan."}, {"role": "user", "content": "Go home."}]
IN_JSON = find_template("json").filled({})
TURNS_JSON = [TURNS[0], {"role": "user", "content": f"Go home.\n\n{IN_JSON}"}]
CHAT = {"messages": TURNS, "temperature": 0.5, "max_tokens": 100, "stream": False, "seed": 7}
QUIET = {"chat_template_kwargs": {"enable_thinking": False}}
GBNF = 'root ::= "<Plan/>"\n'
SCHEMA = {"name": "plan", "schema": {"type": "object"}, "strict": True}
OPENAI = {"messages": TURNS, "stream": False, "max_completion_tokens": 100}
TOOL = {
    "name": "emit_plan",
    "description": "Hand over the plan. The input is the plan, nothing else.",
    "format": {
        "type": "grammar",
        "grammar": {"syntax": "lark", "definition": 'start: "<Plan/>"\n'},
    },
}
OPTIONS = {"temperature": 0.5, "num_predict": 100, "num_ctx": 8192, "seed": 7}

SENT: dict[str, tuple[str, str, dict[str, Any], dict[str, Any]]] = {
    # provider: field of the grammar, constraint, what is sent without it, and with it
    "vllm:m": (
        "structured_outputs",
        "gbnf",
        {"model": "m", **CHAT, **QUIET},
        {"structured_outputs": {"grammar": GBNF}},
    ),
    "vllm-old:m": (
        "guided_grammar",
        "gbnf",
        {"model": "m", **CHAT, **QUIET},
        {"guided_grammar": GBNF},
    ),
    "sglang:m": ("ebnf", "gbnf", {"model": "m", **CHAT, **QUIET}, {"ebnf": GBNF}),
    "llamacpp": ("grammar", "gbnf", {"model": "default", **CHAT, **QUIET}, {"grammar": GBNF}),
    "openai-compatible:m": (
        "response_format",
        "json-schema",
        {"model": "m", **CHAT},
        {
            "messages": TURNS_JSON,
            "response_format": {"type": "json_schema", "json_schema": SCHEMA},
        },
    ),
    "openai:gpt-5-mini": (
        "tools",
        "lark",
        {"model": "gpt-5-mini", **OPENAI},
        {
            "tools": [{"type": "custom", "custom": TOOL}],
            "tool_choice": {"type": "custom", "custom": {"name": "emit_plan"}},
            "parallel_tool_calls": False,
        },
    ),
    "openai:gpt-4o": (
        "",
        "",
        {"model": "gpt-4o", **OPENAI, "temperature": 0.5, "seed": 7},
        {},
    ),
    "openai:o3": ("", "", {"model": "o3", **OPENAI}, {}),
    "openai:gpt-5-chat-latest": (
        "",
        "",
        {"model": "gpt-5-chat-latest", **OPENAI, "temperature": 0.5, "seed": 7},
        {},
    ),
    "ollama:qwen3:8b": (
        "format",
        "json-schema",
        {
            "model": "qwen3:8b",
            "messages": TURNS,
            "stream": False,
            "think": False,
            "options": OPTIONS,
        },
        {"messages": TURNS_JSON, "format": {"type": "object"}},
    ),
}


def split(spec: str) -> tuple[str, str, str]:
    """Provider, model, and the dialect that has to be asked for."""
    provider, _, model = spec.partition(":")
    return provider.removesuffix("-old"), model, "guided_grammar" if "-old" in spec else ""


@pytest.mark.parametrize("spec", SENT)
def test_what_is_sent(spec: str) -> None:
    name, constraint, without, more = SENT[spec]
    provider, model, dialect = split(spec)
    response = request(max_tokens=100, temperature=0.5, seed=7, grammars=GRAMMARS)
    json = constraint == "json-schema"
    models = [model or "default"]
    with FakeServer(
        ['{"plan": "a"}' if json else "<Plan/>"], models=models, heeds=[name]
    ) as server:
        free = answer(model_at(server, provider, model, dialect=dialect), response)
        bound = answer(
            model_at(server, provider, model, dialect=dialect, constrain=Constrain.ALWAYS), response
        )
        assert [each.body for each in server.received] == [without, without | more]
    assert (free.constrained, bound.constrained) == (None, constraint or None)
    assert bound.text == ("<Plan>a</Plan>" if json else "<Plan/>")
    assert bound.raw == ('{"plan": "a"}' if json else "<Plan/>")


@pytest.mark.parametrize("spec", ["vllm:m", "ollama:m"])
def test_models_that_may_think(spec: str) -> None:
    provider, model, _ = split(spec)
    with FakeServer(models=["m"]) as server:
        answer(model_at(server, provider, model, thinking=True))
        assert not {"chat_template_kwargs", "think"} & set(server.received[0].body)


def test_nothing_is_sent_that_is_not_said() -> None:
    with FakeServer() as server:
        answer(model_at(server, "openai-compatible"))
        assert "seed" not in server.received[0].body


@pytest.mark.parametrize(
    ("written", "characters", "room"),
    [(None, 10, 8192), (None, 40_000, 16_384), (None, 10**7, 1 << 20), (4096, 40_000, 4096)],
)
def test_ollama_is_told_how_much_room_is_needed(
    written: int | None, characters: int, room: int
) -> None:
    with FakeServer() as server:
        answer(model_at(server, "ollama", context_tokens=written), request("x" * characters))
        assert server.received[0].body["options"]["num_ctx"] == room


def test_every_dialect_is_short_and_has_a_golden_request() -> None:
    folder = Path(str(builtin.__file__)).parent
    names = {file.stem.replace("_", "-"): file for file in folder.glob("[a-z]*.py")}
    assert {split(spec)[0] for spec in SENT} == set(names) - {"prompt-tools", "replay"}
    for name, file in names.items():
        if name not in ("prompt-tools", "replay", "ollama"):
            assert len(file.read_text().splitlines()) <= 65


class TestReplies:
    def test_tokens_and_what_they_cost(self) -> None:
        with FakeServer(["<Plan> </Plan>"]) as server:
            reply = answer(model_at(server, prompt_price=1_000_000.0, answer_price=500_000.0))
            assert reply.usage == Usage(4, 2)
            assert reply.cost == 5.0
            assert answer(model_at(server, prompt_price=1.0)).cost is None
            assert answer(model_at(server, "ollama")).usage == Usage(4, 2)

    @pytest.mark.parametrize("provider", ["vllm", "ollama"])
    def test_tokens_that_are_not_counted_are_estimated(self, provider: str) -> None:
        with FakeServer(["<Plan/>"], usage=False) as server:
            assert answer(model_at(server, provider)).usage == Usage(6, 4, estimated=True)

    def test_the_model_that_answered_is_named(self) -> None:
        with FakeServer(models=["default"]) as server:
            reply = answer(model_at(server, "llamacpp", ""))
            assert reply.model == "default"
            assert reply.latency_s > 0

    @pytest.mark.parametrize(
        ("reason", "finish"),
        [
            ("stop", Finish.STOP),
            (None, Finish.STOP),
            ("length", Finish.LENGTH),
            ("load", Finish.OTHER),
            (3, Finish.STOP),
        ],
    )
    def test_why_an_answer_of_ollama_ended(self, reason: Any, finish: Finish) -> None:
        dialect = model_at("http://x", "ollama")._dialect  # type: ignore[attr-defined]
        reply = dialect.reply({"message": {"content": "a"}, "done_reason": reason})
        assert (reply.text, reply.finish) == ("a", finish)

    @pytest.mark.parametrize(
        ("provider", "data", "said"),
        [
            (
                "ollama",
                {"message": {"content": "<Pl"}, "done": False},
                "the answer is not complete",
            ),
            ("ollama", {"message": {"content": "<Pl"}, "error": "out of memory"}, "out of memory"),
            (
                "vllm",
                {"choices": [{"message": {"content": "<Pl"}}], "error": {"message": "died"}},
                "died",
            ),
            (
                "vllm",
                {"choices": [{"message": {"content": "<Pl"}, "finish_reason": "error"}]},
                "the answer was cut off",
            ),
            (
                "vllm",
                {
                    "choices": [
                        {
                            "message": {"content": "<Pl"},
                            "finish_reason": "error",
                            "error": {"message": "upstream"},
                        }
                    ]
                },
                "upstream",
            ),
        ],
    )
    def test_half_an_answer_is_none(self, provider: str, data: Any, said: str) -> None:
        head = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n"
        with FakeServer() as server:
            server.fail_with(f"raw:{(head + json.dumps(data).encode()).hex()}")
            error = fails(model_at(server, provider, retries=0))
        assert str(error) == f"{provider}:tiny: the server says: {said}"
        assert error.again

    @pytest.mark.parametrize("provider", ["ollama", "openai", "vllm"])
    @pytest.mark.parametrize(
        "data",
        [
            None,
            7,
            "x",
            [],
            {},
            {"message": []},
            {"message": {"content": {}}},
            {"choices": {}},
            {"choices": [[]]},
            {"choices": [{"message": "x", "finish_reason": []}]},
            {"usage": {"prompt_tokens": True, "completion_tokens": -1}, "model": {}},
            {"eval_count": 1e9, "prompt_eval_count": 1 << 60, "models": [1, {"name": 2}]},
            {"data": [1, None, {"id": []}], "error": {}},
        ],
    )
    def test_no_reply_is_too_odd(self, provider: str, data: Any) -> None:
        dialect = model_at("http://x", provider)._dialect  # type: ignore[attr-defined]
        reply = dialect.reply(data)
        assert reply.text is None
        assert reply.usage == Usage()
        assert reply.model == ""
        assert dialect.models(data) == []


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"error": {"message": "a"}}, "a"),
        ({"error": "a"}, "a"),
        ({"error": {"code": 3}}, "it does not say what"),
        ({"object": "error", "message": "a"}, "a"),
        ({"message": "a"}, ""),
        ({"detail": "a"}, "a"),
        ({"detail": [{"loc": ["body"], "msg": "a"}]}, "a"),
        ({"error": None}, ""),
        ({"error": {}}, ""),
        ([], ""),
    ],
)
def test_what_servers_say_went_wrong(body: Any, said: str) -> None:
    assert said_wrong(body) == said


class TestProbe:
    """A grammar counts only after the server has shown that it heeds grammars."""

    @pytest.mark.parametrize(
        ("spec", "field"),
        [(spec, SENT[spec][0]) for spec in SENT if SENT[spec][0]],
    )
    def test_a_server_that_heeds(self, spec: str, field: str) -> None:
        provider, model, _ = split(spec)
        response = request(grammars=GRAMMARS)
        with FakeServer(
            ['{"plan": ""}', "<Plan/>"], heeds=[field], models=[model or "default"]
        ) as server:
            reply = answer(model_at(server, provider, model, constrain=Constrain.PROBE), response)
            assert server.plan_requests[0].grammar_field == field
        assert reply.constrained == SENT[spec][1]
        assert reply.requests == len(server.received) == (3 if "-old" in spec else 2)

    @pytest.mark.parametrize("refuses", [False, True])
    def test_a_server_that_does_not_heed_gets_no_grammar(self, refuses: bool) -> None:
        fields = ("structured_outputs", "guided_grammar")
        with FakeServer(refuses=fields if refuses else ()) as server:
            reply = answer(model_at(server, constrain=Constrain.PROBE), request(grammars=GRAMMARS))
            assert [each.grammar_field for each in server.received] == [*fields, ""]
        assert (reply.text, reply.constrained) == ("<Plan/>", None)

    def test_a_server_is_probed_once(self) -> None:
        response = request(grammars=GRAMMARS)
        with FakeServer(heeds=["ebnf"]) as server:
            model = model_at(server, "sglang", constrain=Constrain.PROBE)
            assert [answer(model, response).requests for _ in range(3)] == [2, 1, 1]
            again = find_again(server)
            assert answer(again, response).requests == 1

    @pytest.mark.parametrize(
        "fault", ["reset", "503", "hang", "garbage", "cut-json", "429:0", "error-in-200"]
    )
    def test_a_probe_that_fails_fails_nothing(self, fault: str) -> None:
        response = request(grammars=GRAMMARS)
        with FakeServer(faults=[fault], heeds=["ebnf"]) as server:
            model = model_at(server, "sglang", constrain=Constrain.PROBE, timeout_s=0.5)
            first, second = answer(model, response), answer(model, response)
        assert (first.text, first.constrained) == ("<Plan/>", None)
        assert second.constrained is Constraint.GBNF  # asked again, since nothing was learnt

    def test_without_a_grammar_there_is_no_probe(self) -> None:
        with FakeServer(heeds=["ebnf"]) as server:
            assert answer(model_at(server, "sglang", constrain=Constrain.PROBE)).requests == 1

    def test_an_answer_that_is_no_plan_in_json_was_not_constrained(self) -> None:
        response = request(grammars=GRAMMARS)
        for text in ("<Plan/>", "[1]", "{"):
            with FakeServer([text], heeds=["format"]) as server:
                reply = answer(model_at(server, "ollama", constrain=Constrain.PROBE), response)
            assert (reply.text, reply.constrained) == (text, None)


def find_again(server: FakeServer) -> Any:
    """A second model at the same server, with what is known of it."""
    return find_model("sglang:tiny", ModelSettings(base_url=server.url))


def test_a_conversation_is_sent_in_order() -> None:
    turns = (Message(Role.USER, "a"), Message(Role.ASSISTANT, "b"), Message(Role.USER, "c\ud800"))
    with FakeServer() as server:
        answer(model_at(server), Request(turns))
        assert [turn["content"] for turn in server.received[0].body["messages"]] == ["a", "b", "c?"]


def test_providers_have_the_names_of_their_modules() -> None:
    for spec in SENT:
        provider, _, _ = split(spec)
        assert find_provider(f"{provider}:m")[0].name == provider
