"""Nodes of trees → machine: rows, branches and loops, in which one child runs at a time.

Each takes the events that enter it and gives those that it ends by (semantics, 10.2). A row hands
on what its child ends by:

    <Fallback><A/><B/></Fallback>, entered by the start
    A entered by the start, B by A FAILED
    the whole succeeds by A SUCCEEDED and B SUCCEEDED, and fails by B FAILED
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from gpsfsm.compile.tree_parts import (
    BlockedError,
    Ends,
    Signals,
    Steps,
    Visit,
    all_of,
    joined,
)
from gpsfsm.compile.tree_ties import question
from gpsfsm.compile.trees import number
from gpsfsm.model.precision import Cause
from gpsfsm.model.tree import Meaning, is_reference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.compile.tree_machine import Compiler
    from gpsfsm.model.tree import TreeNode

MOST_ROUNDS = 8
"""Rounds of a bounded loop that are written out; more are counted by nobody."""


def _row(
    c: Compiler,
    children: Sequence[int],
    visit: Visit,
    *,
    sequence: bool = True,
    pauses: bool = False,
) -> Steps:
    """Children one after the other, as long as they succeed (in a Sequence) or fail.

    If all are skipped, so is the row. ``fresh`` are the events on which all have been so far.
    ``pauses``: behind a child that has ended in one tick, the row answers RUNNING.
    """
    fresh = visit.enter
    going: Signals = ()
    out: list[Signals] = []
    for child in children:
        after_fresh: Signals = ()
        after_going: list[Signals] = []
        for enter in (fresh, going):
            if not enter:
                continue
            ends = yield visit._replace(node=child, enter=enter)
            after_going.append(ends.success if sequence else ends.failure)
            out.append(ends.failure if sequence else ends.success)
            if pauses and child != children[-1]:
                after_going[-1] = c.pause(visit, child, after_going[-1])
            if enter is fresh:
                after_fresh = ends.skipped
            else:
                after_going.append(ends.skipped)
        fresh, going = after_fresh, joined(*after_going)
    ended = joined(*out)
    if sequence:
        return Ends(success=going, failure=ended, skipped=fresh)
    return Ends(success=ended, failure=going, skipped=fresh)


def _sequence(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    pauses = node.identity == "AsyncSequence"
    return (yield from _row(c, node.children, visit, pauses=pauses))


def _fallback(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    pauses = node.identity == "AsyncFallback"
    return (yield from _row(c, node.children, visit, sequence=False, pauses=pauses))


def _memory(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """A row that goes on where it has left off, if it has run before: nobody knows where."""
    sequence = node.identity != "FallbackStar"
    pauses = node.identity == "SequenceWithMemory"
    if not visit.again:
        row = _row(c, node.children, visit, sequence=sequence, pauses=pauses)
        return (yield from row)
    enter, entering = visit.enter, []
    for position in range(1, len(node.children)):
        chosen = c.choice(
            node, f"{node.identity} begins at child {position}", enter, cause=Cause.HISTORY
        )
        entering.append(chosen.success)
        enter = chosen.failure
    entering.append(enter)
    arriving: Signals = ()
    out: list[Signals] = []
    all_skipped = True
    for child, begins in zip(node.children, entering, strict=True):
        ends = yield visit._replace(node=child, enter=joined(arriving, begins))
        arriving = joined(ends.success if sequence else ends.failure, ends.skipped)
        if pauses and child != node.children[-1]:
            arriving = c.pause(visit, child, arriving)
        out.append(ends.failure if sequence else ends.success)
        all_skipped = all_skipped and bool(ends.skipped)
    ended = joined(*out)
    nothing: Signals = ()
    if all_skipped:
        chosen = c.choice(node, f"all children of this {node.identity} are skipped", arriving)
        nothing, arriving = chosen.success, chosen.failure
    return Ends(arriving, ended, nothing) if sequence else Ends(ended, arriving, nothing)


def _invert(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    ends = yield from c.child(node, visit)
    return Ends(ends.failure, ends.success, ends.skipped)


def _force_success(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    ends = yield from c.child(node, visit)
    return Ends(success=joined(ends.success, ends.failure), skipped=ends.skipped)


def _force_failure(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    ends = yield from c.child(node, visit)
    return Ends(failure=joined(ends.success, ends.failure), skipped=ends.skipped)


def _branch(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    ends: list[Ends] = []
    condition = visit._replace(node=node.children[0])
    if visit.again and len(node.children) == 2 and not c.is_pure(condition.node):
        # BehaviorTree.CPP does not reset an action that has failed as the condition of two.
        stale = c.choice(node, "the condition fails as before", visit.enter, cause=Cause.HISTORY)
        ends.append(Ends(failure=stale.success))
        condition = condition._replace(enter=stale.failure)
    chosen = yield condition
    c.thrown += chosen.skipped  # "invalid status"
    ends.append((yield visit._replace(node=node.children[1], enter=chosen.success)))
    if len(node.children) > 2:
        ends.append((yield visit._replace(node=node.children[2], enter=chosen.failure)))
    else:
        ends.append(Ends(failure=chosen.failure))
    return all_of(ends)


def _try_catch(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    tried = yield from _row(c, node.children[:-1], visit)
    begin = len(c.parts)
    caught = yield visit._replace(node=node.children[-1], enter=tried.failure)
    if node.text("catch_on_halt").strip().lower() in ("true", "1"):
        c.approximate(node, Cause.HISTORY, begin)
    return tried._replace(failure=caught.all)


def _rounds(c: Compiler, node: TreeNode, visit: Visit, *, port: str, retries: bool) -> Steps:
    """Retry and Repeat: written out if that is short, else a loop that nobody counts."""
    if not node.attribute(port):
        raise BlockedError
    rounds = number(node, port, visit.scope)
    if rounds is None and not is_reference(visit.scope.text(node.text(port))):
        raise BlockedError
    if rounds == 0:
        return Ends(failure=visit.enter) if retries else Ends(success=visit.enter)
    if rounds is not None and rounds > 0 and _short(c, node, rounds):
        return (yield from _unrolled(c, node, visit, rounds, retries=retries))
    begin = c.port(visit.enter)
    ends = yield from c.child(node, visit._replace(enter=(begin,), again=True))
    again, out = (ends.failure, ends.success) if retries else (ends.success, ends.failure)
    ended: Signals = ()
    if rounds is None or rounds > 0:
        more = c.choice(node, f"{node.identity}: another round", again, cause=Cause.ROUNDS)
        again, ended = more.success, more.failure
    c.back(node, begin, c.pause(visit, node.index, again))
    return Ends(out, ended, ends.skipped) if retries else Ends(ended, out, ends.skipped)


def _short(c: Compiler, node: TreeNode, rounds: int) -> bool:
    return rounds == 1 or (rounds <= MOST_ROUNDS and rounds * _size(c, node) <= c.written_out)


def _size(c: Compiler, node: TreeNode) -> int:
    """The nodes in a node, SubTrees as one each."""
    pending, size = list(node.children), 0
    while pending and size <= c.written_out:
        size += 1
        pending += c.forest.nodes[pending.pop()].children
    return size


def _unrolled(c: Compiler, node: TreeNode, visit: Visit, rounds: int, *, retries: bool) -> Steps:
    enter, out, skipped = visit.enter, [], []
    for turn in range(rounds):
        again = visit.again or turn > 0
        ends = yield from c.child(node, visit._replace(enter=enter, again=again))
        enter = ends.failure if retries else ends.success
        if turn < rounds - 1:
            enter = c.pause(visit, node.index, enter)
        out.append(ends.success if retries else ends.failure)
        skipped.append(ends.skipped)
    ended = joined(*out)
    row = Ends(ended, enter) if retries else Ends(enter, ended)
    return row._replace(skipped=joined(*skipped))


def _retry(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    return (yield from _rounds(c, node, visit, port="num_attempts", retries=True))


def _repeat(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    return (yield from _rounds(c, node, visit, port="num_cycles", retries=False))


def _keep_running(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    begin = c.port(visit.enter)
    ends = yield from c.child(node, visit._replace(enter=(begin,), again=True))
    again = joined(ends.success, ends.skipped)
    c.back(node, begin, c.pause(visit, node.index, again))
    return Ends(failure=ends.failure)


def _loop(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """LoopInt and its like: the child for each element of a queue, then what ``if_empty`` says."""
    begin = c.port(visit.enter)
    empty = c.choice(node, "the queue is empty", (begin,))
    ends = yield from c.child(node, visit._replace(enter=empty.failure, again=True))
    c.back(node, begin, c.pause(visit, node.index, joined(ends.success, ends.skipped)))
    status = node.text("if_empty") or "SUCCESS"
    out = c.ends_of(node, status, empty.success, begin)
    return all_of((Ends(failure=ends.failure), out))


def _recovery(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """Nav2's RecoveryNode: the second child after each failure of the first, so many times."""
    port, (first, second) = "number_of_retries", node.children
    retries = number(node, port, visit.scope) if node.attribute(port) else 1
    enter, out, failed = visit.enter, [], []
    if retries is not None and retries >= 0 and _short(c, node, retries + 1):
        for turn in range(retries + 1):
            again = visit.again or turn > 0
            tried = yield visit._replace(node=first, enter=enter, again=again)
            out.append(tried)
            enter = tried.failure
            if turn < retries:
                helped = yield visit._replace(node=second, enter=enter, again=again)
                failed += [helped.failure, helped.skipped]
                enter = helped.success
        failed.append(enter)
    else:
        begin = c.port(enter)
        tried = yield visit._replace(node=first, enter=(begin,), again=True)
        out.append(tried)
        more = c.choice(node, f"{node.identity}: another round", tried.failure, cause=Cause.ROUNDS)
        helped = yield visit._replace(node=second, enter=more.success, again=True)
        failed += [more.failure, helped.failure, helped.skipped]
        c.back(node, begin, helped.success)
    return Ends(
        joined(*(each.success for each in out)),
        joined(*failed),
        joined(*(each.skipped for each in out)),
    )


