"""The prompt buffer (semantics, section 8.3), by all orders of outcomes and effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .runs import SUCCEEDED
from .values import source

if TYPE_CHECKING:
    from .capabilities import Instance, Value, World
    from .runs import Run


@dataclass(frozen=True, slots=True)
class Prompting:
    """An instance that prompts: ``fixed_*`` tells whether nothing else may arrive under the name.

    ``uuid`` None: without a uuid, or with an empty one.
    """

    path: str
    fixed_uuid: bool
    uuid: str | None
    fixed_flush: bool
    flush: bool

    def may_have(self, uuid: str | None) -> bool:
        return uuid is not None and (not self.fixed_uuid or self.uuid == uuid)

    @property
    def fixed(self) -> bool:
        return self.fixed_uuid and self.fixed_flush


def prompting(world: World) -> list[Prompting]:
    """The instances that prompt, reachable or not."""
    actual = [_prompting(instance) for instance in world.instances]
    return [one for one in actual if one is not None]


def _prompting(instance: Instance) -> Prompting | None:
    if instance.described is None or instance.described.prompt is None:
        return None
    prompt = instance.described.prompt
    uuid = instance.works_with(prompt.uuid)
    return Prompting(
        path=instance.path,
        fixed_uuid=not instance.unknown(prompt.uuid),
        uuid=_text(uuid) or None,
        fixed_flush=not instance.unknown(prompt.flush),
        flush=_text(instance.works_with(prompt.flush)) == "true",
    )


def _text(value: Value | None) -> str:
    """A value as a text: as a plan would write it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)


def effects(run: Run, prompts: list[Prompting]) -> set[tuple[str, ...]]:
    """All orders in which the effects of the instances that prompt can take place in a run.

    A state is what has been delivered and the effects so far. An effect can take place while its
    instance is active, and its outcome is delivered after it. That outcomes come at one instant
    changes nothing here: the order of effects is the same if they come one after the other.
    """
    system = run.system
    node = {runner.path: runner for runner in system.graph.runners}
    # A flush counts once it is tried, whatever its outcome; a fill has to succeed.
    has_effect = {one.path for one in prompts if one.flush or run.scenario[one.path] == SUCCEEDED}
    results: set[tuple[str, ...]] = set()
    begin: tuple[frozenset[str], tuple[str, ...]] = (frozenset(), ())
    todo, seen = [begin], {begin}
    while todo:
        delivered, so_far = todo.pop()
        fired = run._after(delivered)
        active = [path for path in system.paths if node[path].trigger & fired]
        active = [path for path in active if path not in delivered]
        following = []
        for path in active:
            if path in has_effect and path not in so_far:
                following.append((delivered, (*so_far, path)))
            elif run.scenario[path] != "HANG":
                following.append((delivered | {path}, so_far))
        if not following:
            results.add(so_far)
        for state in following:
            if state not in seen:
                seen.add(state)
                todo.append(state)
    return results


def unflushed(world: World) -> set[str]:
    """The fills that, in some run that completes, no flush of their buffer is tried after."""
    prompts = prompting(world)
    partners = [
        (fill, {one.path for one in prompts if one.flush and one.may_have(fill.uuid)})
        for fill in prompts
        if fill.fixed
        and not fill.flush
        and not any(
            not other.fixed and (other.flush or not other.fixed_flush) and other.may_have(fill.uuid)
            for other in prompts
        )
    ]
    results = set()
    for run in world.runs if partners else ():
        for order in effects(run, prompts) if run.completed else ():
            for fill, flushes in partners:
                if fill.path in order:
                    after = order[order.index(fill.path) + 1 :]
                    if not flushes & set(after):
                        results.add(fill.path)
    return results


def empty_flush(world: World) -> set[str]:
    """The flushes that succeed in some run in which no fill of their buffer came before."""
    prompts = prompting(world)
    partners = [
        (flush, {one.path for one in prompts if not one.flush and one.may_have(flush.uuid)})
        for flush in prompts
        if flush.fixed
        and flush.flush
        and flush.uuid is not None
        and not any(
            not other.fixed
            and (not other.flush or not other.fixed_flush)
            and other.may_have(flush.uuid)
            for other in prompts
        )
    ]
    results = set()
    for run in world.runs if partners else ():
        for order in effects(run, prompts):
            for flush, fills in partners:
                succeeds = flush.path in order and run.scenario[flush.path] == SUCCEEDED
                if succeeds and not fills & set(order[: order.index(flush.path)]):
                    results.add(flush.path)
    return results


def empty_answer(world: World) -> set[tuple[str, str]]:
    """The instances that get the answer of a runner that only fills, and the name of the answer.

    Only those that know the name: what the others get is lost with them.
    """
    fills = {one.path for one in prompting(world) if one.fixed_flush and not one.flush}
    results = set()
    for instance in world.reachable:
        producer, event = source(world, instance) or (None, "")
        if producer is None or producer.described is None or producer.path not in fills:
            continue
        answer = producer.described.prompt.answer if producer.described.prompt else ""
        if instance.described is None or not instance.described.knows(answer):
            continue
        if any(one.name == answer and one.event == event for one in producer.described.outputs):
            results.add((instance.path, answer))
    return results
