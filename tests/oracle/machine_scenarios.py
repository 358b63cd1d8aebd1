"""Machines whose scenarios are given one by one: those that a run has not contradicted yet.

Written from sections 4.1 and 9.2 of the semantics page: a scenario fixes the outcome of each
instance, and the options say which scenarios there are. A configuration carries the numbers of the
scenarios whose outcomes are those that have come, and nothing else is known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tests.oracle.machines import FAILED, HANG, SUCCEEDED, Configuration, Machine, Step

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import networkx as nx

    from tests.oracle.machines import Name


class ScenarioMachine(Machine):
    """A machine of which each instance has one visit at most, in these scenarios."""

    def __init__(
        self,
        graph: nx.MultiDiGraph[Any],
        scenarios: Sequence[Mapping[Name, str]],
        *,
        most: int = 20_000,
    ) -> None:
        kinds = graph.nodes(data="kind")
        names = [name for name, kind in kinds if kind == "runner"]
        super().__init__(graph, {name: {s[name] for s in scenarios} for name in names}, most=most)
        self.scenarios = scenarios

    def _left(self, before: Configuration, runner: int, event: str) -> tuple[Any, ...]:
        name = self.runners[runner]
        said: Any = before.said
        return (frozenset(n for n in said[0] if self.scenarios[n][name] == event),)

    def _played(self, before: Configuration, cause: tuple[int, str] | None) -> Step:
        step = super()._played(before, cause)
        every: Any = (frozenset(range(len(self.scenarios))),)
        said = every if cause is None else self._left(before, *cause)
        return Step(
            step.after._replace(said=said),
            step.runner,
            step.event,
            step.over,
            step.started,
            step.moved,
        )

    def instead(self, before: Configuration, runner: int, event: str) -> Configuration:
        """After the other outcome: all else comes as in a scenario with the real one."""
        other = FAILED if event == SUCCEEDED else SUCCEEDED
        after = self.step(before, runner, other).after
        return after._replace(said=self._left(before, runner, event))

    def possible(self, here: Configuration, runner: int) -> frozenset[str]:
        said: Any = here.said
        return frozenset(self.scenarios[n][self.runners[runner]] for n in said[0])

    def _steps(self, before: Configuration) -> Iterator[Step]:
        for step in super()._steps(before):
            if step.event is not None:
                yield step
            elif HANG in self.possible(before, step.runner):
                said = self._left(before, step.runner, HANG)
                yield Step(step.after._replace(said=said), step.runner, None)
