"""Finding providers and models by name."""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers import (
    GROUP,
    ModelSettings,
    Provider,
    find_model,
    find_provider,
    provider_names,
)
from gpsfsm.generation.providers.builtin import replay

if TYPE_CHECKING:
    from pathlib import Path


@dataclass
class Entry:
    name: str
    value: str
    loaded: Any

    def load(self) -> Any:
        if isinstance(self.loaded, Exception):
            raise self.loaded
        return self.loaded


def offer(monkeypatch: pytest.MonkeyPatch, *entries: Entry) -> None:
    def entry_points(*, group: str) -> list[Entry]:
        assert group == GROUP
        return list(entries)

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)


def test_the_built_in_ones() -> None:
    assert provider_names() == (
        *("llamacpp", "ollama", "openai", "openai-compatible", "prompt-tools", "replay", "sglang"),
        "vllm",
    )
    for name in provider_names():
        assert find_provider(f"{name}:a:b") == (find_provider(f"{name}:x")[0], "a:b")


def test_a_model_has_the_name_that_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OLLAMA_HOST", "robot:1")
    model = find_model("ollama:qwen3:8b")
    assert model.name == "ollama:qwen3:8b"
    assert repr(model) == "<ollama:qwen3:8b at http://robot:1>"
    assert find_model("llamacpp").name == "llamacpp:default"
    settings = ModelSettings(base_url="http://x", context_tokens=512)
    assert find_model("vllm:m", settings).context_tokens == 512


def test_another_package_adds_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    file.write_text('{"answer": "<Plan/>"}\n')
    added = Provider("mine", lambda _, settings, __: replay.Replay(str(file), settings))
    offer(monkeypatch, Entry("mine", "my.module:PROVIDER", added))
    assert find_model("mine:x", ModelSettings()).name == f"replay:{file}"


def test_a_built_in_one_cannot_be_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    offer(monkeypatch, Entry("ollama", "evil:PROVIDER", ImportError("loaded")))
    assert find_provider("ollama:m")[0].name == "ollama"


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("broken:m", "the provider 'broken' (b:P) fails to load: no such thing"),
        ("odd:m", "the provider 'odd' (o:P) is not a Provider"),
        ("nobody:m", "there is no provider 'nobody'"),
        ("nobody:m", "openai-compatible, prompt-tools, replay, sglang, vllm, broken, odd"),
        ("\x1b[31m:m", "there is no provider '\\x1b[31m'"),
        ("ollama:\x1b[31m", "cannot be the name of a model"),
        ("ollama:" + "x" * 5000, "cannot be the name of a model"),
        ("", "no model is named"),
    ],
)
def test_what_cannot_be_found(spec: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    offer(
        monkeypatch,
        Entry("broken", "b:P", ImportError("no such thing")),
        Entry("odd", "o:P", object()),
    )
    with pytest.raises(UsageError) as caught:
        find_provider(spec)
    assert said in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (ModelSettings(dialect="ebnf"), "vllm:m has no dialect 'ebnf'; its dialects are: str"),
        (ModelSettings(base_url="http://u:p@x"), "the base URL has a user or password in it"),
    ],
)
def test_settings_that_do_not_fit(settings: ModelSettings, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        find_model("vllm:m", settings)


def test_a_server_without_an_address_of_its_own() -> None:
    with pytest.raises(UsageError, match="openai-compatible has no default address"):
        find_model("openai-compatible:m", ModelSettings())
