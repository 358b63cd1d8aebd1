"""A model behind HTTP: what all dialects have in common, and the test of a server's grammars.

Many servers ignore fields that they do not know, without a word. So a model is asked for something
that the grammar does not allow; if it answers exactly what the grammar allows, it is constrained.
This is done once for an endpoint, model and field in a process.
"""

from __future__ import annotations

import asyncio
import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.generation.language_model import (
    Answer,
    Constraint,
    Finish,
    Message,
    ModelError,
    Request,
    Role,
    completed,
    cost_of,
)
from gpsfsm.generation.prompt_builder import find_template
from gpsfsm.generation.providers import Constrain, Provider
from gpsfsm.generation.providers.address import address
from gpsfsm.generation.providers.dialect import Ask, without_thoughts
from gpsfsm.generation.providers.transport import Failure, Place, Transport
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.generation.providers import ModelSettings, Rendered
    from gpsfsm.generation.providers.dialect import Dialect, GrammarField, Reply
    from gpsfsm.generation.providers.transport import Received

_NOT_HEEDED = frozenset({400, 422, 501})
_LISTED = 10
_NO_MODEL = re.compile(r"model.*(?:not found|not exist|not a valid|unknown)", re.IGNORECASE)
_WORD = "ok"
_QUESTION = "Which seven days does a week have? Write all of them in one line."
_MAX_TOKENS = 1024  # reasoning models think first
_SCHEMA = {
    "type": "object",
    "properties": {"answer": {"type": "string", "enum": [_WORD]}},
    "required": ["answer"],
    "additionalProperties": False,
}
_GRAMMARS = {
    Constraint.GBNF: f'root ::= "{_WORD}"\n',
    Constraint.LARK: f'start: "{_WORD}"\n',
    Constraint.JSON_SCHEMA: json.dumps(_SCHEMA),
}


def probe_grammar(field: GrammarField) -> str:
    """A grammar that allows one answer."""
    return _GRAMMARS[field.constraint]


def probe_request() -> Request:
    """A question to which nobody would give that answer."""
    return Request((Message(Role.USER, _QUESTION),), max_tokens=_MAX_TOKENS)


def expected(field: GrammarField, text: str) -> bool:
    """True if an answer is the only one that the grammar allows."""
    if field.constraint is not Constraint.JSON_SCHEMA:
        return text.strip() == _WORD
    try:
        return bool(strict_loads(text) == {"answer": _WORD})
    except (ValueError, RecursionError):
        return False


class Probes:
    """The results of probes in this process."""

    def __init__(self) -> None:
        self._heeded: dict[tuple[str, str, str], bool] = {}

    def heeded(self, url: str, model: str, field: GrammarField) -> bool | None:
        """True if a server heeds grammars, None if it has not been tested."""
        return self._heeded.get((url, model, field.name))

    def learn(self, url: str, model: str, field: GrammarField, *, heeded: bool) -> None:
        """Keep what a probe has shown."""
        self._heeded[url, model, field.name] = heeded

    def forget(self) -> None:
        """Ask all servers again."""
        self._heeded.clear()


PROBES = Probes()
"""Of this process."""


def http_provider(
    name: str,
    dialect: Dialect,
    *,
    default_model: str = "",
    url_variable: str = "",
    key_variables: tuple[str, ...] = (),
) -> Provider:
    """Return a provider that is reached over HTTP in the given dialect.

    ``url_variable`` and ``key_variables`` are environment variables for its address and its keys.
    """

    def make(model: str, settings: ModelSettings, rendered: Rendered | None) -> LanguageModel:
        return HttpModel(name, model, dialect, settings, rendered=rendered)

    return Provider(name, make, default_model, url_variable, key_variables, dialect.default_url)


