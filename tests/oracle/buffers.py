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
    """An instance that prompts: ``known_*`` tells whether nothing else may arrive under the name.

    ``uuid`` None: without a uuid, or with an empty one.
    """

    path: str
    known_uuid: bool
    uuid: str | None
    known_flush: bool
    flush: bool

    def may_have(self, uuid: str | None) -> bool:
        return uuid is not None and (not self.known_uuid or self.uuid == uuid)

    @property
    def known(self) -> bool:
        return self.known_uuid and self.known_flush


def prompting(world: World) -> list[Prompting]:
    """The instances that prompt, reachable or not."""
    found = [_prompting(instance) for instance in world.instances]
    return [one for one in found if one is not None]


def _prompting(instance: Instance) -> Prompting | None:
    if instance.known is None or instance.known.prompt is None:
        return None
    prompt = instance.known.prompt
    uuid = instance.works_with(prompt.uuid)
    return Prompting(
        path=instance.path,
        known_uuid=not instance.unknown(prompt.uuid),
        uuid=_text(uuid) or None,
        known_flush=not instance.unknown(prompt.flush),
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
    found: set[tuple[str, ...]] = set()
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
            found.add(so_far)
        for state in following:
            if state not in seen:
                seen.add(state)
                todo.append(state)
    return found


def unflushed(world: World) -> set[str]:
    """The fills that, in some run that completes, no flush of their buffer is tried after."""
    prompts = prompting(world)
    asked = [
        (fill, {one.path for one in prompts if one.flush and one.may_have(fill.uuid)})
        for fill in prompts
        if fill.known
        and not fill.flush
        and not any(
            not other.known and (other.flush or not other.known_flush) and other.may_have(fill.uuid)
            for other in prompts
        )
    ]
    found = set()
    for run in world.runs if asked else ():
        for order in effects(run, prompts) if run.completed else ():
            for fill, flushes in asked:
                if fill.path in order:
                    after = order[order.index(fill.path) + 1 :]
                    if not flushes & set(after):
                        found.add(fill.path)
    return found


def empty_flush(world: World) -> set[str]:
    """The flushes that succeed in some run in which no fill of their buffer came before."""
    prompts = prompting(world)
    asked = [
        (flush, {one.path for one in prompts if not one.flush and one.may_have(flush.uuid)})
        for flush in prompts
        if flush.known
        and flush.flush
        and flush.uuid is not None
        and not any(
            not other.known
            and (not other.flush or not other.known_flush)
            and other.may_have(flush.uuid)
            for other in prompts
        )
    ]
    found = set()
    for run in world.runs if asked else ():
        for order in effects(run, prompts):
            for flush, fills in asked:
                succeeds = flush.path in order and run.scenario[flush.path] == SUCCEEDED
                if succeeds and not fills & set(order[: order.index(flush.path)]):
                    found.add(flush.path)
    return found


def empty_answer(world: World) -> set[tuple[str, str]]:
    """The instances that get the answer of a runner that only fills, and the name of the answer.

    Only those that know the name: what the others get is lost with them.
    """
    fills = {one.path for one in prompting(world) if one.known_flush and not one.flush}
    found = set()
    for instance in world.reachable:
        producer, event = source(world, instance) or (None, "")
        if producer is None or producer.known is None or producer.path not in fills:
            continue
        answer = producer.known.prompt.answer if producer.known.prompt else ""
        if instance.known is None or not instance.known.knows(answer):
            continue
        if any(one.name == answer and one.event == event for one in producer.known.outputs):
            found.add((instance.path, answer))
    return found
