"""Properties in Python: a user's function that looks at a run.

The function takes a ``Run`` and says what is wrong with it: nothing (None, True), a text, False, or
breaches. An AssertionError is a text too. Its module is imported because the user names it, and
only then.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.execution.outputs import said
from gpsfsm.fuzzing.properties.base import Breach, Property

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from types import ModuleType

    from gpsfsm.fuzzing.record import Run

__all__ = ["property_of", "property_of_function"]

_MOST = 20


def property_of(name: str) -> Property:
    """The property that ``module:function`` or ``file.py:function`` names. Raises UsageError.

    A function that is a ``Property`` already is taken as it is, under this name.
    """
    folder = str(Path.cwd())
    found = _loaded(name, folder)
    return replace(found, check=_Named(name, folder, found.check))


def _loaded(name: str, folder: str) -> Property:
    """The property; the path of a file begins at ``folder``."""
    module_name, _, function_name = name.rpartition(":")
    found = getattr(_module(module_name, folder), function_name, None)
    if isinstance(found, Property):
        return Property(name, found.holds, found.check, found.severity)
    if not callable(found):
        raise UsageError(f"--property {name}: there is no function '{function_name}' in it")
    return property_of_function(found, name)


class _Named:
    """The check of a property that has a name. Another process looks it up by that name."""

    def __init__(
        self, name: str, folder: str, check: Callable[[Run], Iterable[Breach]] | None = None
    ) -> None:
        self._name = name
        self._folder = folder
        self._check = check

    def __call__(self, run: Run) -> Iterable[Breach]:
        if self._check is None:
            self._check = _loaded(self._name, self._folder).check
        return self._check(run)

    def __reduce__(self) -> tuple[type[_Named], tuple[str, str]]:
        return _Named, (self._name, self._folder)


def property_of_function(function: Callable[[Run], object], name: str = "") -> Property:
    """A property made of a function.

    >>> from gpsfsm.fuzzing import play, subject_of
    >>> def quick(run):
    ...     assert run.at_s < 1, f"it takes {run.at_s:g} s"
    >>> subject = subject_of('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>')
    >>> run = play(subject, subject.plain)
    >>> [breach.message for breach in property_of_function(quick).check(run)]
    ['it takes 1 s']
    """
    told = getattr(function, "__name__", "function")
    first = (getattr(function, "__doc__", None) or told).strip().splitlines()[0]

    def check(run: Run) -> list[Breach]:
        try:
            answer = function(run)
        except AssertionError as error:
            answer = next(iter(str(error).splitlines()), "") or False
        except Exception as error:  # whatever a user's function does wrong
            raise UsageError(
                f"the property {name or told} cannot be checked: {said(error)}"
            ) from error
        return _breaches(answer, name or told)

    return Property(name or told, first, check)


def _breaches(answer: object, name: str) -> list[Breach]:
    if answer is None or answer is True:
        return []
    if answer is False:
        return [Breach(f"{name} does not hold")]
    if isinstance(answer, str):
        return [Breach(answer)]
    if isinstance(answer, Breach):
        return [answer]
    if isinstance(answer, list | tuple) and all(isinstance(one, Breach) for one in answer):
        return list(answer)[:_MOST]
    raise UsageError(
        f"the property {name} answers {type(answer).__name__}; it should answer None or True if it "
        "holds, else a text, False, or a list of gpsfsm.fuzzing.Breach"
    )


def _module(name: str, folder: str) -> ModuleType:
    try:
        if name.endswith(".py"):
            return _of_file(Path(folder, name))
        return importlib.import_module(name)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module may also want to exit
        raise UsageError(
            f"--property: {name or 'the module'} cannot be imported: {said(error)}"
        ) from error


def _of_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise UsageError("there is no such file")
    spec = importlib.util.spec_from_file_location(f"gpsfsm_property_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise UsageError("it is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module
