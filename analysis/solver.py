"""z3 as the decision procedure: one problem text, one named indicator per question.

No push and pop, no fresh solver per question. Limits are counts of z3's own steps (rlimit), so
that the same question gets the same answer on every machine; what exceeds them is *unknown*.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.encode import FALSE, TRUE, Encoding, symbols_of
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.options import DEFAULT_RLIMIT, DEFAULT_TOTAL_RLIMIT, InconclusiveError, Purse
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.workers import Z3_MB, require_free, require_memory

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.encode import Variant
    from gpsfsm.analysis.timing.pairs import Instants
    from gpsfsm.compile import Compiled

__all__ = ["InconclusiveError", "Solver", "add_text", "steps_of"]

PER_CHARACTER = 10
"""The cost of a character that z3 reads, in steps: about as much time, and it needs memory, too."""

_PER_NODE = 3
"""The cost of an event that is played without z3, in steps: about as much time."""

_HARVEST_FROM = 3  # fewer questions are asked one by one: reading a model costs more
_LONGEST_PAUSE = 31


_PARSER_BYTES, _BYTESPER_CHARACTER = 16 << 20, 256
"""The steps that z3 may need to read a problem: several times the measured number."""


def add_text(solver: Any, text: str) -> None:
    """Add the declarations and assertions of a text in SMT-LIB to a solver of z3.

    Raises MemoryError if there may be too little memory: z3's parser would end the process, with
    the exit code 101 and without a word.
    """
    require_free(_PARSER_BYTES + _BYTESPER_CHARACTER * len(text))
    solver.from_string(text)


def steps_of(solver: Any) -> int:
    """The steps that z3 has taken so far, for all problems together."""
    import z3

    statistics = solver.statistics()
    context = statistics.ctx.ref()
    for place in reversed(range(len(statistics))):  # it is one of the last
        if z3.Z3_stats_get_key(context, statistics.stats, place) == "rlimit count":
            return int(statistics[place][1])
    return 0


class Solver:
    """Questions about one automaton under constraints.

    The answer to "is there a scenario in which this term holds?" is True, False or None (limit).
    """

    LOGIC = "QF_FD"

    def __init__(
        self,
        compiled: Compiled,
        constraints: Constraints,
        *,
        rlimit: int = DEFAULT_RLIMIT,
        purse: Purse | None = None,
    ) -> None:
        require_memory(Z3_MB, module="z3")
        import z3

        self._z3: Any = z3
        self.rlimit = rlimit
        self.purse = purse or Purse(DEFAULT_TOTAL_RLIMIT)
        self.clock: Instants | None = None  # what is asked besides where durations are declared
        self.compiled = compiled
        self.automaton = compiled.automaton
        self.constraints = constraints
        self.encoding = Encoding(self.automaton, constraints)
        self.evaluator = Evaluator(self.automaton)
        self._solver: Any = z3.SolverFor(self.LOGIC)
        self._solver.set("random_seed", 0)
        self._solver.set("rlimit", rlimit)
        # z3 would take Ctrl-C for "unknown", and leave the signal so that no later read sees it
        self._solver.set("ctrl_c", False)
        self._questions = 0
        self._symbols: dict[str, Any] = {}
        self._declared: set[str] = set()
        self._pending: list[str] = []
        self._fresh: list[str] = []
        self._declarations: dict[str, Any] = {}
        self._true = z3.BoolVal(True).as_ast().value
        self._answers: dict[str, bool | None] = {TRUE: True, FALSE: False}
        self.tell([*self.encoding.scenarios(), *self.encoding.definitions()])

    def tell(self, assertions: Iterable[str], indicators: Iterable[str] = ()) -> None:
        """Add assertions; ``indicators`` are fresh symbols, all others occur in the text.

        Raises InconclusiveError if there are no steps left to pay for it.
        """
        lines = [f"(assert {assertion})" for assertion in assertions]
        self.purse.require(PER_CHARACTER * sum(map(len, lines)))
        self._pending += lines
        self._fresh += indicators

    def _flush(self) -> None:
        """Hand z3 what it has not been told yet, in one text."""
        if not self._pending:
            return
        text = "\n".join(self._pending)
        names = dict.fromkeys([*symbols_of(text), *self._fresh])
        new = [name for name in names if name not in self._declared]
        self._declared.update(new)
        declarations = "".join(f"(declare-const {name} {self.sort(name)})" for name in new)
        add_text(self._solver, f"{declarations}\n{text}")
        self._pending, self._fresh = [], []

    def sort(self, _name: str) -> str:
        """The sort of a symbol."""
        return "Bool"

    def contradictory(self) -> bool | None:
        """True if the constraints admit no scenario."""
        answer = self._check([])
        return None if answer is None else not answer

    def ask(self, terms: Sequence[str]) -> list[bool | None]:
        """True if there is a scenario in which the term holds, for each term."""
        new = [term for term in dict.fromkeys(terms) if term not in self._answers]
        if new and self.purse.empty:
            return [self._answers.get(term) for term in terms]
        names = {term: self._indicator() for term in new}
        self.tell((f"(= {name} {term})" for term, name in names.items()), names.values())
        pause = skipped = 0  # models that answer nothing else are read ever more seldom
        while names:
            term = next(iter(names))
            answer = self._answers[term] = self._check([names.pop(term)])
            if not answer or len(names) < _HARVEST_FROM:
                continue
            if skipped < pause:
                skipped += 1
                continue
            model = self._solver.model()
            others = [term for term, name in names.items() if self._holds(model, name)]
            for other in others:
                self._answers[other] = True
                del names[other]
            pause, skipped = (0 if others else min(2 * pause + 1, _LONGEST_PAUSE)), 0
        return [self._answers[term] for term in terms]

    def name(self, term: str) -> str:
        """A fresh symbol that implies the term; use it with ``must_check``."""
        name = self._indicator()
        self.tell([f"(=> {name} {term})"], [name])
        return name

    def without(
        self, numbers: Iterable[int], events: Sequence[Event] = (Event.SUCCEEDED, Event.FAILED)
    ) -> Variant:
        """The same run with these events of these instances held back; they do start."""
        node = self.automaton.runner_node
        variant = self.encoding.variant(
            {Signal(node(number), event): FALSE for number in numbers for event in events}
        )
        self.tell(variant.definitions)
        return variant

    def outcomes(self) -> tuple[Outcome, ...]:
        """The scenario of the last positive answer."""
        model = self._solver.model()
        named = self.encoding.named.items()
        return tuple(
            next(
                (outcome for outcome, letter in named if self._holds(model, f"{letter}{number}")),
                Outcome.FAILED,
            )
            for number in range(len(self.automaton.runners))
        )

    def holding(self, symbols: Iterable[str]) -> int:
        """The number of these symbols that hold in the last positive answer."""
        model = self._solver.model()
        return sum(self._holds(model, symbol) for symbol in symbols)

    def decide(self, terms: Sequence[str]) -> list[bool]:
        """Like ``ask``; raises InconclusiveError if a limit is hit."""
        answers = self.ask(terms)
        if None in answers:
            raise InconclusiveError
        return [bool(answer) for answer in answers]

    def must_check(self, names: Sequence[str]) -> bool:
        """True if the named terms can hold together; raises InconclusiveError if a limit is hit."""
        answer = self._check(names)
        if answer is None:
            raise InconclusiveError
        return answer

    def play(self) -> Evaluator:
        """The evaluator, for one run; raises InconclusiveError if no steps are left for it."""
        self.purse.require(_PER_NODE * len(self.automaton.nodes))
        return self.evaluator

    def _indicator(self) -> str:
        self._questions += 1
        return f"q{self._questions}"

    def _symbol(self, name: str) -> Any:
        if name not in self._symbols:
            self._symbols[name] = self._z3.Bool(name)
        return self._symbols[name]

    def _check(self, names: Sequence[str]) -> bool | None:
        self._flush()
        if self.purse.empty:
            return None
        if self.purse.left < self.rlimit:
            self._solver.set("rlimit", self.purse.left)
        before = steps_of(self._solver)
        answer = self._solver.check(*[self._symbol(name) for name in names])
        self.purse.pay(steps_of(self._solver) - before)
        if answer == self._z3.unknown:
            return None
        return bool(answer == self._z3.sat)

    def _holds(self, model: Any, name: str) -> bool:
        # z3's own accessors take 40 times as long; equal terms have equal addresses
        if name not in self._declarations:
            self._declarations[name] = self._symbol(name).decl()
        declaration = self._declarations[name]
        value = self._z3.Z3_model_get_const_interp(model.ctx.ref(), model.model, declaration.ast)
        return bool(value) and value.value == self._true
