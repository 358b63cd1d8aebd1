"""Nodes of trees → machine: those in which several children run, or one that others may halt.

What watches is a second use of a node: it runs beside the child that is watched, again and again,
and halts it (semantics, 10.2). A Parallel counts what its children end by with joins, and halts
those that still run when one of these is full:

    <Parallel success_count="1" failure_count="2"><A/><B/></Parallel>
    join of 1 of A SUCCEEDED, B SUCCEEDED; join of 2 of A FAILED, B FAILED; both stop A and B
"""

from __future__ import annotations

from collections.abc import Callable, Generator
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
from gpsfsm.compile.tree_ties import ports_question
from gpsfsm.compile.trees import number
from gpsfsm.model.precision import Cause
from gpsfsm.model.tree import Meaning, is_reference

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.compile.tree_machine import Compiler
    from gpsfsm.model.tree import TreeNode


def _reactive(c: Compiler, node: TreeNode, visit: Visit, *, sequence: bool) -> Steps:
    """The children before the one that runs are asked again and again.

    A child that may run itself can also be RUNNING again at any time, which halts the later one
    and begins anew from the front: a choice, since nobody knows when.
    """
    begin = c.port(visit.enter)
    going: Signals = (begin,)
    out: list[Signals] = []
    skipped = False
    anew_at_all = not all(map(c.is_pure, node.children[:-1]))
    parts: dict[int, tuple[int, int]] = {}
    for position, child in enumerate(node.children):
        first = len(c.parts)
        again = visit._replace(node=child, enter=going, again=True, beside=True)
        ends = yield again._replace(again=visit.again or anew_at_all)
        last = len(c.parts)
        parts[child] = first, last
        entered, going = going, joined(ends.success if sequence else ends.failure, ends.skipped)
        out.append(ends.failure if sequence else ends.success)
        skipped = skipped or bool(ends.skipped)
        earlier = [each for each in node.children[:position] if not c.is_constant(each)]
        if last == first or not earlier or c.is_pure(child):
            continue
        watching = len(c.parts)
        again = again._replace(enter=entered)
        uses = {each: parts[each] for each in earlier}
        halted = yield from _watchers(c, node, uses, again, sequence=sequence)
        out.append(halted)
        c.stop(halted, first, last)
        if not all(map(c.is_pure, earlier)):
            waits = c.port(entered)
            of = f"an earlier child of this {node.identity} runs again"
            anew = c.choice(node, of, (waits,), cause=Cause.ORDER)
            c.back(node, waits, anew.failure)
            c.stop(anew.success, first, len(c.parts))
            c.stop(halted, watching, len(c.parts))
            c.back(node, begin, anew.success)
        c.stop(ends.all, watching, len(c.parts))
    ended = joined(*out)
    nothing: Signals = ()
    if skipped:
        chosen = c.choice(node, f"all children of this {node.identity} are skipped", going)
        nothing, going = chosen.success, chosen.failure
    return Ends(going, ended, nothing) if sequence else Ends(ended, going, nothing)


def _watchers(
    c: Compiler,
    node: TreeNode,
    earlier: Mapping[int, tuple[int, int]],
    visit: Visit,
    *,
    sequence: bool,
) -> Generator[Visit, Ends, Signals]:
    """The earlier children, entered round and round; the events that halt the later one.

    ``earlier``: the parts of their first use. That may have left something running; it goes on in
    this use then.
    """
    port = c.port(visit.enter)
    entering: Signals = (port,)
    halting: list[Signals] = []
    for each, (first, last) in earlier.items():
        begin = len(c.parts)
        ends, as_before = yield from _watching(c, node, each, visit, entering)
        if not c.is_pure(each) and c.leaves_running(each):
            c.stop((4 * begin + 1,), first, last)  # the choice "as before" does not hold
        entering = joined(ends.success if sequence else ends.failure, ends.skipped, as_before)
        halting.append(ends.failure if sequence else ends.success)
    c.back(node, port, entering)
    return joined(*halting)


