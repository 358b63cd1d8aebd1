"""Models that are asked in tests."""

from __future__ import annotations

import asyncio
import json
import traceback
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.generation.language_model import Answer, Constraint, Message, ModelError, Request, Role
from gpsfsm.generation.providers import Constrain, ModelSettings, find_model
from gpsfsm.generation.providers.address import Secret
from gpsfsm.generation.providers.http_model import PROBES

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel
    from tests.generation.fake_server import FakeServer

KEY = "sk-proj-9f8e7d6c5b4a39281706"
WAIT_S = 30.0
GRAMMARS = (
    (Constraint.GBNF, 'root ::= "<Plan/>"\n'),
    (Constraint.LARK, 'start: "<Plan/>"\n'),
    (Constraint.JSON_SCHEMA, '{"type": "object"}'),
)


def request(text: str = "Go home.", **more: Any) -> Request:
    return Request((Message(Role.SYSTEM, "You plan."), Message(Role.USER, text)), **more)


def rendered(text: str) -> str:
    """Stands for the renderer of plans: JSON in, XML out."""
    data = json.loads(text)
    if not isinstance(data, dict) or "plan" not in data:
        raise ValueError("no plan")
    return f"<Plan>{data['plan']}</Plan>"


def model_at(
    server: FakeServer | str, provider: str = "vllm", model: str = "tiny", **settings: Any
) -> LanguageModel:
    """A model that does not wait long; nothing is known of servers from other tests."""
    PROBES.forget()
    url = server if isinstance(server, str) else server.url
    settings.setdefault("max_wait_s", 0.0)
    settings.setdefault("constrain", Constrain.NEVER)
    if "key" in settings:
        settings["key"] = Secret(settings["key"], "THE_KEY")
    model_settings = ModelSettings(base_url=url, **settings)
    return find_model(f"{provider}:{model}", model_settings, rendered=rendered)


async def _answers(model: LanguageModel, requests: tuple[Request, ...]) -> list[Answer]:
    try:
        async with asyncio.timeout(WAIT_S):
            return [await model.answer(each) for each in requests]
    finally:
        await model.close()


def ask(model: LanguageModel, *requests: Request) -> list[Answer]:
    return asyncio.run(_answers(model, requests or (request(),)))


def answer(model: LanguageModel, question: Request | None = None) -> Answer:
    (result,) = ask(model, question or request())
    return result


def fails(model: LanguageModel, question: Request | None = None) -> ModelError:
    with pytest.raises(ModelError) as caught:
        ask(model, question or request())
    return caught.value


def everything_of(error: BaseException) -> str:
    """All that a tool could show of an exception, local variables too."""
    shown = traceback.TracebackException.from_exception(error, capture_locals=True)
    return "".join(shown.format())
