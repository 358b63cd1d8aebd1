"""The options about models, as commands get them, with environment and configuration file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import pytest

from gpsfsm.checking.config import load_config
from gpsfsm.checking.settings import ModelTable, Settings
from gpsfsm.cli._model import MODEL_PARAMETERS, model_options, model_settings
from gpsfsm.cli._options import config_options, settle
from gpsfsm.errors import ConfigError, UsageError
from gpsfsm.generation.providers import Constrain, ModelSettings
from tests.generation.providers.asking import KEY

VARIABLES = (
    *("GPSFSM_MODEL", "GPSFSM_BASE_URL", "GPSFSM_API_KEY", "GPSFSM_TIMEOUT", "GPSFSM_CONTEXT"),
    *("OPENAI_API_KEY", "OPENAI_BASE_URL", "OLLAMA_HOST", "OLLAMA_API_KEY"),
)
WHOLE = """
[model]
name = "vllm:Qwen/Qwen3-8B"
base-url = "http://gpu.example:8000/v1"
api-key-env = "GPU_API_KEY"
temperature = 0
max-tokens = 2048
timeout = 60
retries = 5
max-wait = 30
context = 32768
max-answer-bytes = 100000
prompt-price = 1
answer-price = 2.5
constrain = "always"
dialect = "guided_grammar"
thinking = true
"""


@pytest.fixture(autouse=True)
def _alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)


def settings(*arguments: str, timeout: str = "--timeout") -> ModelSettings:
    """What a command makes of its arguments."""
    results: list[ModelSettings] = []

    @click.command()
    @model_options(timeout=timeout)
    @config_options
    @click.pass_context
    def command(context: click.Context, /, **_: Any) -> None:
        settle(context)
        results.append(model_settings(context))

    command.main(list(arguments), standalone_mode=False)
    return results[0]


def configure(text: str, name: str = "gpsfsm.toml") -> str:
    Path(name).write_text(text, encoding="utf-8")
    return name


def permit(variable: str, host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a user does it."""
    own = Path("home/gpsfsm")
    own.mkdir(parents=True)
    (own / "config.toml").write_text(f'[keys.{variable}]\nhosts = ["{host}"]\n', encoding="utf-8")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(own.parent.resolve()))


def test_nothing_is_said() -> None:
    assert settings() == ModelSettings()


def test_every_option() -> None:
    arguments = (
        *("--model", "vllm:m", "--base-url", "http://x", "--temperature", "0.5"),
        *("--max-tokens", "9", "--timeout", "7", "--retries", "1", "--context", "4096"),
        "--no-constrain",
    )
    chosen = settings(*arguments)
    assert (chosen.spec, chosen.base_url, chosen.temperature) == ("vllm:m", "http://x", 0.5)
    assert (chosen.max_tokens, chosen.timeout_s, chosen.retries) == (9, 7.0, 1)
    assert (chosen.context_tokens, chosen.constrain) == (4096, Constrain.NEVER)
    assert settings("--model-timeout", "7", timeout="--model-timeout").timeout_s == 7.0


def test_every_key_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    configure(WHOLE)
    monkeypatch.setenv("GPU_API_KEY", KEY)
    with pytest.raises(UsageError, match=r"gpsfsm\.toml:4: GPU_API_KEY is not sent to"):
        settings()
    permit("GPU_API_KEY", "http://gpu.example:8000", monkeypatch)
    chosen = settings()
    assert (chosen.spec, chosen.base_url) == ("vllm:Qwen/Qwen3-8B", "http://gpu.example:8000/v1")
    assert (chosen.key.reveal(), chosen.key.source) == (KEY, "GPU_API_KEY")
    assert (chosen.temperature, chosen.max_tokens, chosen.timeout_s) == (0.0, 2048, 60.0)
    assert (chosen.retries, chosen.max_wait_s, chosen.context_tokens) == (5, 30.0, 32_768)
    assert (chosen.max_answer_bytes, chosen.prompt_price, chosen.answer_price) == (
        100_000,
        1.0,
        2.5,
    )
    assert (chosen.constrain, chosen.dialect) == (Constrain.ALWAYS, "guided_grammar")
    assert chosen.thinking
    keys = {line.split(" = ")[0] for line in WHOLE.splitlines() if " = " in line}
    assert keys == {name.replace("_", "-") for name in ModelTable.model_fields}


def test_an_option_then_a_variable_then_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    configure("[tool.gpsfsm.model]\nname = 'vllm:file'\ntimeout = 5", "pyproject.toml")
    assert settings().spec == "vllm:file"
    monkeypatch.setenv("GPSFSM_MODEL", "vllm:env")
    assert settings().spec == "vllm:env"
    assert settings("--model", "vllm:flag").spec == "vllm:flag"
    assert settings("--model", "vllm:flag").timeout_s == 5.0
    assert settings("--isolated").timeout_s == 300.0
    other = configure("[model]\ntimeout = 6", "other.toml")
    assert settings("--config", other).timeout_s == 6.0


def test_no_parameter_is_mistaken_for_a_key_of_the_file() -> None:
    assert not MODEL_PARAMETERS & set(Settings.model_fields)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("model = 'x'", "'model' must be"),
        ("[model]\nname = 3", "'model.name' must be a valid string, not 3"),
        ("[model]\ntimout = 3", "there is no key 'model.timout'; did you mean 'model.timeout'?"),
        (
            "[model]\nzzz = 3",
            "there is no key 'model.zzz'; the keys are model.name, model.base-url",
        ),
        ("[model]\nretries = 99", "'model.retries' must be less than or equal to 20, not 99"),
        ("[model]\ntemperature = nan", "'model.temperature' must be"),
        ("[model]\nconstrain = 'no'", "'model.constrain' must be 'probe', 'always' or 'never'"),
        (f"[model]\napi-key = '{KEY}'", "model keys do not belong in a file: put the key in an"),
        (f"api-key = '{KEY}'", "model keys do not belong in a file: put the key in an"),
        (f"[model]\nkey = '{KEY}'", "the variable's name in 'model.api-key-env'"),
        (f"[model]\napi-key-env = '{KEY}'", "must be the name of an environment variable, not a"),
    ],
)
def test_what_does_not_fit_in_the_file(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(configure(text))
    assert said in str(caught.value)
    assert KEY not in str(caught.value)


def test_what_looks_like_a_name_and_is_a_key() -> None:
    configure("[model]\nname = 'vllm:m'\napi-key-env = 'sk_live_abcdef'")
    with pytest.raises(UsageError) as caught:
        settings()
    assert "must be the name of an environment variable" in str(caught.value)
    assert "sk_live" not in str(caught.value)


def test_choosing_a_model_loads_no_client() -> None:
    code = (
        "import sys\n"
        "from gpsfsm.generation.providers import find_model, provider_names\n"
        "for name in provider_names():\n"
        "    if name not in ('replay', 'openai-compatible'):\n"
        "        find_model(f'{name}:m')\n"
        "print({'httpx', 'pydantic', 'z3', 'yaml', 'lxml'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
