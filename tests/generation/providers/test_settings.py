"""Which settings hold, and that a key shows nowhere."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
from typing import Any

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers import Configured, Constrain, ModelSettings, settings_of
from gpsfsm.generation.providers.address import Secret, address
from tests.generation.providers.asking import KEY

TABLE = {
    "name": "vllm:file",
    "base_url": "http://file:1",
    "timeout": 1.0,
    "retries": 1,
    "context": 1000,
    "temperature": 0.1,
    "max_tokens": 10,
    "max_wait": 2.0,
    "max_answer_bytes": 4096,
    "prompt_price": 3,
    "answer_price": 4,
    "constrain": "always",
    "dialect": "guided_grammar",
    "thinking": True,
}
FILE = Configured(project=TABLE)
VARIABLES = {
    "GPSFSM_MODEL": "vllm:env",
    "GPSFSM_BASE_URL": "http://env:1",
    "GPSFSM_TIMEOUT": "2",
    "GPSFSM_RETRIES": "2",
    "GPSFSM_CONTEXT": "2000",
    "GPSFSM_TEMPERATURE": "0.2",
    "GPSFSM_MAX_TOKENS": "20",
}
FLAGS = {
    "name": "vllm:flag",
    "base_url": "http://flag:1",
    "timeout": 3.0,
    "retries": 3,
    "context": 3000,
    "temperature": 0.3,
    "max_tokens": 30,
    "constrain": "never",
}


def named(settings: ModelSettings) -> tuple[Any, ...]:
    return (
        settings.spec,
        settings.base_url,
        settings.timeout_s,
        settings.retries,
        settings.context_tokens,
        settings.temperature,
        settings.max_tokens,
    )


class TestPrecedence:
    def test_a_flag_before_a_variable_before_the_file(self) -> None:
        settings = settings_of(FLAGS, environment=VARIABLES, configured=FILE)
        assert named(settings) == ("vllm:flag", "http://flag:1", 3.0, 3, 3000, 0.3, 30)
        settings = settings_of({}, environment=VARIABLES, configured=FILE)
        assert named(settings) == ("vllm:env", "http://env:1", 2.0, 2, 2000, 0.2, 20)
        settings = settings_of(dict.fromkeys(FLAGS), environment={}, configured=FILE)
        assert named(settings) == ("vllm:file", "http://file:1", 1.0, 1, 1000, 0.1, 10)

    def test_all_keys_of_the_file(self) -> None:
        settings = settings_of(environment={}, configured=FILE)
        assert (settings.max_wait_s, settings.max_answer_bytes) == (2.0, 4096)
        assert (settings.prompt_price, settings.answer_price) == (3.0, 4.0)
        assert (settings.constrain, settings.dialect) == (Constrain.ALWAYS, "guided_grammar")
        assert settings.thinking

    def test_without_anything(self) -> None:
        assert settings_of(environment={}) == ModelSettings()
        assert settings_of({"constrain": "never"}, environment={}).constrain is Constrain.NEVER

    def test_what_the_file_says_of_another_model_does_not_hold(self) -> None:
        settings = settings_of({"name": "vllm:other"}, environment={}, configured=FILE)
        assert (settings.base_url, settings.dialect) == ("http://file:1", "guided_grammar")
        assert (settings.context_tokens, settings.prompt_price) == (None, None)
        settings = settings_of({"name": "sglang:file"}, environment={}, configured=FILE)
        assert (settings.base_url, settings.dialect, settings.timeout_s) == ("", "", 1.0)

    def test_variables_of_the_provider(self) -> None:
        environment = {"OLLAMA_HOST": "robot:1", "OPENAI_BASE_URL": "https://proxy.example/v1"}
        assert settings_of({"name": "ollama:m"}, environment=environment).base_url == "robot:1"
        settings = settings_of({"name": "openai:m"}, environment=environment)
        assert settings.base_url == "https://proxy.example/v1"
        assert settings_of({"name": "vllm:m"}, environment=environment).base_url == ""

    @pytest.mark.parametrize(
        ("flags", "environment", "said"),
        [
            ({"temperature": float("nan")}, {}, "--temperature must be a number from 0 to 2"),
            ({"retries": 21}, {}, "--retries must be a whole number from 0 to 20, not 21"),
            ({}, {"GPSFSM_TIMEOUT": "soon"}, "GPSFSM_TIMEOUT must be a number, not 'soon'"),
            ({}, {"GPSFSM_RETRIES": "1.5"}, "GPSFSM_RETRIES must be a whole number"),
            ({}, {"GPSFSM_CONTEXT": "inf"}, "GPSFSM_CONTEXT must be a whole number"),
            ({"name": "qwen3"}, {}, "there is no provider 'qwen3'; write provider:model"),
            ({"name": "ollama:"}, {}, "'ollama:' names no model; write ollama:MODEL"),
            ({"name": ":x"}, {}, "no model is named; write provider:model"),
        ],
    )
    def test_what_makes_no_sense(
        self, flags: dict[str, Any], environment: dict[str, str], said: str
    ) -> None:
        with pytest.raises(UsageError) as caught:
            settings_of(flags, environment=environment)
        assert said in str(caught.value)


OWN = {"OPENAI_API_KEY": "sk-openai-own", "GPSFSM_API_KEY": ""}


class TestKeys:
    def test_the_provider_s_own(self) -> None:
        key = settings_of({"name": "openai:m"}, environment=OWN).key
        assert (key.reveal(), key.source) == ("sk-openai-own", "OPENAI_API_KEY")
        assert not settings_of({"name": "vllm:m"}, environment=OWN).key

    def test_that_of_gpsfsm_comes_first(self) -> None:
        environment = {**OWN, "GPSFSM_API_KEY": " sk-gpsfsm \n"}
        assert (
            settings_of({"name": "openai:m"}, environment=environment).key.reveal() == "sk-gpsfsm"
        )

    def test_a_file_names_a_variable(self) -> None:
        table = {"name": "vllm:m", "base_url": "http://gpu:1", "api_key_env": "GPU_API_KEY"}
        own = Configured(user=table)
        key = settings_of(environment={"GPU_API_KEY": KEY}, configured=own).key
        assert (key.reveal(), key.source) == (KEY, "GPU_API_KEY")
        for files in (own, Configured(project=table)):
            missing = settings_of(environment={}, configured=files).key
            assert (bool(missing), missing.source) == (False, "GPU_API_KEY")

    @pytest.mark.parametrize(
        "value", [KEY, "HOME", "sk_abc", "AWS_SECRET_ACCESS_KEY", "GITHUB_TOKEN"]
    )
    def test_a_file_cannot_name_anything_else(self, value: str) -> None:
        table = {"name": "vllm:m", "api_key_env": value}
        for files in (Configured(project=table), Configured(user=table)):
            with pytest.raises(UsageError) as caught:
                settings_of(environment={value: "x"}, configured=files)
            assert "has to be" in str(caught.value) or "must be the name" in str(caught.value)
            assert value not in str(caught.value)

    @pytest.mark.parametrize("value", ["a\nb", "a b", "schl\xfcssel", "a\x00b", "\ud800"])
    def test_what_cannot_be_in_a_header(self, value: str) -> None:
        with pytest.raises(UsageError) as caught:
            settings_of({"name": "openai:m"}, environment={"OPENAI_API_KEY": value})
        assert str(caught.value) == (
            "the key in OPENAI_API_KEY cannot be one: it has blanks or odd characters"
        )


EVIL = "https://evil.example/v1"
LISTED = {"OPENAI_API_KEY": ["gpu.example:8000"], "GPSFSM_API_KEY": ["gpu.example:8000"]}


class TestWhereKeysGo:
    """A key goes where the user says, not where the file of a project does."""

    def test_an_address_of_a_project_never_gets_the_key_of_the_service(self) -> None:
        files = Configured(project={"name": "openai:m", "base_url": EVIL})
        assert not settings_of(environment=OWN, configured=files).key
        mine = {"base_url": "https://mine.example"}
        assert settings_of({**mine, "name": "openai:m"}, environment=OWN, configured=files).key

    def test_a_project_does_not_choose_the_key_by_choosing_the_provider(self) -> None:
        files = Configured(project={"name": "openai:m"})
        mine = {"base_url": "https://mine.example"}
        assert not settings_of(mine, environment=OWN, configured=files).key
        assert settings_of({}, environment=OWN, configured=files).key  # it goes to its own host

    @pytest.mark.parametrize("variable", ["OPENAI_API_KEY", "AWS_API_KEY", "GPSFSM_API_KEY"])
    def test_an_address_and_a_variable_of_a_project(self, variable: str) -> None:
        table = {"name": "vllm:m", "base_url": EVIL, "api_key_env": variable}
        places = {"base_url": "/p/gpsfsm.toml:3"}
        files = Configured(project=table, places=places, user_file="/home/me/config.toml")
        with pytest.raises(UsageError) as caught:
            settings_of(environment={variable: KEY}, configured=files)
        said = str(caught.value)
        assert said.startswith(
            f"/p/gpsfsm.toml:3: {variable} is not sent to evil.example, since 'model.base-url' is "
            "chosen by the project; if that is what you want, "
        )
        lines = f'  [keys.{variable}]\n  hosts = ["evil.example"]'
        assert said.endswith(f"write into /home/me/config.toml:\n{lines}")
        permitted = Configured(project=table, keys={variable: ["evil.example"]})
        assert settings_of(environment={variable: KEY}, configured=permitted).key

    def test_a_variable_of_a_project_to_an_address_of_the_user(self) -> None:
        files = Configured(
            project={"name": "vllm:m", "api_key_env": "AWS_API_KEY"},
            places={"api_key_env": "/p/gpsfsm.toml:2"},
        )
        environment = {"AWS_API_KEY": KEY}
        for flags in ({"base_url": "https://mine.example"}, {"name": "vllm:m"}):
            with pytest.raises(UsageError) as caught:
                settings_of(flags, environment=environment, configured=files)
            assert str(caught.value).startswith("/p/gpsfsm.toml:2: AWS_API_KEY is not sent to ")
            assert "--base-url" not in str(caught.value)  # that would not help

    def test_a_provider_of_a_project_with_the_key_of_the_user(self) -> None:
        files = Configured(project={"name": "vllm:m"}, places={"name": "/p/gpsfsm.toml:1"})
        environment = {"GPSFSM_API_KEY": KEY}
        with pytest.raises(UsageError) as caught:
            settings_of(environment=environment, configured=files)
        assert str(caught.value).startswith(
            "/p/gpsfsm.toml:1: GPSFSM_API_KEY is not sent to localhost:8000, since 'model.name' is "
            "chosen by the project; if that is what you want, name the server yourself (--base-url "
            "or GPSFSM_BASE_URL), or write into "
        )
        for flags in ({"name": "vllm:m"}, {"base_url": "http://localhost:8000"}):
            assert settings_of(flags, environment=environment, configured=files).key
        nothing = Configured(project={"name": "replay:answers.jsonl"})
        assert not settings_of(environment=environment, configured=nothing).key

    @pytest.mark.parametrize(
        ("url", "goes"),
        [
            ("https://gpu.example:8000/v1", True),
            ("https://GPU.Example.:8000/v1", True),
            ("https://gpu.example/v1", False),
            ("https://gpu.example:8001/v1", False),
            ("https://gpu.example.evil:8000/v1", False),
            ("https://evil-gpu.example:8000/v1", False),
            ("https://sub.gpu.example:8000/v1", False),
            ("https://xn--gpu-example-8000/v1", False),
            ("http://127.0.0.1:8000/v1", False),
            ("http://[::1]:8000/v1", False),
            ("http://gpu.example:8000/v1", False),
            ("http://gpu.example/v1", False),
        ],
    )
    def test_the_list_of_hosts(self, url: str, goes: bool) -> None:
        for name in ("openai:m", "vllm:m"):
            files = Configured(project={"name": name, "base_url": url}, keys=LISTED)
            if goes:
                assert settings_of(environment={"GPSFSM_API_KEY": KEY}, configured=files).key
                continue
            with pytest.raises(UsageError) as caught:
                settings_of(environment={"GPSFSM_API_KEY": KEY}, configured=files)
            assert "GPSFSM_API_KEY is not sent to" in str(caught.value)
            assert KEY not in str(caught.value)

    @pytest.mark.parametrize(
        "url",
        ["https://api.openai.com@evil.example/v1", "https://user:pw@api.openai.com/v1"],
    )
    def test_names_in_an_address(self, url: str) -> None:
        files = Configured(project={"name": "openai:m", "base_url": url})
        with pytest.raises(UsageError, match="has a user or password in it"):
            settings_of(environment=OWN, configured=files)

    @pytest.mark.parametrize("source", ["flag", "variable", "user", "project"])
    def test_nothing_is_sent_unencrypted_that_need_not_be(self, source: str) -> None:
        url, environment = "http://api.openai.com/v1", dict(OWN)
        flags = {"name": "openai:m"}
        files = Configured(user_file="/home/me/config.toml")
        if source == "flag":
            flags["base_url"] = url
        elif source == "variable":
            environment["OPENAI_BASE_URL"] = url
        else:
            files = dataclasses.replace(files, **{source: {"base_url": url}})
        with pytest.raises(UsageError, match="without encryption others can read it; use https"):
            settings_of(flags, environment=environment, configured=files)
        permitted = {"OPENAI_API_KEY": ["http://api.openai.com"]}
        allowed = dataclasses.replace(files, keys=permitted)
        assert settings_of(flags, environment=environment, configured=allowed).key

    def test_a_server_that_the_user_names_without_encryption(self) -> None:
        flags = {"name": "vllm:m", "base_url": "http://gpu.example:8000"}
        assert settings_of(flags, environment={"GPSFSM_API_KEY": KEY}).key
        files = Configured(keys={"GPSFSM_API_KEY": ["gpu.example:8000"]})
        with pytest.raises(UsageError, match="without encryption"):  # a list says how
            settings_of(flags, environment={"GPSFSM_API_KEY": KEY}, configured=files)

    def test_the_user_s_own_file_joins_that_of_the_project(self) -> None:
        user = {"name": "vllm:m", "base_url": "https://gpu.example", "api_key_env": "GPU_API_KEY"}
        environment = {"GPU_API_KEY": KEY}
        files = Configured(user=user)
        assert settings_of(environment=environment, configured=files).key
        files = Configured(user=user, project={"timeout": 5.0})
        settings = settings_of(environment=environment, configured=files)
        assert (settings.base_url, settings.timeout_s, bool(settings.key)) == (
            "https://gpu.example",
            5.0,
            True,
        )
        files = Configured(user=user, project={"base_url": EVIL})
        with pytest.raises(UsageError, match=r"is not sent to evil\.example"):
            settings_of(environment=environment, configured=files)
        files = Configured(user=user, project={"name": "sglang:m", "base_url": EVIL})
        assert not settings_of(environment=environment, configured=files).key


class TestSecret:
    SETTINGS = ModelSettings(key=Secret(KEY, "THE_KEY"))

    def test_it_shows_nowhere(self) -> None:
        secret = self.SETTINGS.key
        for shown in (repr(secret), str(secret), f"{secret}", f"{secret!r:>50}", repr([secret])):
            assert KEY not in shown
        assert repr(secret) == "Secret('***', 'THE_KEY')"
        assert KEY not in repr(self.SETTINGS)
        assert KEY not in str(dataclasses.asdict(self.SETTINGS))
        assert not hasattr(secret, "__dict__")

    def test_it_is_not_written(self) -> None:
        with pytest.raises(TypeError):
            pickle.dumps(self.SETTINGS)
        with pytest.raises(TypeError):
            json.dumps(dataclasses.asdict(self.SETTINGS))

    def test_it_is_a_value(self) -> None:
        assert Secret(KEY) == Secret(f" {KEY} ")
        assert Secret(KEY) != Secret("other")
        assert Secret(KEY) != KEY
        assert len({Secret(KEY), Secret(KEY, "x")}) == 1
        assert copy.deepcopy(Secret(KEY)).reveal() == KEY
        assert copy.copy(Secret(KEY)).reveal() == KEY
        assert (repr(Secret()), str(Secret()), bool(Secret())) == ("Secret()", "", False)

    def test_it_is_taken_out_of_texts(self) -> None:
        assert Secret(KEY).hidden(f"a {KEY}{KEY} b") == "a ****** b"
        assert Secret("EMPTY").hidden("EMPTY room") == "EMPTY room"
        assert Secret().hidden("as it is") == "as it is"


class TestAddress:
    @pytest.mark.parametrize(
        ("text", "provider", "expected"),
        [
            ("http://localhost:8000", "vllm", "http://localhost:8000/v1"),
            ("http://localhost:8000/", "vllm", "http://localhost:8000/v1"),
            ("http://localhost:8000/v1/", "vllm", "http://localhost:8000/v1"),
            ("https://x.example/openai/v1/chat/completions", "vllm", "https://x.example/openai/v1"),
            ("gpu", "sglang", "http://gpu/v1"),
            ("HTTP://GPU:80", "sglang", "http://gpu:80/v1"),
            ("[::1]:8000", "vllm", "http://[::1]:8000/v1"),
            ("", "vllm", None),
            ("localhost", "ollama", "http://localhost:11434"),
            ("0.0.0.0:7", "ollama", "http://127.0.0.1:7"),
            ("http://robot/v1", "ollama", "http://robot"),
            ("http://robot:1/api/", "ollama", "http://robot:1"),
            ("[::]", "ollama", "http://[::1]:11434"),
            (":7", "ollama", "http://127.0.0.1:7"),
            ("http://robot:1/api/chat", "ollama", "http://robot:1"),
            ("http://robot:1/ollama/api/generate/", "ollama", "http://robot:1/ollama"),
        ],
    )
    def test_what_users_write(self, text: str, provider: str, expected: str | None) -> None:
        if expected is None:
            with pytest.raises(UsageError, match="name one with --base-url"):
                address(text, provider)
        else:
            assert address(text, provider) == expected

    @pytest.mark.parametrize(
        "text",
        [
            f"https://user:{KEY}@x.example/v1",
            f"https://{KEY}@x.example/v1",
            f"https://x.example/v1?key={KEY}",
            f"https://x.example/v1#{KEY}",
            f"ftp://x.example/{KEY}",
            f"https:///{KEY}",
            f"http://x.example:{KEY}",
            f"http://x y/{KEY}",
            f"http://x\n/{KEY}",
            f"http://x.example/{KEY * 100}",
            f"http://[::1/{KEY}",
            f"http:/x.example/{KEY}",
            f"https:x.example/{KEY}",
            f"unix:///run/{KEY}.sock",
            f":80/{KEY}",
        ],
    )
    def test_what_is_none_is_not_repeated(self, text: str) -> None:
        with pytest.raises(UsageError) as caught:
            address(text, "vllm")
        assert "base URL" in str(caught.value)
        assert KEY not in str(caught.value)
