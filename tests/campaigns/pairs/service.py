"""The service under schemathesis: requests drawn from its own OpenAPI document.

Each request is answered with a status and a body that the document tells of, never with an error of
the server. One service runs for all cases of a process, and it must be there until the end.
"""

from __future__ import annotations

import atexit
import importlib.util
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.service.support import Service

if TYPE_CHECKING:
    from collections.abc import Iterator

_NEEDED = ("schemathesis", "starlette", "uvicorn")
_LEFT_OUT = ("/v1/generate", "/v1/plans/{plan}/events", "/v1/queue/events")
"""A model is not asked; a stream of events ends when the plan does, or never."""

_EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"
_TASK = (_EXAMPLES / "rounds.yaml").read_text(encoding="utf-8").partition("not_answers:")[0]
"""A task that is sent names no files."""
_PLANS = [
    (_EXAMPLES / name).read_text(encoding="utf-8")
    for name in ("instant.xml", "patrol.xml", "shown.xml", "visit_once.xml")
]


def missing() -> str:
    """What is needed and not installed."""
    gone = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
    return f"{' and '.join(gone)} not installed" if gone else ""


@cache
def _service() -> Service:
    folder = tempfile.TemporaryDirectory()
    journal = Path(folder.name, "queue.db")
    words = ("--journal", journal, "--durability", "process", "--workers", "1")
    service = Service(*words).start()
    atexit.register(folder.cleanup)
    atexit.register(service.finish)
    return service


@cache
def _operations() -> list[Any]:
    import schemathesis

    schema = schemathesis.openapi.from_url(f"{_service().address}/openapi.json")
    actual = [each.ok() for each in schema.get_all_operations()]
    return [each for each in actual if each.path not in _LEFT_OUT]


@st.composite
def _sensible(draw: st.DrawFn, requests: st.SearchStrategy[Any]) -> Any:
    """Requests with texts and numbers that are likely to stand for something."""
    case = draw(requests)
    if isinstance(case.body, dict):
        examples = {"plan": _PLANS, "task": [_TASK]}
        for name, texts in examples.items():
            if isinstance(case.body.get(name), str) and draw(st.integers(0, 3)):
                case.body = {**case.body, name: draw(st.sampled_from(texts))}
        if draw(st.booleans()):  # what else is asked for mostly contradicts itself
            kept = (*examples, "speed")
            case.body = {name: said for name, said in case.body.items() if name in kept}
    numbers = {"plan": st.integers(1, 9), "rule": st.sampled_from(["GP302", "GP999"])}
    for name in case.path_parameters or {}:
        if name in numbers and draw(st.booleans()):
            case.path_parameters[name] = str(draw(numbers[name]))
    return case


def _cases() -> st.SearchStrategy[Any]:
    """Requests that obey the document, that make sense as well, and that do not obey it."""
    from schemathesis import GenerationMode

    obeying = [each.as_strategy(generation_mode=GenerationMode.POSITIVE) for each in _operations()]
    others = [each.as_strategy(generation_mode=GenerationMode.NEGATIVE) for each in _operations()]
    return st.one_of([*obeying, *map(_sensible, obeying), *others])


def judge(case: Any) -> Iterator[str]:
    """The answer is one that the document tells of."""
    if isinstance(case.body, dict) and "wait_s" in case.body:
        case.body = {**case.body, "wait_s": 0.0}  # up to a minute is allowed
    from schemathesis.checks import not_a_server_error
    from schemathesis.specs.openapi import checks

    response = case.call(timeout=60)
    if response.status_code not in (503, 504):  # too much at once is no defect
        # 501 is an answer: the service was started without what is asked for (--real here).
        defects = [] if response.status_code == 501 else [not_a_server_error]
        wanted = [
            *defects,
            checks.status_code_conformance,
            checks.content_type_conformance,
            checks.response_headers_conformance,
            checks.response_schema_conformance,
        ]
        try:
            case.validate_response(response, checks=wanted)
        except BaseExceptionGroup as failed:  # not an Exception: it would end the campaign
            raise AssertionError("\n".join(map(str, failed.exceptions))) from None
    yield f"{case.operation.method.upper()} {case.operation.path}: {response.status_code}"


PAIR = Pair(
    name="service",
    about="requests drawn from the service's OpenAPI document: answered as the document says",
    cases=_cases,
    judge=judge,
    text=lambda case: str(case.as_curl_command()),
    batch=50,
    missing=missing,
    few=2,
)
