"""The status of each node of a tree while it runs, out of what its leaves do.

The automaton knows leaves only. A control node runs as long as something in it acts; when nothing
does any more, it has ended, and how follows from how its children have ended: a Sequence fails with
the child that failed, a Fallback succeeds with the child that succeeded. Children of a node that
has ended are IDLE again, and remember how they ended, as in BehaviorTree.CPP.

    <Sequence><Go/><Look/></Sequence>     Go started:    RUNNING  RUNNING  IDLE
                                          Go succeeded:  RUNNING  SUCCESS  RUNNING
                                          Look failed:   FAILURE  IDLE (SUCCESS)  IDLE (FAILURE)

Nodes that answer at once, without a leaf (AlwaysFailure, Script), have a constant result, which
counts where its turn has come.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.records import Kind, Status
from gpsfsm.model.tree import Meaning
from gpsfsm.watch.moments import status_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.execution.records import Record
    from gpsfsm.watch.groot_tree import GrootTree, Use

IDLE, RUNNING, SUCCESS, FAILURE = range(4)
WAS = 10
"""A node that is IDLE again has the number of its last status, and ten."""

_HALTED = -1
_BEGINS = (Kind.TRIGGERED, Kind.STARTED)
_ENDS = {Kind.SUCCEEDED: SUCCESS, Kind.FAILED: FAILURE, Kind.STOPPED: _HALTED}
_ROWS = {
    Meaning.SEQUENCE: FAILURE,
    Meaning.MEMORY: FAILURE,
    Meaning.PIPELINE: FAILURE,
    Meaning.NONBLOCKING: FAILURE,
    Meaning.FALLBACK: SUCCESS,
    Meaning.FALLBACK_MEMORY: SUCCESS,
}
"""Nodes that end at the first child with this result, in the order of their children."""

_LATEST = (Meaning.BRANCH, Meaning.RECOVERY, Meaning.TRY_CATCH, Meaning.SWITCH)
"""Further nodes whose children run one after the other."""

_REACTIVE = {Meaning.REACTIVE_SEQUENCE: FAILURE, Meaning.REACTIVE_FALLBACK: SUCCESS}
_PARALLEL = (Meaning.PARALLEL, Meaning.PARALLEL_ALL)
_CONSTANT = {Meaning.SUCCEED: SUCCESS, Meaning.FAIL: FAILURE}
_FLIPPED = {SUCCESS: FAILURE, FAILURE: SUCCESS}
_REFUSING = (Meaning.TIMEOUT, Meaning.PRECONDITION, Meaning.CHECK)
"""Nodes that fail where a choice of theirs is the last that happens."""

_SAME_AS_CHILD = (Meaning.SUBTREE, Meaning.PASS, Meaning.DELAY)
_CONDITIONS = ("_skipIf", "_failureIf", "_successIf", "_while")
_COUNTS = ("success_count", "success_threshold", "threshold")
_FAILURES = ("failure_count", "failure_threshold")


class Statuses:
    """Follows a run. ``shown`` has the number of the status of each use."""

    def __init__(self, tree: GrootTree) -> None:
        self.tree = tree
        self.shown = [IDLE] * len(tree.uses)
        self._results: list[int | None] = [None] * len(tree.uses)
        self._inside = [0] * len(tree.uses)  # how many runners act in it
        self._last: dict[int, int] = {}  # the child that has ended last
        self._chosen: dict[int, int] = {}  # the last choice of a use
        self._acting: set[int] = set()
        self._constants: list[int | None] = [None] * len(tree.uses)
        for use in reversed(range(len(tree.uses))):
            self._constants[use] = self._constant(use)

    def add(self, records: Iterable[Record]) -> None:
        """Take in what has happened at once."""
        touched: set[int] = set()
        self._chosen.clear()
        for record in records:
            if record.kind is Kind.ENDED:
                self._settle(touched)
                self._ended(status_of(record))
                return
            use = self.tree.owners.get(record.node)
            if use is None:
                continue
            if record.kind in _BEGINS and record.node not in self._acting:
                self._begins(record.node, use)
            elif record.kind in _ENDS:
                self._ends(record.node, use, _ENDS[record.kind])
            else:
                continue
            while use >= 0 and use not in touched:
                touched.add(use)
                use = self.tree.uses[use].parent
        self._settle(touched)

    def buffer(self) -> bytes:
        """The statuses as the protocol has them: of each node two bytes, its uid, and one."""
        return b"".join(
            (use + 1).to_bytes(2, "little") + bytes((self.shown[use],)) for use in self.tree.order
        )

    # -- what leaves do --------------------------------------------------------------------------

    def _begins(self, node: int, use: int) -> None:
        self._acting.add(node)
        self._inside[use] += 1
        if node not in self.tree.helpers or self.tree.uses[use].children:
            self._runs(use)
        uses, child = self.tree.uses, use
        while (parent := uses[child].parent) >= 0:
            self._inside[parent] += 1
            self._runs(parent)
            if uses[parent].meaning in _ROWS or uses[parent].meaning in _LATEST:
                self._again(parent, child)
            child = parent

    def _runs(self, use: int) -> None:
        """A use runs; if it did not, none of its children has ended yet."""
        if self.shown[use] != RUNNING:
            self.shown[use] = RUNNING
            self._last.pop(use, None)
            for child in self.tree.uses[use].children:
                self._results[child] = None
        self._results[use] = None

    def _again(self, parent: int, child: int) -> None:
        """Children behind one that begins have not begun yet, or are to run once more."""
        for each in self.tree.uses[parent].children:
            if each > child and not self._inside[each]:
                self._rest(each)
                self._results[each] = None

    def _ends(self, node: int, use: int, result: int) -> None:
        acted = node in self._acting
        if acted:
            self._acting.discard(node)
            inner = use
            while inner >= 0:
                self._inside[inner] -= 1
                inner = self.tree.uses[inner].parent
        if node in self.tree.helpers:
            self._chosen[use] = result
            return
        if result == _HALTED and (not acted or self._inside[use]):
            return  # it never acted, or acts for another round
        if self._inside[use]:
            return
        self._finish(use, result)

    def _finish(self, use: int, result: int) -> None:
        """A use has ended with a result."""
        self._results[use] = result
        parent = self.tree.uses[use].parent
        if parent >= 0:
            self._last[parent] = use
        self.shown[use] = WAS + RUNNING if result == _HALTED else result
        for child in self.tree.uses[use].children:
            self._rest(child)

    def _rest(self, use: int) -> None:
        """A use that its parent resets, with all that is in it."""
        pending = [use]
        while pending:
            each = pending.pop()
            if self.shown[each] in (RUNNING, SUCCESS, FAILURE):
                self.shown[each] += WAS
                pending += self.tree.uses[each].children

    # -- what controls make of it ----------------------------------------------------------------

    def _settle(self, touched: set[int]) -> None:
        """Let all end in which nothing acts any more; children come before their parents."""
        for use in sorted(touched, reverse=True):
            each = self.tree.uses[use]
            if not each.children or self.shown[use] != RUNNING:
                continue
            self._pass_constants(use)
            if not self._inside[use]:
                result = self._outcome(use)
                self._finish(use, _HALTED if result is None else result)

    def _pass_constants(self, use: int) -> None:
        """Children of a row that answer at once, and whose turn has come."""
        ends = _ROWS.get(self.tree.uses[use].meaning)
        if ends is None:
            return
        for child in self.tree.uses[use].children:
            constant = self._constants[child]
            result = self._results[child]
            if self._inside[child] or result in (ends, _HALTED):
                return
            if constant is not None and result is None:
                self._results[child] = self.shown[child] = constant
                if constant == ends:
                    return

    def _ended(self, status: Status) -> None:
        """The run has ended. What the top has not shown yet it has now; then all is IDLE."""
        result = {Status.COMPLETED: SUCCESS, Status.GAVE_UP: FAILURE}.get(status)
        if result is not None and self.tree.uses:
            self._finish(0, result)
        for use in range(len(self.shown)):
            if self.shown[use] in (RUNNING, SUCCESS, FAILURE):
                self.shown[use] += WAS

    # -- results ---------------------------------------------------------------------------------

    def _constant(self, use: int) -> int | None:
        """The result that a use always has, at once; its children's constants are there already."""
        each = self.tree.uses[use]
        if any(each.node.attribute(name) for name in _CONDITIONS):
            return None
        if not each.children:
            return _CONSTANT.get(each.meaning)
        results = [self._constants[child] for child in each.children]
        ends = _ROWS.get(each.meaning, _REACTIVE.get(each.meaning))
        if ends is not None:
            for result in results:
                if result is None or result == ends:
                    return result
            return _FLIPPED[ends]
        if results[0] is None:
            return None
        return self._of_one(each.meaning, results[0])

    def _of_one(self, meaning: Meaning, result: int) -> int | None:
        """The result of a decorator whose child has one, as far as it is a constant."""
        if meaning is Meaning.INVERT:
            return _FLIPPED[result]
        if meaning is Meaning.FORCE_SUCCESS:
            return SUCCESS
        if meaning is Meaning.FORCE_FAILURE:
            return FAILURE
        return result if meaning in _SAME_AS_CHILD else None

    def _outcome(self, use: int) -> int | None:
        """The result of a use in which nothing acts any more; None if it was halted."""
        each = self.tree.uses[use]
        meaning = each.meaning
        results = [self._result(child) for child in each.children]
        if meaning in _ROWS:
            return _of_row([self._results[child] for child in each.children], _ROWS[meaning])
        if meaning in _REACTIVE:
            ends = _REACTIVE[meaning]
            if ends in results:
                return ends
            return results[-1] if results[-1] in (SUCCESS, FAILURE) else None
        if meaning in _PARALLEL:
            return _of_parallel(each, results)
        if meaning is Meaning.RECOVERY:
            return SUCCESS if results[0] == SUCCESS else _failed(results)
        if meaning is Meaning.TRY_CATCH:
            return FAILURE if FAILURE in results[:-1] else _of_row(results[:-1], FAILURE)
        if meaning in (Meaning.BRANCH, Meaning.WHILE):
            return self._of_branch(use, results)
        last = results[each.children.index(self._last[use])] if use in self._last else None
        if last in (SUCCESS, FAILURE):
            assert last is not None
            one = self._of_one(meaning, last)
            return last if one is None else one
        if meaning in _REFUSING and use in self._chosen:
            return FAILURE
        return SUCCESS if meaning is Meaning.MAYBE and use in self._chosen else None

    def _result(self, use: int) -> int | None:
        result = self._results[use]
        return self._constants[use] if result is None else result

    def _of_branch(self, use: int, results: Sequence[int | None]) -> int | None:
        """IfThenElse, WhileDoElse: the branch that the condition has chosen."""
        branch = 1 if results[0] == SUCCESS else 2
        if results[0] not in (SUCCESS, FAILURE):  # it still watched, and was halted
            children = self.tree.uses[use].children
            branch = children.index(self._last[use]) if use in self._last else 0
            if branch == 0:
                return None
        if branch == len(results):
            return FAILURE
        return results[branch] if results[branch] in (SUCCESS, FAILURE) else None


