"""Which providers there are: the modules of ``known``, and those of other packages.

Another package adds providers through the entry point group ``gpsfsm.models``: the name of an
entry is the one that users write before the colon, the object is a ``Provider``. It cannot replace
a built-in one.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers import known
from gpsfsm.generation.providers.settings import ModelSettings, settings_of
from gpsfsm.model.printable import clip
from gpsfsm.plugins import find_plugin

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel

__all__ = ["GROUP", "Provider", "Rendered", "find_model", "find_provider", "provider_names"]

GROUP = "gpsfsm.models"
"""The group of entry points."""

Rendered: TypeAlias = Callable[[str], str]
"""Writes a plan that came as JSON (``Constraint.JSON_SCHEMA``) as XML; raises if it is none."""

_EXAMPLE = "such as ollama:qwen3:8b or openai:gpt-5"


@dataclass(frozen=True, slots=True)
class Provider:
    """Someone who has models.

    ``make(model, settings, rendered)`` gives one; it need not be reachable then. ``default_model``
    "" means that a model must be named. ``url_variable`` and ``key_variables`` are environment
    variables that hold for this provider, besides those of gpsfsm. ``default_url`` is where its own
    server is: there the keys of these variables may go.
    """

    name: str
    make: Callable[[str, ModelSettings, Rendered | None], LanguageModel]
    default_model: str = ""
    url_variable: str = ""
    key_variables: tuple[str, ...] = ()
    default_url: str = ""


@cache
def provider_names() -> tuple[str, ...]:
    """The names of the built-in providers; imports none of them."""
    modules = (module.name for module in pkgutil.iter_modules(known.__path__))
    return tuple(sorted(_called(name) for name in modules if not name.startswith("_")))


def find_provider(spec: str) -> tuple[Provider, str]:
    """The provider of ``provider:model``, and the model. Raises UsageError."""
    name, _, model = spec.strip().partition(":")
    if not name:
        raise UsageError(f"no model is named; write provider:model, {_EXAMPLE}")
    if name in provider_names():
        module = importlib.import_module(f"{known.__name__}.{name.replace('-', '_')}")
        found: Provider = module.PROVIDER
    else:
        found = _foreign(name)
    model = model or found.default_model
    if not model:
        raise UsageError(f"'{clip(spec, 80)}' names no model; write {name}:MODEL")
    if not model.isprintable() or len(model) > 4096:
        raise UsageError(f"'{clip(spec, 80)}' cannot be the name of a model")
    return found, model


def find_model(
    spec: str, settings: ModelSettings | None = None, *, rendered: Rendered | None = None
) -> LanguageModel:
    """The model that ``provider:model`` names.

    ``settings`` of None are those of the environment; their own ``spec`` does not count here.
    Without ``rendered`` no JSON schema is sent, since nobody could read the answer. Raises
    GpsfsmError for a model that cannot be asked, whoever answers; nothing is sent yet.
    """
    provider, model = find_provider(spec)
    if settings is None:
        settings = settings_of({"name": spec})
    return provider.make(model, replace(settings, spec=spec), rendered)


def _called(module: str) -> str:
    return module.replace("_", "-")


def _foreign(name: str) -> Provider:
    """A provider of another package; only looked for here, because that is slow."""
    found, offered = find_plugin(GROUP, name, Provider, noun="provider", expected=Provider.__name__)
    if found is not None:
        return found
    import difflib  # noqa: PLC0415

    names = (*provider_names(), *offered)
    near = difflib.get_close_matches(name[:60], names, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"write provider:model, {_EXAMPLE}."
    raise UsageError(
        f"there is no provider '{clip(name, 60)}'; {hint} Providers are: {', '.join(names)}"
    )