class HttpModel:
    """A model that a server has. ``probed`` is what is known of servers, by default to all."""

    def __init__(
        self,
        provider: str,
        model: str,
        dialect: Dialect,
        settings: ModelSettings,
        *,
        rendered: Rendered | None = None,
        probed: Probes = PROBES,
        transport: Transport | None = None,
    ) -> None:
        """Raises UsageError for an address or a dialect that cannot be."""
        self._provider, self._model = provider, model
        self._dialect, self._settings = dialect, settings
        self._rendered, self._probed = rendered, probed
        url = address(settings.base_url or dialect.default_url, provider)
        self._place = Place(url=url, key=settings.key, start_hint=dialect.start_hint)
        self._transport = transport or Transport(self._place, settings)
        self._fields = self._possible_fields()
        self._probing: tuple[asyncio.AbstractEventLoop, asyncio.Lock] | None = None
        self._unsure = 0  # probes that told nothing

    def __repr__(self) -> str:
        return f"<{self.name} at {self._place.url}>"

    @property
    def name(self) -> str:
        """Provider and model."""
        return f"{self._provider}:{self._model}"

    @property
    def context_tokens(self) -> int | None:
        """The tokens that prompt and answer may have together, as far as the user said."""
        return self._settings.context_tokens

    async def close(self) -> None:
        """Nothing is open between two requests."""

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError."""
        field, probes = await self._field(request)
        received = await self._send(self._ask(request, field))
        if isinstance(received, Failure):
            raise self._error(await self._explained(received))
        reply = self._dialect.reply(received.data)
        if (failure := _unusable(reply, request)) is not None:
            raise self._error(failure)
        return self._answer(request, reply, received, field, probes)

    def _answer(
        self,
        request: Request,
        reply: Reply,
        received: Received,
        field: GrammarField | None,
        probes: int,
    ) -> Answer:
        content = _writable(self._place.key.hidden(reply.text or ""))
        thoughts = _writable(self._place.key.hidden(reply.thoughts))
        text = without_thoughts(content)
        if not text.strip():
            raise self._error(_empty(reply, request))
        constrained = None if field is None else field.constraint
        if constrained is Constraint.JSON_SCHEMA and reply.finish is not Finish.LENGTH:
            text, constrained = self._as_xml(text)
        usage = completed(reply.usage, request, thoughts + content)
        return Answer(
            text=text,
            model=clip(self._place.key.hidden(reply.model), 200) or self._model,
            finish=reply.finish,
            usage=usage,
            latency_s=received.latency_s,
            constrained=constrained,
            raw=f"<think>{thoughts}</think>{content}" if thoughts else content,
            requests=received.requests + probes,
            cost=cost_of(usage, self._settings),
        )

    def _as_xml(self, text: str) -> tuple[str, Constraint | None]:
        """A plan that came as JSON, as XML; an answer that is none was not constrained."""
        assert self._rendered is not None
        try:
            return self._rendered(text), Constraint.JSON_SCHEMA
        except (GpsfsmError, ValueError):
            return text, None

    # --- how grammars are sent -------------------------------------------------------------------

    def _possible_fields(self) -> tuple[GrammarField, ...]:
        if self._settings.constrain is Constrain.NEVER:
            return ()
        fields = self._dialect.grammar_fields(self._model)
        wanted = self._settings.dialect
        if wanted and wanted not in {field.name for field in fields}:
            has = ", ".join(field.name for field in fields) or "none"
            raise UsageError(
                f"{self.name} has no dialect '{clip(wanted, 60)}'; its dialects are: {has}"
            )
        return tuple(
            field
            for field in fields
            if (not wanted or field.name == wanted)
            and (field.constraint is not Constraint.JSON_SCHEMA or self._rendered is not None)
        )

    async def _field(self, request: Request) -> tuple[GrammarField | None, int]:
        """The field for the grammar, None for none; and the requests that it took."""
        fields = [field for field in self._fields if request.grammar(field.constraint) is not None]
        if not fields or self._settings.constrain is Constrain.ALWAYS:
            return (fields[0] if fields else None), 0
        unsure = self._unsure
        async with self._lock():
            if self._unsure != unsure:  # tried in vain while this waited
                return None, 0
            probes = 0
            for field in fields:
                heeded = self._probed.heeded(self._place.url, self._model, field)
                if heeded is None:
                    probes += 1
                    heeded = await self._probe(field)
                if heeded is None:  # it cannot be reached: the request itself will tell why
                    self._unsure += 1
                    return None, probes
                if heeded:
                    return field, probes
        return None, probes

    async def _probe(self, field: GrammarField) -> bool | None:
        """True if the server heeds grammars, None if that cannot be told now."""
        ask = replace(
            self._ask(probe_request(), None), grammar_field=field, grammar=probe_grammar(field)
        )
        received = await self._send(ask, retries=0)
        if isinstance(received, Failure):
            if received.status not in _NOT_HEEDED:
                return None
            heeded = False
        else:
            reply = self._dialect.reply(received.data)
            if reply.text is None:
                return None
            heeded = expected(field, without_thoughts(reply.text))
        self._probed.learn(self._place.url, self._model, field, heeded=heeded)
        return heeded

    def _lock(self) -> asyncio.Lock:
        """One probe at a time, in whatever event loop this runs."""
        loop = asyncio.get_running_loop()
        if self._probing is None or self._probing[0] is not loop:
            self._probing = (loop, asyncio.Lock())
        return self._probing[1]

    # --- requests and errors ---------------------------------------------------------------------

    def _ask(self, request: Request, field: GrammarField | None) -> Ask:
        in_json = field is not None and field.constraint is Constraint.JSON_SCHEMA
        return Ask(
            model=self._model,
            request=_asking_for_json(request) if in_json else request,
            grammar_field=field,
            grammar="" if field is None else request.grammar(field.constraint) or "",
            thinking=self._settings.thinking,
            context_tokens=self._settings.context_tokens,
        )

    async def _send(self, ask: Ask, *, retries: int | None = None) -> Received | Failure:
        body = self._dialect.body(ask)
        return await self._transport.post(
            self._dialect.path, body, grammar=ask.grammar_field is not None, retries=retries
        )

    async def _explained(self, failure: Failure) -> Failure:
        """A failure; if the model is unknown, with the names of those that the server has."""
        if failure.status != 404 and not (failure.status == 400 and _NO_MODEL.search(failure.text)):
            return failure
        listed = self._dialect.models(await self._transport.get(self._dialect.models_path))
        names = [clip(self._place.key.hidden(name), 80) for name in listed[:10_000]]
        if not names or self._model in names:
            return failure
        import difflib

        near = difflib.get_close_matches(self._model[:80], names[:200], n=_LISTED, cutoff=0.5)
        shown = list(dict.fromkeys([*near, *sorted(names)]))
        more = f" and {len(shown) - _LISTED} more" if len(shown) > _LISTED else ""
        return replace(
            failure,
            text=f"there is no model '{clip(self._model, 80)}' at {self._place.url}; "
            f"it has {', '.join(shown[:_LISTED])}{more}",
        )

    def _error(self, failure: Failure) -> ModelError:
        text = _writable(self._place.key.hidden(failure.text))
        return ModelError(f"{self.name}: {text}", again=failure.again, empty=failure.empty)


def _asking_for_json(request: Request) -> Request:
    """A model that can write JSON only must not be asked for XML."""
    *before, last = request.messages
    text = f"{last.text.rstrip()}\n\n{find_template('json').filled({})}"
    return replace(request, messages=(*before, replace(last, text=text)))


def _unusable(reply: Reply, request: Request) -> Failure | None:
    """The failure that a reply stands for, None if it is one to use."""
    if reply.error:  # whatever text there is, it is not all
        return Failure(f"the server says: {clip(reply.error, 400)}", again=True)
    if reply.refusal:
        return Failure(f"the model refuses to answer: {clip(reply.refusal, 400)}")
    if reply.text is None:
        return Failure("the server's reply has no answer in it; is it the right provider?")
    return None if reply.text.strip() else _empty(reply, request)


def _empty(reply: Reply, request: Request) -> Failure:
    if reply.finish is Finish.LENGTH:
        return Failure(
            f"it used up its {request.max_tokens} tokens before it wrote an answer (it may have "
            "thought aloud); --max-tokens allows more"
        )
    return Failure("the answer is empty", again=True, empty=True)


def _writable(text: str) -> str:
    """A text without halves of characters, so that it can be written anywhere."""
    return text.encode("utf-8", "replace").decode("utf-8")