def _of_row(results: Sequence[int | None], ends: int) -> int | None:
    """The result of a row; children without a result were skipped, or their turn never came."""
    some = False
    for result in results:
        if result in (ends, _HALTED):
            return result if result == ends else None
        some = some or result is not None
    return _FLIPPED[ends] if some else None


def _failed(results: Sequence[int | None]) -> int | None:
    return FAILURE if FAILURE in results else None


def _of_parallel(use: Use, results: Sequence[int | None]) -> int | None:
    """The result of a Parallel: enough successes, else enough failures."""
    size = len(results)
    good, bad = results.count(SUCCESS), results.count(FAILURE)
    if use.meaning is Meaning.PARALLEL_ALL:
        if good + bad < size:
            return None
        return FAILURE if bad >= _count(use, ("max_failures",), 1, size) else SUCCESS
    if good >= _count(use, _COUNTS, -1, size):
        return SUCCESS
    return FAILURE if bad >= _count(use, _FAILURES, 1, size) or good + bad == size else None


def _count(use: Use, ports: Sequence[str], default: int, size: int) -> int:
    """A number of children; below 0 it counts from all. One that is not written is the default."""
    count = default
    for port in ports:
        text = use.node.text(port).strip()
        if text.lstrip("+-").isascii() and text.lstrip("+-").isdecimal() and len(text) < 10:
            count = int(text)
            break
    return size + count + 1 if count < 0 else count