def _round_robin(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """Nav2's RoundRobin: it goes on behind the child that it has tried last.

    Since December 2025 it ends at its last child, whose success it returns as a failure, unless
    ``wrap_around`` is true (round_robin_node.cpp); before, there is no such port.
    """
    if not visit.again:
        row = yield from _row(c, node.children, visit, sequence=False)
        return _wrapped(c, node, row)
    enter, entering = visit.enter, []
    for position in range(1, len(node.children)):
        chosen = c.choice(
            node, f"RoundRobin begins at child {position}", enter, cause=Cause.HISTORY
        )
        entering.append(chosen.success)
        enter = chosen.failure
    entering.append(enter)
    wraps = c.port(())
    arriving: Signals = (wraps,)
    out: list[Signals] = []
    failed: list[Signals] = []
    for child, begins in zip(node.children, entering, strict=True):
        ends = yield visit._replace(node=child, enter=joined(arriving, begins))
        out.append(ends.success)
        every = joined(ends.failure, ends.skipped)
        chosen = c.choice(
            node, "all children of the RoundRobin have failed", every, cause=Cause.HISTORY
        )
        failed.append(chosen.success)
        arriving = chosen.failure
    c.back(node, wraps, arriving)
    return _wrapped(c, node, Ends(joined(*out), joined(*failed)))


def _wrapped(c: Compiler, node: TreeNode, ends: Ends) -> Ends:
    """The ends of a RoundRobin, of which a success may be a failure in some version."""
    if node.text("wrap_around").strip().lower() in ("true", "1") or not ends.success:
        return ends
    of = "the success of this RoundRobin counts"
    chosen = c.choice(node, of, ends.success, cause=Cause.VERSION)
    return ends._replace(success=chosen.success, failure=joined(ends.failure, chosen.failure))


def _delay(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    return (yield from c.child(node, visit._replace(enter=c.tick(node, visit.enter))))


def _maybe(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """Nav2's PathLongerOnApproach: it may also succeed while its child runs, without halting it."""
    chosen = c.choice(node, f"{node.identity} runs its child", visit.enter)
    begin = len(c.parts)
    ends = yield from c.child(node, visit._replace(enter=chosen.success, again=True, beside=True))
    end = len(c.parts)
    early: Signals = ()
    if end > begin:
        # It comes up until the child ends, so that it has no state of its own.
        port = c.port(chosen.success)
        longer = c.choice(node, "the path is no longer any more", (port,))
        c.back(node, port, longer.failure)
        early = longer.success
        c.stop(ends.all, end, len(c.parts))
    return all_of((ends, Ends(success=joined(chosen.failure, early))))


def _single_trigger(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    if visit.rerun:
        chosen = c.choice(node, "this SingleTrigger was reset", visit.enter, cause=Cause.HISTORY)
        ends = yield from c.child(node, visit._replace(enter=chosen.success, rerun=False))
        return all_of((ends, Ends(failure=chosen.failure)))
    return (yield from c.child(node, visit))


def _manual(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """A person chooses the child."""
    enter, ends = visit.enter, []
    for position, child in enumerate(node.children, start=1):
        if position < len(node.children):
            chosen = c.choice(node, f"child {position} is selected", enter)
            taken, enter = chosen.success, chosen.failure
        else:
            taken = enter
        ends.append((yield visit._replace(node=child, enter=taken)))
    return all_of(ends)


def _run_once(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    if not visit.again:
        return (yield from c.child(node, visit))
    chosen = c.choice(node, "this RunOnce has not run before", visit.enter, cause=Cause.HISTORY)
    ends = yield from c.child(node, visit._replace(enter=chosen.success))
    if (node.text("then_skip") or "true").strip().lower() in ("true", "1"):
        return all_of((ends, Ends(skipped=chosen.failure)))
    before = c.choice(node, "this RunOnce has succeeded", chosen.failure, cause=Cause.HISTORY)
    return all_of((ends, Ends(before.success, before.failure)))


def _precondition(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    begin = c.port(visit.enter)
    about = question(node.text("if"), visit.scope)
    enter = c.evaluated(node, "if", (begin,))
    chosen = c.choice(node, f"if: {node.text('if')}", enter, about)
    ends = yield from c.child(node, visit._replace(enter=chosen.success))
    otherwise = c.ends_of(node, node.text("else") or "FAILURE", chosen.failure, begin)
    return all_of((ends, otherwise))


def _entry(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """EntryUpdated and its like: the child, if somebody has written an entry."""
    begin = c.port(visit.enter)
    chosen = c.choice(node, f"{node.text('entry')} was written", (begin,))
    if not node.children:
        return chosen
    ends = yield from c.child(node, visit._replace(enter=chosen.success))
    status = {"SkipUnlessUpdated": "SKIPPED", "WaitValueUpdate": "RUNNING"}
    otherwise = status.get(node.identity, "FAILURE")
    return all_of((ends, c.ends_of(node, otherwise, chosen.failure, begin)))


def _only(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """The child: a gate, which only waits, or a node that changes values alone."""
    return (yield from c.child(node, visit))


COMPILERS: dict[Meaning, Callable[[Compiler, TreeNode, Visit], Steps]] = {
    Meaning.SEQUENCE: _sequence,
    Meaning.MEMORY: _memory,
    Meaning.FALLBACK: _fallback,
    Meaning.FALLBACK_MEMORY: _memory,
    Meaning.BRANCH: _branch,
    Meaning.INVERT: _invert,
    Meaning.FORCE_SUCCESS: _force_success,
    Meaning.FORCE_FAILURE: _force_failure,
    Meaning.RETRY: _retry,
    Meaning.REPEAT: _repeat,
    Meaning.KEEP_RUNNING: _keep_running,
    Meaning.DELAY: _delay,
    Meaning.RUN_ONCE: _run_once,
    Meaning.PRECONDITION: _precondition,
    Meaning.ENTRY: _entry,
    Meaning.LOOP: _loop,
    Meaning.MANUAL: _manual,
    Meaning.TRY_CATCH: _try_catch,
    Meaning.RECOVERY: _recovery,
    Meaning.ROUND_ROBIN: _round_robin,
    Meaning.MAYBE: _maybe,
    Meaning.SINGLE_TRIGGER: _single_trigger,
    Meaning.GATE: _only,
    Meaning.PASS: _only,
}
"""The compilers of these nodes, by their meaning."""