def _watching(
    c: Compiler, node: TreeNode, child: int, visit: Visit, enter: Signals
) -> Generator[Visit, Ends, tuple[Ends, Signals]]:
    """A child that is asked again, and the events by which it answers as before.

    A condition is asked anew. Anything else that nobody has reset since it ended gives its
    last answer again, or runs once more.
    """
    as_before: Signals = ()
    if not c.is_pure(child):
        chosen = c.choice(node, "an earlier child answers as before", enter, cause=Cause.HISTORY)
        as_before, enter = chosen.success, chosen.failure
    return (yield visit._replace(node=child, enter=enter)), as_before


def _reactive_sequence(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    return (yield from _reactive(c, node, visit, sequence=True))


def _reactive_fallback(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    return (yield from _reactive(c, node, visit, sequence=False))


def _while_do_else(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """The condition is asked again while the second or the third child runs."""
    again = visit._replace(again=True, beside=True)
    chosen = yield visit._replace(node=node.children[0])
    sides = [c.port(chosen.success), c.port(chosen.failure)]
    c.thrown += chosen.skipped  # "invalid status"
    ends: list[Ends] = []
    for side in range(2):
        enter = (sides[side],)
        if side + 1 >= len(node.children):
            ends.append(Ends(failure=enter))
            continue
        first = len(c.parts)
        done = yield again._replace(node=node.children[side + 1], enter=enter)
        last = len(c.parts)
        ends.append(done)
        if last == first or c.is_constant(node.children[0]):
            continue
        port = c.port(enter)
        watch, as_before = yield from _watching(c, node, node.children[0], again, (port,))
        same, other = (
            (watch.success, watch.failure)
            if side == 0
            else (
                watch.failure,
                watch.success,
            )
        )
        c.back(node, port, joined(same, as_before))
        c.stop(other, first, last)
        c.thrown += watch.skipped
        c.stop(done.all, last, len(c.parts))
        c.back(node, sides[1 - side], other)
    return all_of(ends)


def _switch(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """The child of the case that matches, else the last; a new value halts it."""
    begin = c.port(visit.enter)
    enter: Signals = (begin,)
    ends: list[Ends] = []
    variable = node.text("variable")
    for position, child in enumerate(node.children, start=1):
        if position < len(node.children):
            case = node.text(f"case_{position}")
            of = f"{variable} is {case}"
            chosen = c.choice(node, of, enter, ports_question(of, (variable, case), visit.scope))
            taken, enter = chosen.success, chosen.failure
        else:
            taken = enter
        first = len(c.parts)
        done = yield visit._replace(node=child, enter=taken, again=True, beside=True)
        ends.append(done)
        changed = c.watched(node, f"{variable} stays", taken, first, done)
        c.back(node, begin, changed)
    return all_of(ends)


def _check(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """BlackboardCheckInt and its like: asked again while the child runs."""
    of = f"{node.text('value_A')} is {node.text('value_B')}"
    mismatch = node.text("return_on_mismatch") or "FAILURE"
    again = visit.again or mismatch.strip().upper() == "RUNNING"
    begin = c.port(visit.enter)
    about = ports_question(of, (node.text("value_A"), node.text("value_B")), visit.scope)
    first = c.choice(node, of, (begin,), about)
    inner = len(c.parts)
    inside = visit._replace(enter=first.success, again=again, beside=True)
    ends = yield from c.child(node, inside)
    ended = c.watched(node, of, first.success, inner, ends, about=about)
    return all_of((ends, c.ends_of(node, mismatch, joined(first.failure, ended), begin)))


def _counts(node: TreeNode, visit: Visit) -> tuple[int | None, int | None, bool]:
    """The successes and the failures that end a Parallel; None for a number on the blackboard.

    And whether the successes are counted from the end, as by default: -2 is all but one.
    """
    size = len(node.children)
    counts: list[int | None] = []
    backwards: list[bool] = []
    for ports, default in (
        (("success_count", "success_threshold", "threshold"), -1),
        (("failure_count", "failure_threshold"), 1),
    ):
        port = next((each for each in ports if node.attribute(each)), "")
        count = number(node, port, visit.scope) if port else default
        if count is None and not is_reference(visit.scope.text(node.text(port))):
            raise BlockedError
        backwards.append(count is not None and count < 0)
        counts.append(size + count + 1 if count is not None and count < 0 else count)
    return counts[0], counts[1], backwards[0]


def _parallel(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """Parallel: a skipped child counts as a success where these are counted from the end.

    So ``success_count="2"`` of three children waits for a child that stays skipped, and "-2" does
    not.
    """
    size = len(node.children)
    need, fails, backwards = _counts(node, visit)
    if need is None or fails is None:
        return (yield from other(c, node, visit))
    if not (1 <= need <= size and 1 <= fails <= size):
        raise BlockedError
    fails = min(fails, size - need + 1)
    children = _started(c, node, need, fails)
    first = len(c.parts)
    sides, passed = yield from _entered_again(c, node, children, visit, counts=backwards)
    last = len(c.parts)
    successes = joined(*(side.success for side in sides), passed if backwards else ())
    failures = joined(*(side.failure for side in sides))
    ends = Ends()
    if successes:
        ends = Ends((c.join(node, successes, need, visit.enter),))
    if failures:
        ends = ends._replace(failure=(c.join(node, failures, fails, visit.enter),))
    if passed and not backwards:
        ends = ends._replace(skipped=(c.join(node, passed, size, visit.enter),))
    c.stop(ends.all, first, last)
    if passed and backwards:
        chosen = c.choice(node, "all children of this Parallel are skipped", ends.success)
        ends = ends._replace(success=chosen.failure, skipped=chosen.success)
    return ends


def _entered_again(
    c: Compiler, node: TreeNode, children: Sequence[int], visit: Visit, *, counts: bool
) -> Generator[Visit, Ends, tuple[list[Ends], Signals]]:
    """Children side by side, of which those that are skipped are entered again at every tick.

    The events by which a child stays skipped come along: whether it does, nobody knows. Where that
    ``counts``, the node decides then; else the child is ticked again.
    """
    ports = [c.port(visit.enter) for _ in children]
    sides: list[Ends] = []
    passed: list[Signals] = []
    for child, port in zip(children, ports, strict=True):
        ends = yield from _side(c, node, child, visit._replace(enter=(port,)))
        if ends.skipped:
            skipped = c.port(ends.skipped)
            chosen = c.choice(node, "a child that was skipped is entered", (skipped,))
            c.back(node, port, chosen.success)
            if not counts:
                c.back(node, skipped, chosen.failure)
            passed.append(chosen.failure)
        sides.append(ends)
    return sides, joined(*passed)


def _started(c: Compiler, node: TreeNode, need: int, fails: int) -> Sequence[int]:
    """The children that are started: those that end at once may end the Parallel before all are."""
    ended = [0, 0]
    for position, child in enumerate(node.children, start=1):
        constant = c.constant(child)
        if constant is not None:
            ended[constant] += 1
        if ended[True] >= need or ended[False] >= fails:
            return node.children[:position]
    return node.children


def _side(c: Compiler, node: TreeNode, child: int, visit: Visit) -> Steps:
    """A child of several. One that ends at once takes a moment, so that joins count it."""
    ends = yield visit._replace(node=child, beside=True)
    entered = set(c.meant(visit.enter))
    rows = (ends.success, ends.failure, ends.skipped)
    at_once = (bool(entered.intersection(c.meant(row))) for row in rows)
    return Ends(
        *(c.tick(node, row) if now else row for row, now in zip(rows, at_once, strict=True))
    )


def _parallel_all(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """It fails with so many failures, once all its children have ended."""
    size, port = len(node.children), "max_failures"
    count = number(node, port, visit.scope) if node.attribute(port) else 1
    if count is None:
        return (yield from other(c, node, visit))
    fails = size + count + 1 if count < 0 else count
    if not 1 <= fails <= size:
        raise BlockedError
    sides, skipped = yield from _entered_again(c, node, node.children, visit, counts=True)
    successes = joined(*(side.success for side in sides), skipped)
    failures = joined(*(side.failure for side in sides))
    everyone = c.join(node, joined(successes, failures), size, visit.enter)
    rows: list[Signals] = []
    for signals, need in ((successes, size - fails + 1), (failures, fails)):
        if signals:
            counted = c.join(node, signals, need, visit.enter)
            rows.append((c.join(node, (counted, everyone), 2, visit.enter),))
        else:
            rows.append(())
    if not (skipped and rows[0]):
        return Ends(rows[0], rows[1])
    chosen = c.choice(node, "all children of this ParallelAll are skipped", rows[0])
    return Ends(chosen.failure, rows[1], chosen.success)


def _pipeline(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """Nav2's PipelineSequence: the earlier children run again while a later one runs."""
    return (yield from _running_again(c, node, visit, together=False))


def _nonblocking(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """Nav2's NonblockingSequence: all run, and those that have succeeded run again."""
    return (yield from _running_again(c, node, visit, together=True))


def _running_again(c: Compiler, node: TreeNode, visit: Visit, *, together: bool) -> Steps:
    begin = len(c.parts)
    entering, going = visit.enter, visit.enter
    failed: list[Signals] = []
    done: list[Signals] = []
    for position, child in enumerate(node.children, start=1):
        enter = entering if together else going
        ends = yield visit._replace(node=child, enter=enter, beside=True)
        going = joined(ends.success, ends.skipped)
        if together and set(going) & set(entering):
            going = c.tick(node, going)
        done.append(going)
        failed.append(ends.failure)
        if position == len(node.children) and not together:
            continue
        if c.is_constant(child):
            continue
        port, first = c.port(going), len(c.parts)
        more = yield visit._replace(node=child, enter=(port,), again=True, rerun=True, beside=True)
        c.approximate(node, Cause.ORDER, first)
        c.back(node, port, joined(more.success, more.skipped))
        failed.append(more.failure)
    end = len(c.parts)
    success, failure = done[-1], joined(*failed)
    if together:  # all have to succeed in one tick, and some run again by then
        every = c.port((c.join(node, joined(*done), len(done), visit.enter),))
        chosen = c.choice(node, "all children succeed at once", (every,), cause=Cause.ORDER)
        c.back(node, every, chosen.failure)
        success = chosen.success
        end = len(c.parts)
    c.stop(joined(success, failure), begin, end)
    return Ends(success, failure)


def _timeout(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    begin = len(c.parts)
    ends = yield from c.child(node, visit._replace(beside=True))
    end = len(c.parts)
    if begin == end:
        return ends
    of = f"time is up ({node.text('msec')} ms)"
    clock = c.choice(node, of, visit.enter, cause=Cause.CLOCK)
    c.stop(clock.success, begin, end)
    c.stop(ends.all, end, len(c.parts))
    return all_of((ends, Ends(failure=clock.success)))


def other(c: Compiler, node: TreeNode, visit: Visit) -> Steps:
    """A node whose doing nobody knows: any child at any time, and any result."""
    begin = c.port(visit.enter)
    enter: Signals = (begin,)
    name = node.identity
    for position, child in enumerate(node.children, start=1):
        chosen = c.choice(node, f"{name} runs child {position}", enter, cause=Cause.UNKNOWN_NODE)
        ends = yield visit._replace(node=child, enter=chosen.success, again=True)
        c.back(node, begin, ends.all)
        enter = chosen.failure
    result = c.choice(node, f"{name} succeeds", enter, cause=Cause.UNKNOWN_NODE)
    return Ends(result.success, result.failure)


COMPILERS: dict[Meaning, Callable[[Compiler, TreeNode, Visit], Steps]] = {
    Meaning.REACTIVE_SEQUENCE: _reactive_sequence,
    Meaning.REACTIVE_FALLBACK: _reactive_fallback,
    Meaning.WHILE: _while_do_else,
    Meaning.SWITCH: _switch,
    Meaning.CHECK: _check,
    Meaning.PARALLEL: _parallel,
    Meaning.PARALLEL_ALL: _parallel_all,
    Meaning.PIPELINE: _pipeline,
    Meaning.NONBLOCKING: _nonblocking,
    Meaning.TIMEOUT: _timeout,
}
"""The compilers of these nodes, by their meaning."""
