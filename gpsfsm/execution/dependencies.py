"""What runners depend on: the order of loading, and the runners that are loaded in virtual time."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from gpsfsm.execution.outputs import said
from gpsfsm.execution.runner import Runner, RunnerError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Key = tuple[str, str]
"""Interface and provider."""

_MOST = 1_000  # runners that one may depend on, directly or not


class DependencyError(RunnerError):
    """A runner cannot be loaded because another one, which it depends on, cannot."""


def loading_order(key: Key, depends_on: Callable[[str, str], Sequence[Key]]) -> list[Key]:
    """A runner and what it depends on, which comes first. A circle is cut where it closes.

    Raises RunnerError if it depends on more than 1,000 runners.
    """
    order: dict[Key, None] = {}
    known = {key}
    pending = [(key, deque(depends_on(*key)))]
    while pending:
        current, rest = pending[-1]
        if not rest:
            order[current] = None
            pending.pop()
            continue
        wanted = rest.popleft()
        if wanted not in known:
            if len(known) > _MOST:
                raise RunnerError(f"it depends on more than {_MOST:,} runners")
            known.add(wanted)
            pending.append((wanted, deque(depends_on(*wanted))))
    return list(order)


class _Resident:
    __slots__ = ("key", "runner", "users")

    def __init__(self, key: tuple[Key, int], runner: Runner) -> None:
        self.key = key
        self.runner = runner
        self.users = 0


class Loaded:
    """The runners that are loaded, each once, with what they depend on.

    ``load`` makes and loads a runner and may raise anything, ``unload`` lets go of one and raises
    nothing but KeyboardInterrupt. Both are done at once.
    """

    def __init__(
        self,
        load: Callable[[Key], Runner],
        unload: Callable[[Runner], None],
        depends_on: Callable[[str, str], Sequence[Key]],
    ) -> None:
        self._load = load
        self._unload = unload
        self._depends_on = depends_on
        self._present: dict[tuple[Key, int], _Resident] = {}
        self._held: dict[tuple[Key, int], list[_Resident]] = {}

    def acquire(self, key: Key, copy: int = -1) -> Runner:
        """Load a runner after what it depends on; with ``copy`` one of several of the same key.

        Raises whatever goes wrong; then nothing of it stays loaded.
        """
        held = self._held[key, copy] = []
        try:
            for wanted in loading_order(key, self._depends_on):
                place = (wanted, copy if wanted == key else -1)
                found = self._present.get(place)
                if found is None:
                    found = _Resident(place, self._loaded(wanted, key))
                    self._present[place] = found
                found.users += 1
                held.append(found)
        except BaseException:
            self.release(key, copy)
            raise
        return held[-1].runner

    def _loaded(self, wanted: Key, key: Key) -> Runner:
        try:
            return self._load(wanted)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            if wanted == key:
                raise
            problem = str(error) if isinstance(error, RunnerError) else said(error)
            name = wanted[1] or wanted[0]
            raise DependencyError(f"{name}, which it depends on: {problem}") from None

    def release(self, key: Key, copy: int = -1) -> None:
        """Unload a runner and then what it depends on, as far as nobody else needs that."""
        for resident in reversed(self._held.pop((key, copy), [])):
            resident.users -= 1
            if not resident.users:
                del self._present[resident.key]
                self._unload(resident.runner)
