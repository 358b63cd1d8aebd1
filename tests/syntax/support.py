"""Helpers of the front end's tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.syntax import Parsed, parse

if TYPE_CHECKING:
    from gpsfsm.model.finding import Problem

GO = '<Runner interface="nav2/Go" provider="nav2/Go" x="1.5"/>'


def problems(text: str | bytes, **options: Any) -> list[Problem]:
    return list(parse(text, **options).problems)


def rules(text: str | bytes, **options: Any) -> list[str]:
    return [problem.rule for problem in problems(text, **options)]


def the_only(text: str | bytes, **options: Any) -> Problem:
    (problem,) = problems(text, **options)
    return problem


def underlined(parsed: Parsed, problem: Problem) -> str:
    """What the caret of a problem would point at."""
    lines = parsed.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    start = problem.location.column - 1
    return lines[problem.location.line - 1][start : start + problem.length]
