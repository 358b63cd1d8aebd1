"""``GET /v1/rules``: the catalogue of rules."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal

from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Problem

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core


class RuleLine(Answer):
    """A rule in one line."""

    code: str
    name: str
    severity: Literal["error", "warning", "info"]
    summary: str


class RulesAnswer(Answer):
    """All rules by code."""

    rules: list[RuleLine]


class RuleAnswer(RuleLine):
    """A rule with its reasons, a plan that has the finding and one that has not."""

    why: str
    fix: str
    bad: str
    good: str


@cache
def _all() -> bytes:
    from gpsfsm.analysis.rules import all_rules

    lines = [
        RuleLine(code=each.code, name=each.name, severity=each.severity.value, summary=each.summary)
        for each in all_rules()
    ]
    return RulesAnswer(rules=lines).model_dump_json().encode()


async def _rules(_core: Core, _request: Request) -> Response:
    from starlette.responses import Response

    return Response(_all(), media_type="application/json")


async def _rule(_core: Core, request: Request) -> Response:
    from starlette.responses import Response

    from gpsfsm.analysis.rules import rule
    from gpsfsm.errors import UsageError

    try:
        entry = rule(request.path_params["rule"])
    except UsageError:
        raise Problem(404, "there is no such rule; /v1/rules lists them") from None
    answer = RuleAnswer(
        code=entry.code,
        name=entry.name,
        severity=entry.severity.value,
        summary=entry.summary,
        why=entry.why,
        fix=entry.fix,
        bad=entry.bad,
        good=entry.good,
    )
    return Response(answer.model_dump_json(), media_type="application/json")


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/v1/rules",
        name="rules",
        summary="List all rules",
        answer=RulesAnswer,
        handle=_rules,
    ),
    Endpoint(
        method="GET",
        path="/v1/rules/{rule}",
        name="rule",
        summary="Explain a rule, by its code or name",
        answer=RuleAnswer,
        handle=_rule,
        also=((404, "There is no such rule."),),
    ),
)
