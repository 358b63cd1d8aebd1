"""Functions of Python that the user allows."""

from __future__ import annotations

import importlib
import inspect
import json
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.lane import in_thread
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.runners.generic.parameters import text
from gpsfsm.runners.generic.printed import Printed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["PythonRunner"]

_HANDED_OVER = ("text", "response_body", "stdout", "result")
_MAX_RESULT = 900_000  # characters


class PythonRunner(Runner):
    """Calls a function, in a thread of its own.

    The service ``allow_functions`` holds the functions that may be called, as ``module:name``. A
    function gets ``argument`` first, if it takes any, and by name what the step before hands over
    as text, response_body, stdout or result, as far as it takes these. What it prints are lines
    in the journal. A function cannot be stopped: when its instance is, it is left alone.
    """

    def __init__(self) -> None:
        self._functions: frozenset[str] = frozenset()

    async def start(self, context: LoadContext) -> None:
        """Get ready."""
        self._functions = frozenset(context.services.get("allow_functions", ()))

    async def run(
        self,
        parameters: Mapping[str, RunValue],
        context: RunContext,
    ) -> Mapping[str, RunValue]:
        """Call the function."""
        named = text(parameters, "function")
        if named not in self._functions:
            raise RunnerError(f"the function {named[:200]!r} is not allowed")
        printed = Printed(context.log)
        try:
            result = await in_thread(_call, named, dict(parameters), printed)
        finally:
            printed.close()
        if len(result) > _MAX_RESULT:
            raise RunnerError(f"{named} returns more than {_MAX_RESULT:,} characters")
        return {"result": result}


def _call(named: str, parameters: Mapping[str, RunValue], printed: Printed) -> str:
    """Import and call; what that raises is the failure, what it prints is kept."""
    with printed.taking():
        return _written(_called(named, parameters))


def _called(named: str, parameters: Mapping[str, RunValue]) -> Any:
    module, _, name = named.partition(":")
    try:
        function = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise RunnerError(f"there is no function {named}: {error}") from error
    if not callable(function) or inspect.iscoroutinefunction(function):
        raise RunnerError(f"{named} is no function that can simply be called")
    positional, by_name = _arguments(function, parameters)
    return function(*positional, **by_name)


def _arguments(
    function: Callable[..., Any], parameters: Mapping[str, RunValue]
) -> tuple[list[RunValue], dict[str, RunValue]]:
    """What a function takes of the parameters."""
    try:
        taken = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # some functions that are written in C do not say
        return [parameters.get("argument", "")], {}
    keyword_only = inspect.Parameter.KEYWORD_ONLY
    by_position = [
        found
        for found in taken
        if found.kind not in (keyword_only, inspect.Parameter.VAR_KEYWORD)
        and (found.name not in _HANDED_OVER or found.kind is inspect.Parameter.POSITIONAL_ONLY)
    ]
    everything = any(found.kind is inspect.Parameter.VAR_KEYWORD for found in taken)
    names = {found.name for found in taken}
    by_name = {
        name: parameters[name]
        for name in _HANDED_OVER
        if name in parameters and (everything or name in names)
    }
    return ([parameters.get("argument", "")] if by_position else []), by_name


def _written(result: object) -> str:
    """A result as text: a text as it is, nothing as the empty text, everything else as JSON."""
    if result is None:
        return ""
    if isinstance(result, str):
        return result
    try:
        return json.dumps(result, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError):
        return str(result)
