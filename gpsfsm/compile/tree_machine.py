"""Behaviour trees → machine: those with loops, reactive nodes, clocks or values (semantics, 10).

A node is entered by events, and ends by events: those by which it succeeds, fails or is skipped. So a
tree is compiled from the outside in, each node between the events that enter it and those that it
ends by; a Sequence hands the successes of a child on as what enters the next one.

    <ReactiveSequence><Clear/><Drive/></ReactiveSequence>
    Clear, entered by the start       succeeds: Clear SUCCEEDED      fails: Clear FAILED
    Drive, entered by Clear SUCCEEDED
    Clear@2, a second use that watches: entered by Clear SUCCEEDED and, again and again, by its own
        SUCCEEDED. Its FAILED stops Drive; what Drive ends by stops Clear@2.
    The whole succeeds by Drive SUCCEEDED, and fails by FAILED of any of the three.

*Loops*: what a loop goes back by enters its body once more. The events that enter it are not all
known when the body is compiled, so they have a number of their own (a *port*), which is replaced
at the end. A loop passes through an outcome: where nothing in the body has one, a tick stands in.

*What is not known* (a value, a clock, how often a bounded loop has gone round) is a choice
(``model/choice.py``): the machine has all runs that the tree has, and perhaps more. So what it never
does the tree never does. ``TreeMachine.approximated`` are the nodes of which that is true.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.compile.trees import EMPTY_SCOPE, Scope, leaf_attributes, number, scope_of
from gpsfsm.compile.units import TreeMachine
from gpsfsm.model.automaton import Edge, Node, NodeKind
from gpsfsm.model.choice import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.plan import Attribute, Element, Kind, Location
from gpsfsm.model.tree import BUILTINS, NAV2, Builtin, Meaning, is_reference

if TYPE_CHECKING:
    from gpsfsm.model.tree import Forest, TreeNode

MAX_RUNNERS = 4_000
"""Uses of leaves, choices and ticks in one machine."""

MOST_ROUNDS = 8
"""Rounds of a bounded loop that are written out; more are counted by nobody."""

WRITTEN_OUT = 300
"""Uses up to which bounded loops are written out; a tree with more is compiled without that."""

Signals = tuple[int, ...]
"""Events: that of a node is ``4 * node + event``; -1, -2, … are ports."""

_EVENTS = (Event.SUCCEEDED, Event.FAILED)
_CONDITIONS = ("_failureIf", "_successIf", "_skipIf")
_WHILE = "_while"
_PLAIN = {
    Meaning.SEQUENCE,
    Meaning.MEMORY,
    Meaning.REACTIVE_SEQUENCE,
    Meaning.FALLBACK,
    Meaning.FALLBACK_MEMORY,
    Meaning.REACTIVE_FALLBACK,
    Meaning.BRANCH,
    Meaning.INVERT,
    Meaning.FORCE_SUCCESS,
    Meaning.FORCE_FAILURE,
    Meaning.PARALLEL,
    Meaning.PARALLEL_ALL,
    Meaning.PASS,
}
"""Nodes that never run if none of their children does."""


class Ends(NamedTuple):
    """The events that a node ends by."""

    success: Signals = ()
    failure: Signals = ()
    skipped: Signals = ()

    @property
    def all(self) -> Signals:
        """All of them."""
        return joined(self.success, self.failure, self.skipped)


class _Visit(NamedTuple):
    """A node that is to be compiled, and where.

    ``enter``: the events that enter it. ``again``: it may be entered several times in a run, or has
    run before. ``rerun``: nothing has reset it since it ended.
    """

    node: int
    enter: Signals
    scope: Scope
    again: bool = False
    rerun: bool = False


_Steps = Generator[_Visit, Ends, Ends]


class TooLargeError(Exception):
    """A machine with more than ``MAX_RUNNERS`` runners."""


@dataclass(slots=True)
class _Part:
    """A node of the machine, before all are numbered."""

    kind: NodeKind
    node: TreeNode
    attributes: tuple[Attribute, ...] = ()
    need: int = 0


def machine_of_tree(forest: Forest) -> TreeMachine | None:
    """The machine of the main tree; None where it cannot be made.

    That is so for a tree of which the front end has reported what is wrong, and for one that is too
    large even without loops that are written out. Time and space: linear in the size of the result.
    """
    for written_out in (WRITTEN_OUT, 0):
        try:
            return _Compiler(forest, written_out).machine()
        except TooLargeError:
            continue
        except _BlockedError:
            return None
    return None


class _BlockedError(Exception):
    """Something is wrong with the tree that has been reported."""


def joined(*rows: Signals) -> Signals:
    """All events of some rows, each once, in order."""
    return tuple(dict.fromkeys(signal for row in rows for signal in row))


@dataclass(slots=True)
class _Compiler:
    forest: Forest
    written_out: int
    parts: list[_Part] = field(default_factory=list)
    edges: list[tuple[Signals, int]] = field(default_factory=list)
    stops: list[tuple[Signals, int]] = field(default_factory=list)
    ports: list[Signals] = field(default_factory=list)
    uses: dict[int, int] = field(default_factory=dict)
    approximated: dict[int, TreeNode] = field(default_factory=dict)
    pure: dict[int, bool] = field(default_factory=dict)
    runners: int = 0

    def machine(self) -> TreeMachine:
        top = self.forest.nodes[self.forest.main]
        self.parts.append(_Part(NodeKind.START, top))
        ends = self._compile(_Visit(self._only_child(top), (0,), EMPTY_SCOPE))
        return self._numbered(top, ends)

    def _only_child(self, node: TreeNode) -> int:
        if len(node.children) != 1:
            raise _BlockedError
        return node.children[0]

    def _compile(self, visit: _Visit) -> Ends:
        """A node and all in it. A stack and no recursion: trees may be nested deeply."""
        stack: list[_Steps] = [self._visit(visit)]
        ends: Ends | None = None
        while stack:
            try:
                request = next(stack[-1]) if ends is None else stack[-1].send(ends)
            except StopIteration as stop:
                stack.pop()
                ends = stop.value
                continue
            if len(stack) > 3_000:
                raise TooLargeError
            ends = None
            stack.append(self._visit(request))
        assert ends is not None
        return ends

    # -- parts -------------------------------------------------------------------------------

    def _runner(self, node: TreeNode, attributes: tuple[Attribute, ...], enter: Signals) -> Ends:
        self.runners += 1
        if self.runners > MAX_RUNNERS or (self.written_out and self.runners > MAX_RUNNERS // 4):
            raise TooLargeError
        index = len(self.parts)
        self.parts.append(_Part(NodeKind.RUNNER, node, attributes))
        self.edges.append((enter, index))
        return Ends((4 * index,), (4 * index + 1,))

    def _choice(self, node: TreeNode, of: str, enter: Signals) -> Ends:
        """Nobody knows: it holds (success) or it does not (failure)."""
        self.approximated.setdefault(node.index, node)
        return self._own(node, CHOICE, enter, of)

    def _tick(self, node: TreeNode, enter: Signals) -> Signals:
        """A moment later."""
        return self._own(node, TICK, enter).success

    def _own(self, node: TreeNode, interface: str, enter: Signals, of: str = "") -> Ends:
        texts = {"interface": interface, "provider": interface, "of": of}
        attributes = tuple(
            Attribute(name, text, text, node.line, node.column)
            for name, text in texts.items()
            if text
        )
        return self._runner(node, attributes, enter)

    def _join(self, node: TreeNode, inputs: Signals, need: int, enter: Signals) -> int:
        """A join, which forgets all whenever the node is entered; its event."""
        index = len(self.parts)
        self.parts.append(_Part(NodeKind.JOIN, node, need=need))
        self.edges.append((inputs, index))
        self.stops.append((enter, index))
        return 4 * index

    def _port(self, enter: Signals) -> int:
        """A port that is entered by these events, and perhaps by more."""
        self.ports.append(enter)
        return -len(self.ports)

    def _back(self, node: TreeNode, port: int, signals: Signals) -> None:
        """A port is entered by these, too. What is no outcome takes a moment: a loop must."""
        outcomes = tuple(each for each in signals if self._is_outcome(each))
        others = tuple(each for each in signals if not self._is_outcome(each))
        if others:
            outcomes = (*outcomes, *self._tick(node, others))
        self.ports[-port - 1] = joined(self.ports[-port - 1], outcomes)

    def _is_outcome(self, signal: int) -> bool:
        return signal >= 0 and self.parts[signal // 4].kind is NodeKind.RUNNER

    def _stop(self, signals: Signals, begin: int, end: int) -> None:
        """These events halt all that was compiled from one part to another."""
        if signals:
            self.stops += (
                (signals, index)
                for index in range(begin, end)
                if self.parts[index].kind is NodeKind.RUNNER
            )

    # -- nodes -------------------------------------------------------------------------------

    def _visit(self, visit: _Visit) -> _Steps:
        node = self.forest.nodes[visit.node]
        return self._guarded(node, visit)

    def _guarded(self, node: TreeNode, visit: _Visit) -> _Steps:
        """A node behind its conditions: those at its beginning, and _while, which is asked again."""
        early: list[Ends] = []
        enter = visit.enter
        for name in _CONDITIONS:
            if node.attribute(name):
                asked = self._choice(node, f"{name}: {node.text(name)}", enter)
                enter = asked.failure
                early.append(_ends_at(name, asked.success))
        if not node.attribute(_WHILE):
            ends = yield from self._node(node, visit._replace(enter=enter))
            return _all_of((*early, ends))
        of = f"{_WHILE}: {node.text(_WHILE)}"
        first = self._choice(node, of, enter)
        begin = len(self.parts)
        ends = yield from self._node(node, visit._replace(enter=first.success))
        ended = self._watched(node, of, first.success, begin, ends)
        return _all_of((*early, ends, Ends(skipped=joined(first.failure, ended))))

    def _watched(
        self, node: TreeNode, of: str, enter: Signals, begin: int, ends: Ends
    ) -> Signals:
        """What halts the parts from ``begin`` on: a choice that is made until they have ended."""
        end = len(self.parts)
        if end == begin:
            return ()
        port = self._port(enter)
        watch = self._choice(node, of, (port,))
        self._back(node, port, watch.success)
        self._stop(watch.failure, begin, end)
        self._stop(ends.all, end, len(self.parts))
        return watch.failure

    def _node(self, node: TreeNode, visit: _Visit) -> _Steps:
        name = node.identity
        builtin = self._builtin(node, name)
        if not name:
            raise _BlockedError
        if builtin is not None:
            yield from ()
            return (yield from self._known(node, builtin, visit))
        tree = self._tree_of(node, name)
        if tree >= 0:
            return (yield from self._subtree(node, tree, visit))
        if node.children:
            return (yield from self._other(node, visit))
        return self._leaf(node, visit)

    def _builtin(self, node: TreeNode, name: str) -> Builtin | None:
        if name in BUILTINS:
            return BUILTINS[name]
        count = len(node.children)
        own = NAV2.get(name)
        fits = own is not None and own.least <= count and (own.most < 0 or count <= own.most)
        return own if fits else None

    def _tree_of(self, node: TreeNode, name: str) -> int:
        compact = not node.explicit and name not in (self.forest.models or ())
        return self.forest.trees.get(name, -1) if compact else -1

    def _known(self, node: TreeNode, builtin: Builtin, visit: _Visit) -> _Steps:
        meaning, count = builtin.meaning, len(node.children)
        if count < builtin.least or (builtin.most >= 0 and count > builtin.most):
            raise _BlockedError
        if meaning is Meaning.LEAF:
            return self._leaf(node, visit)
        if meaning is Meaning.SUCCEED:
            return Ends(success=visit.enter)
        if meaning is Meaning.FAIL:
            return Ends(failure=visit.enter)
        if meaning is Meaning.SUBTREE:
            tree = self.forest.trees.get(node.text("ID"), -1)
            if tree < 0:
                raise _BlockedError
            return (yield from self._subtree(node, tree, visit))
        return (yield from _COMPILERS[meaning](self, node, visit))

    def _leaf(self, node: TreeNode, visit: _Visit) -> Ends:
        self.uses[node.index] = self.uses.get(node.index, 0) + 1
        attributes = leaf_attributes(node, visit.scope, self.uses[node.index])
        return self._runner(node, attributes, visit.enter)

    def _subtree(self, node: TreeNode, tree: int, visit: _Visit) -> _Steps:
        scope = scope_of(node, visit.scope, self.forest.version)
        top = self.forest.nodes[tree]
        return (yield visit._replace(node=self._only_child(top), scope=scope))

    def _child(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield visit._replace(node=self._only_child(node)))

    # -- controls ----------------------------------------------------------------------------

    def _row(
        self, children: Sequence[int], visit: _Visit, *, sequence: bool = True
    ) -> _Steps:
        """Children one after the other, as long as they succeed (in a Sequence) or fail.

        If all are skipped, so is the row. ``fresh`` are the events on which all have been so far.
        """
        fresh, going = visit.enter, ()
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
                if enter is fresh:
                    after_fresh = ends.skipped
                else:
                    after_going.append(ends.skipped)
            fresh, going = after_fresh, joined(*after_going)
        ended = joined(*out)
        if sequence:
            return Ends(success=going, failure=ended, skipped=fresh)
        return Ends(success=ended, failure=going, skipped=fresh)

    def _sequence(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._row(node.children, visit))

    def _fallback(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._row(node.children, visit, sequence=False))

    def _memory(self, node: TreeNode, visit: _Visit) -> _Steps:
        """A row that goes on where it has left off, if it has run before: nobody knows where."""
        sequence = BUILTINS.get(node.identity, NAV2.get(node.identity)).meaning is Meaning.MEMORY  # type: ignore[union-attr]
        if not visit.again:
            return (yield from self._row(node.children, visit, sequence=sequence))
        enter, entering = visit.enter, []
        for position in range(1, len(node.children)):
            asked = self._choice(node, f"{node.identity} begins at child {position}", enter)
            entering.append(asked.success)
            enter = asked.failure
        entering.append(enter)
        arriving: Signals = ()
        out: list[Signals] = []
        for child, begins in zip(node.children, entering, strict=True):
            ends = yield visit._replace(node=child, enter=joined(arriving, begins))
            arriving = joined(ends.success if sequence else ends.failure, ends.skipped)
            out.append(ends.failure if sequence else ends.success)
        ended = joined(*out)
        return Ends(arriving, ended) if sequence else Ends(ended, arriving)

    def _invert(self, node: TreeNode, visit: _Visit) -> _Steps:
        ends = yield from self._child(node, visit)
        return Ends(ends.failure, ends.success, ends.skipped)

    def _force_success(self, node: TreeNode, visit: _Visit) -> _Steps:
        ends = yield from self._child(node, visit)
        return Ends(success=joined(ends.success, ends.failure), skipped=ends.skipped)

    def _force_failure(self, node: TreeNode, visit: _Visit) -> _Steps:
        ends = yield from self._child(node, visit)
        return Ends(failure=joined(ends.success, ends.failure), skipped=ends.skipped)

    def _branch(self, node: TreeNode, visit: _Visit) -> _Steps:
        asked = yield visit._replace(node=node.children[0])
        ends = [Ends(skipped=asked.skipped)]
        ends.append((yield visit._replace(node=node.children[1], enter=asked.success)))
        if len(node.children) > 2:
            ends.append((yield visit._replace(node=node.children[2], enter=asked.failure)))
        else:
            ends.append(Ends(failure=asked.failure))
        return _all_of(ends)

    def _try_catch(self, node: TreeNode, visit: _Visit) -> _Steps:
        tried = yield from self._row(node.children[:-1], visit)
        caught = yield visit._replace(node=node.children[-1], enter=tried.failure)
        if node.text("catch_on_halt").strip().lower() in ("true", "1"):
            self.approximated.setdefault(node.index, node)
        return tried._replace(failure=caught.all)

    # -- loops -------------------------------------------------------------------------------

    def _rounds(self, node: TreeNode, visit: _Visit, *, port: str, retries: bool) -> _Steps:
        """Retry and Repeat: written out if that is short, else a loop that nobody counts."""
        if not node.attribute(port):
            raise _BlockedError
        rounds = number(node, port, visit.scope)
        if rounds is None and not is_reference(visit.scope.text(node.text(port))):
            raise _BlockedError
        if rounds == 0:
            return Ends(failure=visit.enter) if retries else Ends(success=visit.enter)
        if rounds is not None and 0 < rounds and self._short(node, rounds):
            return (yield from self._unrolled(node, visit, rounds, retries=retries))
        begin = self._port(visit.enter)
        ends = yield from self._child(node, visit._replace(enter=(begin,), again=True))
        again, out = (ends.failure, ends.success) if retries else (ends.success, ends.failure)
        ended: Signals = ()
        if rounds is None or rounds > 0:
            more = self._choice(node, f"{node.identity}: another round", again)
            again, ended = more.success, more.failure
        self._back(node, begin, again)
        return Ends(out, ended, ends.skipped) if retries else Ends(ended, out, ends.skipped)

    def _short(self, node: TreeNode, rounds: int) -> bool:
        return self.written_out > 0 and (
            rounds <= MOST_ROUNDS and rounds * self._size(node) <= self.written_out
        )

    def _size(self, node: TreeNode) -> int:
        """The nodes in a node, SubTrees as one each."""
        pending, size = list(node.children), 0
        while pending and size <= self.written_out:
            size += 1
            pending += self.forest.nodes[pending.pop()].children
        return size

    def _unrolled(self, node: TreeNode, visit: _Visit, rounds: int, *, retries: bool) -> _Steps:
        enter, out, skipped = visit.enter, [], []
        for turn in range(rounds):
            again = visit.again or turn > 0
            ends = yield from self._child(node, visit._replace(enter=enter, again=again))
            enter = ends.failure if retries else ends.success
            out.append(ends.success if retries else ends.failure)
            skipped.append(ends.skipped)
        ended = joined(*out)
        row = Ends(ended, enter) if retries else Ends(enter, ended)
        return row._replace(skipped=joined(*skipped))

    def _retry(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._rounds(node, visit, port="num_attempts", retries=True))

    def _repeat(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._rounds(node, visit, port="num_cycles", retries=False))

    def _keep_running(self, node: TreeNode, visit: _Visit) -> _Steps:
        begin = self._port(visit.enter)
        ends = yield from self._child(node, visit._replace(enter=(begin,), again=True))
        self._back(node, begin, ends.success)
        return Ends(failure=ends.failure, skipped=ends.skipped)

    def _loop(self, node: TreeNode, visit: _Visit) -> _Steps:
        """LoopInt and its like: the child for each element of a queue."""
        empty = self._choice(node, "the queue is empty", visit.enter)
        begin = self._port(empty.failure)
        ends = yield from self._child(node, visit._replace(enter=(begin,), again=True))
        more = self._choice(node, "the queue has more", joined(ends.success, ends.skipped))
        self._back(node, begin, more.success)
        if_empty = _ends_of(node.text("if_empty") or "SUCCESS", empty.success)
        return _all_of((Ends(success=more.failure, failure=ends.failure), if_empty))

    def _recovery(self, node: TreeNode, visit: _Visit) -> _Steps:
        """Nav2's RecoveryNode: the second child after each failure of the first, so many times."""
        port, (first, second) = "number_of_retries", node.children
        retries = number(node, port, visit.scope) if node.attribute(port) else 1
        enter, out, failed = visit.enter, [], []
        if retries is not None and 0 <= retries and self._short(node, retries + 1):
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
            begin = self._port(enter)
            tried = yield visit._replace(node=first, enter=(begin,), again=True)
            out.append(tried)
            more = self._choice(node, f"{node.identity}: another round", tried.failure)
            helped = yield visit._replace(node=second, enter=more.success, again=True)
            failed += [more.failure, helped.failure, helped.skipped]
            self._back(node, begin, helped.success)
        return Ends(
            joined(*(each.success for each in out)),
            joined(*failed),
            joined(*(each.skipped for each in out)),
        )

    def _round_robin(self, node: TreeNode, visit: _Visit) -> _Steps:
        """Nav2's RoundRobin: it goes on behind the child that it has tried last."""
        if not visit.again:
            return (yield from self._row(node.children, visit, sequence=False))
        enter, entering = visit.enter, []
        for position in range(1, len(node.children)):
            asked = self._choice(node, f"RoundRobin begins at child {position}", enter)
            entering.append(asked.success)
            enter = asked.failure
        entering.append(enter)
        wraps = self._port(())
        arriving: Signals = (wraps,)
        out: list[Signals] = []
        failed: list[Signals] = []
        for child, begins in zip(node.children, entering, strict=True):
            ends = yield visit._replace(node=child, enter=joined(arriving, begins))
            out.append(ends.success)
            every = joined(ends.failure, ends.skipped)
            asked = self._choice(node, "all children of the RoundRobin have failed", every)
            failed.append(asked.success)
            arriving = asked.failure
        self._back(node, wraps, arriving)
        return Ends(joined(*out), joined(*failed))

    # -- reactive nodes ----------------------------------------------------------------------

    def _reactive(self, node: TreeNode, visit: _Visit, *, sequence: bool) -> _Steps:
        """The children before the one that runs are asked again and again.

        A child that may run itself can also be RUNNING again at any time, which halts the later one
        and begins anew from the front: a choice, since nobody knows when.
        """
        begin = self._port(visit.enter)
        going: Signals = (begin,)
        out: list[Signals] = []
        skipped = False
        for position, child in enumerate(node.children):
            first = len(self.parts)
            again = visit._replace(node=child, enter=going, again=True)
            ends = yield (again if position or visit.again else again._replace(again=visit.again))
            last = len(self.parts)
            entered, going = going, joined(ends.success if sequence else ends.failure, ends.skipped)
            out.append(ends.failure if sequence else ends.success)
            skipped = skipped or bool(ends.skipped)
            earlier = [each for each in node.children[:position] if not self._is_constant(each)]
            if last == first or not earlier or self._is_pure(child):
                continue
            watching = len(self.parts)
            port = self._port(entered)
            asking: Signals = (port,)
            halting: list[Signals] = []
            for each in earlier:
                answers = yield again._replace(node=each, enter=asking)
                asking = joined(
                    answers.success if sequence else answers.failure, answers.skipped
                )
                halting.append(answers.failure if sequence else answers.success)
            self._back(node, port, asking)
            halted = joined(*halting)
            out.append(halted)
            self._stop(halted, first, last)
            if not all(map(self._is_pure, earlier)):
                waits = self._port(entered)
                of = f"an earlier child of this {node.identity} runs again"
                anew = self._choice(node, of, (waits,))
                self._back(node, waits, anew.failure)
                self._stop(anew.success, first, len(self.parts))
                self._stop(halted, watching, len(self.parts))
                self._back(node, begin, anew.success)
            self._stop(ends.all, watching, len(self.parts))
        ended = joined(*out)
        nothing: Signals = ()
        if skipped:
            asked = self._choice(node, f"all children of this {node.identity} are skipped", going)
            nothing, going = asked.success, asked.failure
        return Ends(going, ended, nothing) if sequence else Ends(ended, going, nothing)

    def _reactive_sequence(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._reactive(node, visit, sequence=True))

    def _reactive_fallback(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._reactive(node, visit, sequence=False))

    def _while_do_else(self, node: TreeNode, visit: _Visit) -> _Steps:
        """The condition is asked again while the second or the third child runs."""
        again = visit._replace(again=True)
        asked = yield visit._replace(node=node.children[0])
        sides = [self._port(asked.success), self._port(asked.failure)]
        ends = [Ends(skipped=asked.skipped)]
        for side in range(2):
            enter = (sides[side],)
            if side + 1 >= len(node.children):
                ends.append(Ends(failure=enter))
                continue
            first = len(self.parts)
            done = yield again._replace(node=node.children[side + 1], enter=enter)
            last = len(self.parts)
            ends.append(done)
            if last == first or self._is_constant(node.children[0]):
                continue
            port = self._port(enter)
            watch = yield again._replace(node=node.children[0], enter=(port,))
            same, other = (watch.success, watch.failure) if side == 0 else (
                watch.failure,
                watch.success,
            )
            self._back(node, port, same)
            self._stop(other, first, last)
            self._stop(watch.skipped, first, last)
            ends.append(Ends(skipped=watch.skipped))
            self._stop(done.all, last, len(self.parts))
            self._back(node, sides[1 - side], other)
        return _all_of(ends)

    def _switch(self, node: TreeNode, visit: _Visit) -> _Steps:
        """The child of the case that matches, else the last; a new value halts it."""
        begin = self._port(visit.enter)
        enter: Signals = (begin,)
        ends: list[Ends] = []
        variable = node.text("variable")
        for position, child in enumerate(node.children, start=1):
            if position < len(node.children):
                of = f"{variable} == {node.text(f'case_{position}')}"
                asked = self._choice(node, of, enter)
                taken, enter = asked.success, asked.failure
            else:
                taken = enter
            first = len(self.parts)
            done = yield visit._replace(node=child, enter=taken, again=True)
            ends.append(done)
            changed = self._watched(node, f"{variable} stays", taken, first, done)
            self._back(node, begin, changed)
        return _all_of(ends)

    def _check(self, node: TreeNode, visit: _Visit) -> _Steps:
        """BlackboardCheckInt and its like: asked again while the child runs."""
        of = f"{node.text('value_A')} == {node.text('value_B')}"
        first = self._choice(node, of, visit.enter)
        begin = len(self.parts)
        ends = yield from self._child(node, visit._replace(enter=first.success))
        ended = self._watched(node, of, first.success, begin, ends)
        other = _ends_of(node.text("return_on_mismatch") or "FAILURE", first.failure)
        halted = _ends_of(node.text("return_on_mismatch") or "FAILURE", ended)
        return _all_of((ends, other, halted))

    def _precondition(self, node: TreeNode, visit: _Visit) -> _Steps:
        asked = self._choice(node, f"if: {node.text('if')}", visit.enter)
        ends = yield from self._child(node, visit._replace(enter=asked.success))
        return _all_of((ends, _ends_of(node.text("else") or "FAILURE", asked.failure)))

    def _entry(self, node: TreeNode, visit: _Visit) -> _Steps:
        """EntryUpdated and its like: the child, if somebody has written an entry."""
        if not node.children:
            return self._choice(node, f"{node.text('entry')} was written", visit.enter)
        asked = self._choice(node, f"{node.text('entry')} was written", visit.enter)
        ends = yield from self._child(node, visit._replace(enter=asked.success))
        if node.identity == "SkipUnlessUpdated":
            return _all_of((ends, Ends(skipped=asked.failure)))
        if node.identity == "EntryUpdated":
            return _all_of((ends, Ends(failure=asked.failure)))
        waits = self._choice(node, f"{node.text('entry')} is written later", asked.failure)
        later = yield from self._child(node, visit._replace(enter=waits.success, again=True))
        return _all_of((ends, later))

    def _run_once(self, node: TreeNode, visit: _Visit) -> _Steps:
        if not visit.again:
            return (yield from self._child(node, visit))
        asked = self._choice(node, "this RunOnce has not run before", visit.enter)
        ends = yield from self._child(node, visit._replace(enter=asked.success))
        if (node.text("then_skip") or "true").strip().lower() in ("true", "1"):
            return _all_of((ends, Ends(skipped=asked.failure)))
        before = self._choice(node, "this RunOnce has succeeded", asked.failure)
        return _all_of((ends, Ends(before.success, before.failure)))

    # -- side by side ------------------------------------------------------------------------

    def _counts(self, node: TreeNode, visit: _Visit) -> tuple[int | None, int | None]:
        """The successes and the failures that end a Parallel; None for what is not known."""
        size = len(node.children)
        counts: list[int | None] = []
        for ports, default in (
            (("success_count", "success_threshold", "threshold"), -1),
            (("failure_count", "failure_threshold"), 1),
        ):
            port = next((each for each in ports if node.attribute(each)), "")
            count = number(node, port, visit.scope) if port else default
            if count is None and not is_reference(visit.scope.text(node.text(port))):
                raise _BlockedError
            counts.append(size + count + 1 if count is not None and count < 0 else count)
        return counts[0], counts[1]

    def _parallel(self, node: TreeNode, visit: _Visit) -> _Steps:
        size = len(node.children)
        need, fails = self._counts(node, visit)
        if need is None or fails is None:
            return (yield from self._other(node, visit))
        if not (1 <= need <= size and 1 <= fails <= size):
            raise _BlockedError
        fails = min(fails, size - need + 1)
        children = self._started(node, need, fails)
        first = len(self.parts)
        sides = yield from self._sides(node, children, visit)
        if any(side.skipped for side in sides):
            self.approximated.setdefault(node.index, node)
        last = len(self.parts)
        successes = joined(*(joined(side.success, side.skipped) for side in sides))
        failures = joined(*(side.failure for side in sides))
        ends = Ends()
        if successes:
            ends = Ends((self._join(node, successes, need, visit.enter),))
        if failures:
            failure = self._join(node, failures, fails, visit.enter)
            ends = ends._replace(failure=(failure,))
        self._stop(ends.all, first, last)
        if any(side.skipped for side in sides) and ends.success:
            asked = self._choice(node, "all children of this Parallel are skipped", ends.success)
            ends = ends._replace(success=asked.failure, skipped=asked.success)
        return ends

    def _started(self, node: TreeNode, need: int, fails: int) -> Sequence[int]:
        """The children that are started: those that end at once may end the Parallel before all are.
        """
        ended = [0, 0]
        for position, child in enumerate(node.children, start=1):
            constant = self._constant(child)
            if constant is not None:
                ended[constant] += 1
            if ended[True] >= need or ended[False] >= fails:
                return node.children[:position]
        return node.children

    def _sides(self, node: TreeNode, children: Sequence[int], visit: _Visit) -> Generator[
        _Visit, Ends, list[Ends]
    ]:
        """Children side by side. One that ends at once takes a moment, so that joins count it."""
        sides: list[Ends] = []
        for child in children:
            ends = yield visit._replace(node=child)
            entered = set(visit.enter)
            sides.append(
                Ends(
                    *(
                        self._tick(node, each) if entered & set(each) else each
                        for each in (ends.success, ends.failure, ends.skipped)
                    )
                )
            )
        return sides

    def _parallel_all(self, node: TreeNode, visit: _Visit) -> _Steps:
        """It fails with so many failures, once all its children have ended."""
        size, port = len(node.children), "max_failures"
        count = number(node, port, visit.scope) if node.attribute(port) else 1
        if count is None:
            return (yield from self._other(node, visit))
        fails = size + count + 1 if count < 0 else count
        if not 1 <= fails <= size:
            raise _BlockedError
        sides = yield from self._sides(node, node.children, visit)
        successes = joined(*(joined(side.success, side.skipped) for side in sides))
        failures = joined(*(side.failure for side in sides))
        everyone = self._join(node, joined(successes, failures), size, visit.enter)
        rows: list[Signals] = []
        for signals, need in ((successes, size - fails + 1), (failures, fails)):
            if signals:
                counted = self._join(node, signals, need, visit.enter)
                rows.append((self._join(node, (counted, everyone), 2, visit.enter),))
            else:
                rows.append(())
        return Ends(rows[0], rows[1])

    def _pipeline(self, node: TreeNode, visit: _Visit) -> _Steps:
        """Nav2's PipelineSequence: the earlier children run again while a later one runs."""
        return (yield from self._running_again(node, visit, together=False))

    def _nonblocking(self, node: TreeNode, visit: _Visit) -> _Steps:
        """Nav2's NonblockingSequence: all run, and those that have succeeded run again."""
        return (yield from self._running_again(node, visit, together=True))

    def _running_again(self, node: TreeNode, visit: _Visit, *, together: bool) -> _Steps:
        self.approximated.setdefault(node.index, node)
        begin = len(self.parts)
        entering, going = visit.enter, visit.enter
        failed: list[Signals] = []
        done: list[Signals] = []
        for position, child in enumerate(node.children, start=1):
            enter = entering if together else going
            ends = yield visit._replace(node=child, enter=enter)
            going = joined(ends.success, ends.skipped)
            if together and set(going) & set(entering):
                going = self._tick(node, going)
            done.append(going)
            failed.append(ends.failure)
            if position == len(node.children) and not together:
                continue
            if self._is_constant(child):
                continue
            port = self._port(going)
            more = yield visit._replace(node=child, enter=(port,), again=True, rerun=True)
            self._back(node, port, joined(more.success, more.skipped))
            failed.append(more.failure)
        end = len(self.parts)
        success, failure = done[-1], joined(*failed)
        if together:
            success = (self._join(node, joined(*done), len(done), visit.enter),)
        self._stop(joined(success, failure), begin, end)
        return Ends(success, failure)

    # -- clocks, values, nodes of one's own -----------------------------------------------------

    def _delay(self, node: TreeNode, visit: _Visit) -> _Steps:
        return (yield from self._child(node, visit._replace(enter=self._tick(node, visit.enter))))

    def _timeout(self, node: TreeNode, visit: _Visit) -> _Steps:
        begin = len(self.parts)
        ends = yield from self._child(node, visit)
        end = len(self.parts)
        if begin == end:
            return ends
        clock = self._choice(node, f"time is up ({node.text('msec')} ms)", visit.enter)
        self._stop(clock.success, begin, end)
        self._stop(ends.all, end, len(self.parts))
        return _all_of((ends, Ends(failure=clock.success)))

    def _maybe(self, node: TreeNode, visit: _Visit) -> _Steps:
        asked = self._choice(node, f"{node.identity} runs its child", visit.enter)
        ends = yield from self._child(node, visit._replace(enter=asked.success))
        return _all_of((ends, Ends(success=asked.failure)))

    def _single_trigger(self, node: TreeNode, visit: _Visit) -> _Steps:
        if visit.rerun:
            return Ends(failure=self._tick(node, visit.enter))
        return (yield from self._child(node, visit))

    def _manual(self, node: TreeNode, visit: _Visit) -> _Steps:
        """A person chooses the child."""
        enter, ends = visit.enter, []
        for position, child in enumerate(node.children, start=1):
            if position < len(node.children):
                asked = self._choice(node, f"child {position} is selected", enter)
                taken, enter = asked.success, asked.failure
            else:
                taken = enter
            ends.append((yield visit._replace(node=child, enter=taken)))
        return _all_of(ends)

    def _other(self, node: TreeNode, visit: _Visit) -> _Steps:
        """A node whose doing nobody knows: any child at any time, and any result."""
        begin = self._port(visit.enter)
        enter: Signals = (begin,)
        name = node.identity
        for position, child in enumerate(node.children, start=1):
            asked = self._choice(node, f"{name} runs child {position}", enter)
            ends = yield visit._replace(node=child, enter=asked.success, again=True)
            self._back(node, begin, ends.all)
            enter = asked.failure
        result = self._choice(node, f"{name} succeeds", enter)
        return Ends(result.success, result.failure)

    # -- purity ------------------------------------------------------------------------------

    def _is_constant(self, node: int) -> bool:
        return self._constant(node) is not None

    def _constant(self, index: int) -> bool | None:
        """The answer of a node that always gives the same one, at once."""
        node, flips, forced = self.forest.nodes[index], False, None
        while True:
            if any(each.name in (*_CONDITIONS, _WHILE) for each in node.attributes):
                return None
            builtin = self._builtin(node, node.identity)
            meaning = None if builtin is None else builtin.meaning
            if meaning in (Meaning.SUCCEED, Meaning.FAIL):
                answer = meaning is Meaning.SUCCEED if forced is None else forced
                return answer is not flips
            if meaning is Meaning.INVERT and forced is None:
                flips = not flips
            elif meaning in (Meaning.FORCE_SUCCESS, Meaning.FORCE_FAILURE):
                forced = meaning is Meaning.FORCE_SUCCESS if forced is None else forced
            elif meaning not in (Meaning.SEQUENCE, Meaning.FALLBACK, Meaning.PASS):
                return None
            if len(node.children) != 1:
                return None
            node = self.forest.nodes[node.children[0]]

    def _is_pure(self, index: int) -> bool:
        """True for what answers at once: conditions, and nodes that only ask them."""
        pending, seen = [index], 0
        while pending:
            node = self.forest.nodes[pending.pop()]
            seen += 1
            name = node.identity
            builtin = self._builtin(node, name)
            if seen > 1_000 or any(each.name.startswith("_") for each in node.attributes):
                return False
            if builtin is None:
                tree = self._tree_of(node, name)
                if tree >= 0:
                    pending += self.forest.nodes[tree].children
                elif node.children or self._category(node, name) != "Condition":
                    return False
            elif builtin.meaning is Meaning.SUBTREE:
                tree = self.forest.trees.get(node.text("ID"), -1)
                pending += self.forest.nodes[tree].children if tree >= 0 else ()
            elif builtin.meaning is Meaning.LEAF:
                if name not in ("ScriptCondition", "WasEntryUpdated"):
                    return False
            elif name.startswith("Async") or (
                builtin.meaning not in _PLAIN
                and builtin.meaning not in (Meaning.SUCCEED, Meaning.FAIL)
            ):
                return False
            else:
                pending += node.children
        return True

    def _category(self, node: TreeNode, name: str) -> str:
        if node.explicit:
            return node.tag
        model = (self.forest.models or {}).get(name)
        return model.category if model else ""

    # -- the machine -------------------------------------------------------------------------

    def _numbered(self, top: TreeNode, ends: Ends) -> TreeMachine:
        """All parts in the order of the file: the start, the leaves, the joins, both ends."""
        ranks = {NodeKind.START: 0, NodeKind.RUNNER: 1}
        order = sorted(
            range(len(self.parts)),
            key=lambda each: (
                ranks.get(self.parts[each].kind, 2),
                self.parts[each].node.index,
                each,
            ),
        )
        parts = [self.parts[each] for each in order]
        place = {old: new for new, old in enumerate(order)}
        complete, give_up = len(parts), len(parts) + 1
        parts += [_Part(NodeKind.COMPLETE, top), _Part(NodeKind.GIVE_UP, top)]
        nodes = tuple(
            Node(index, part.kind, index + 1, part.need) for index, part in enumerate(parts)
        )
        edges = self._resolved(
            [(signals, place[target]) for signals, target in self.edges]
            + [(ends.success, complete), (joined(ends.failure, ends.skipped), give_up)],
            place,
        )
        stops = self._resolved(
            [(signals, place[target]) for signals, target in self.stops], place
        )
        elements = [Element(0, Kind.PLAN, -1, 1, tuple(range(1, len(parts) + 1)), (), 1, 1, 0, 0)]
        elements[0] = replace(
            elements[0], line=top.line, column=top.column, start=top.start, end=top.end
        )
        paths = [top.path]
        copies: dict[str, int] = {}
        for index, part in enumerate(parts, start=1):
            runs, node = part.kind is NodeKind.RUNNER, part.node
            elements.append(
                Element(
                    index,
                    Kind.RUNNER if runs else Kind.CONTROL,
                    0,
                    index,
                    (),
                    part.attributes,
                    node.line,
                    node.column,
                    node.start,
                    node.end,
                    tag="" if runs else node.identity if part.kind is NodeKind.JOIN else part.kind,
                )
            )
            copy = copies[node.path] = copies.get(node.path, 0) + 1
            paths.append(node.path if copy == 1 else f"{node.path}@{copy}")
        return TreeMachine(
            self.forest.file,
            tuple(elements),
            paths=tuple(paths),
            nodes=nodes,
            edges=edges,
            stops=stops,
            approximated=tuple(
                Location(node.line, node.column, node.path)
                for _, node in sorted(self.approximated.items())
            ),
        )

    def _resolved(
        self, rows: list[tuple[Signals, int]], place: dict[int, int]
    ) -> tuple[Edge, ...]:
        """The connections, with the events that ports stand for; each once, in order."""
        meant: dict[int, Signals] = {}

        def meaning(signal: int) -> Signals:
            pending, seen, result = [signal], set(), {}
            while pending:
                each = pending.pop()
                if each >= 0:
                    result[each] = None
                elif each not in seen:
                    seen.add(each)
                    pending += reversed(self.ports[-each - 1])
            return tuple(result)

        connections: dict[Edge, None] = {}
        for signals, target in rows:
            for signal in signals:
                if signal not in meant:
                    meant[signal] = meaning(signal)
                for each in meant[signal]:
                    edge = Edge(place[each // 4], _EVENTS[each % 4], target)
                    connections[edge] = None
        return tuple(connections)


def _all_of(rows: Sequence[Ends]) -> Ends:
    return Ends(
        joined(*(each.success for each in rows)),
        joined(*(each.failure for each in rows)),
        joined(*(each.skipped for each in rows)),
    )


def _ends_at(condition: str, signals: Signals) -> Ends:
    if condition == "_failureIf":
        return Ends(failure=signals)
    return Ends(success=signals) if condition == "_successIf" else Ends(skipped=signals)


def _ends_of(status: str, signals: Signals) -> Ends:
    """The end that a status names; RUNNING is none: what waits may wait for ever, or end anyhow."""
    name = status.strip().upper()
    if name == "SUCCESS":
        return Ends(success=signals)
    return Ends(skipped=signals) if name == "SKIPPED" else Ends(failure=signals)


_COMPILERS: dict[Meaning, Any] = {
    Meaning.SEQUENCE: _Compiler._sequence,
    Meaning.MEMORY: _Compiler._memory,
    Meaning.FALLBACK: _Compiler._fallback,
    Meaning.FALLBACK_MEMORY: _Compiler._memory,
    Meaning.REACTIVE_SEQUENCE: _Compiler._reactive_sequence,
    Meaning.REACTIVE_FALLBACK: _Compiler._reactive_fallback,
    Meaning.PARALLEL: _Compiler._parallel,
    Meaning.PARALLEL_ALL: _Compiler._parallel_all,
    Meaning.BRANCH: _Compiler._branch,
    Meaning.WHILE: _Compiler._while_do_else,
    Meaning.INVERT: _Compiler._invert,
    Meaning.FORCE_SUCCESS: _Compiler._force_success,
    Meaning.FORCE_FAILURE: _Compiler._force_failure,
    Meaning.RETRY: _Compiler._retry,
    Meaning.REPEAT: _Compiler._repeat,
    Meaning.KEEP_RUNNING: _Compiler._keep_running,
    Meaning.DELAY: _Compiler._delay,
    Meaning.TIMEOUT: _Compiler._timeout,
    Meaning.RUN_ONCE: _Compiler._run_once,
    Meaning.SWITCH: _Compiler._switch,
    Meaning.PRECONDITION: _Compiler._precondition,
    Meaning.CHECK: _Compiler._check,
    Meaning.ENTRY: _Compiler._entry,
    Meaning.LOOP: _Compiler._loop,
    Meaning.MANUAL: _Compiler._manual,
    Meaning.TRY_CATCH: _Compiler._try_catch,
    Meaning.PIPELINE: _Compiler._pipeline,
    Meaning.RECOVERY: _Compiler._recovery,
    Meaning.ROUND_ROBIN: _Compiler._round_robin,
    Meaning.NONBLOCKING: _Compiler._nonblocking,
    Meaning.GATE: _Compiler._child,
    Meaning.PASS: _Compiler._child,
    Meaning.MAYBE: _Compiler._maybe,
    Meaning.SINGLE_TRIGGER: _Compiler._single_trigger,
}
