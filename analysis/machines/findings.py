"""Findings about a machine: its answers, each with the shortest run that shows it.

Those about the machine of a behaviour tree are in the words of trees (semantics, section 10).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.analysis.definitions import MAX_EFFORT
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.words import actor, count, fewest_words, listed, place
from gpsfsm.compile.instants import COMPLETED, EVENTS, FAILED, GAVE_UP, GOING, HANG, STARTED
from gpsfsm.compile.units import TreeMachine
from gpsfsm.errors import InternalError
from gpsfsm.model.capability import CHOICE, OWN, TICK
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Related, Scenario, Severity, TraceStep
from gpsfsm.model.labels import verb
from gpsfsm.model.plan import line_words
from gpsfsm.model.printable import clip
from gpsfsm.model.report import (
    Dangling,
    Facts,
    Frequency,
    JoinDeadlock,
    LoopFact,
    MachineFacts,
    Precision,
)
from gpsfsm.model.story import Sentence, Statement, Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.analysis.machines.decide import Answers, Claim, DanglingAt, Run
    from gpsfsm.analysis.machines.overlaps import Overlap
    from gpsfsm.analysis.machines.plain import Plain
    from gpsfsm.compile.instants import Configuration
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element

_OUTCOMES = {1: Outcome.SUCCEEDED, FAILED: Outcome.FAILED, 3: Outcome.HANG}
_STATEMENTS = {
    Outcome.SUCCEEDED: Statement.SUCCEEDS,
    Outcome.FAILED: Statement.FAILS,
    Outcome.HANG: Statement.NEVER_ENDS,
}
_OF_CHOICES = {Outcome.SUCCEEDED: Statement.HOLDS, Outcome.FAILED: Statement.DOES_NOT_HOLD}
_ENDS = {COMPLETED: End.COMPLETED, GAVE_UP: End.GAVE_UP}
_MOST_TRACE = 200
_MOST_SENTENCES = 12
_MAX_NAME = 60
_MOST_LINES = 8
_SEVERITIES = {"stuck": Severity.ERROR, "endless": Severity.WARNING}  # else as in plans
_WAITS = {
    "stuck": "nothing more can happen then, and the machine is stuck",
    "give_up": "the machine gives up",
    "endless": "the machine runs for ever",
    "absorbed": "the machine completes without it",
}


def facts_of(answers: Answers, automaton: Automaton) -> Facts:
    """The facts of the contract."""
    plan = automaton.plan

    def path(number: int) -> str:
        return plan.path(plan.runners[number])

    return Facts(
        runners=sum(
            plan.vocabulary is not Vocabulary.TREE or each.interface not in OWN
            for each in plan.runners
        ),
        completes=answers.completes,
        gives_up=answers.gives_up,
        stuck=answers.stuck,
        unreachable=tuple(map(path, answers.unreachable)),
        dangling=tuple(
            Dangling(
                plan.path(automaton.nodes[each.signal.node].origin), each.signal.event, each.effect
            )
            for each in answers.dangling
        ),
        join_deadlocks=tuple(
            JoinDeadlock(plan.path(automaton.nodes[each.node].origin), each.effect)
            for each in answers.waiting
        ),
        orphans=tuple(path(number) for number, _ in answers.orphans),
        fewest_failures_to_give_up=answers.fewest_failures,
        machine=MachineFacts(
            endless=answers.endless,
            completes_if_fair=answers.completes_if_fair,
            loops=tuple(
                LoopFact(tuple(map(path, loop.runners)), loop.trap) for loop in answers.loops
            ),
        ),
        precision=_precision(answers),
    )


def _precision(answers: Answers) -> dict[str, Precision]:
    """The facts that are not proved as they stand."""
    names: dict[str, tuple[Frequency, Claim]] = {
        "completes": (answers.completes, ("end", COMPLETED)),
        "gives_up": (answers.gives_up, ("end", GAVE_UP)),
        "stuck": (answers.stuck, ("end", GOING)),
        "endless": (answers.endless, ("endless",)),
    }
    sometimes = [name for name, row in names.items() if row[0] is Frequency.SOMETIMES]
    proved = [name for name in sometimes if names[name][1] not in answers.may]
    precision = dict.fromkeys(sometimes, Precision.MAY) | dict.fromkeys(proved, Precision.CAN)
    if len(proved) > 1:  # what ends otherwise is no run that ends so
        for name in proved:
            del precision[name]
    if ("fewest",) in answers.may and answers.fewest_failures is not None:
        precision["fewest_failures_to_give_up"] = Precision.AT_LEAST
    kinds = {claim[0] for claim in answers.may}
    lists = {"dangling": "dangling", "waiting": "join_deadlocks", "orphan": "orphans"}
    lists["loop"] = "loops"
    return precision | {name: Precision.MAY for kind, name in lists.items() if kind in kinds}


class Findings:
    """The findings about one machine; at most ``most`` of each rule have a scenario.

    ``plain``: the steps by which scenarios are replayed.
    """

    def __init__(self, answers: Answers | None, plain: Plain, most: int, tolerate: int = 0) -> None:
        self._answers = answers
        self.tolerate = tolerate
        self.plain = plain
        self.automaton = plain.automaton
        self.plan = self.automaton.plan
        self.vocabulary = self.plan.vocabulary
        self.terms = self.vocabulary.terms
        self.most = most
        self._shown: dict[str, int] = {}

    @property
    def answers(self) -> Answers:
        """The answers that the findings tell; those about overlaps need none."""
        assert self._answers is not None
        return self._answers

    def all(self) -> Iterator[Finding]:
        """All findings that tell the answers, by what they are about."""
        yield from self._unreachable()
        yield from self._ends()
        yield from self._loops()
        yield from self._dangling()
        yield from self._waiting()
        yield from self._orphans()

    def _weighed(self, finding: Finding, *claim: object) -> Finding:
        """A finding about what can happen: a may where no exact run shows it."""
        return finding.as_may() if claim in self.answers.may else finding

    def _unreachable(self) -> Iterator[Finding]:
        for number in self.answers.unreachable:
            element = self.plan.runners[number]
            if element.interface == TICK:  # stands for nothing that a file has
                continue
            yield rule("GP301").finding(
                f"no run of the {self.terms.whole} triggers {place(element)}{self._cause(element)}",
                self.plan.location(element),
            )

    def _cause(self, _element: Element) -> str:
        """The reason why a runner is never triggered, if it is in the file."""
        return ""

    def _ends(self) -> Iterator[Finding]:
        whole, answers, terms = self.plan.location(0), self.answers, self.terms
        if answers.gives_up is Frequency.ALWAYS:
            yield rule("GP305").finding(
                f"this {terms.whole} {terms.gives_up} in every run",
                whole,
                scenario=self._scenario("GP305", answers.shown[GAVE_UP]),
            )
        elif answers.completes is Frequency.NEVER:
            yield rule("GP304").finding(
                f"this {terms.whole} never completes, whatever happens: every run "
                f"{terms.gives_up}, gets stuck or runs for ever",
                whole,
                severity=self._severity_of_never(),
                hint=self._hint_of_never(),
            )
        if answers.stuck in (Frequency.SOMETIMES, Frequency.ALWAYS):
            always = answers.stuck is Frequency.ALWAYS
            how = "gets stuck in every run" if always else "can get stuck"
            finding = rule("GP306").finding(
                f"this {terms.whole} {how}: it neither completes nor {terms.gives_up}, and nothing "
                "more can happen",
                whole,
                hint="connect the events after which nothing happens",
                scenario=self._scenario("GP306", answers.shown[GOING], Statement.STUCK),
            )
            yield finding if always else self._weighed(finding, "end", GOING)

    def _severity_of_never(self) -> Severity | None:
        """The severity of a machine that never completes; None for that of the rule."""
        return None

    def _hint_of_never(self) -> str:
        """The hint then, "" for that of the rule."""
        return "let an event that can occur lead to an end that completes the machine"

    def _loops(self) -> Iterator[Finding]:
        for loop in self.answers.loops:
            code = "GP313" if loop.trap else "GP314"
            elements = [self.plan.runners[number] for number in loop.runners]
            acting = [each for each in elements if each.interface not in OWN] or elements
            names = listed([place(element) for element in acting])
            message = (
                f"once entered, this loop is never left, whatever the outcomes: {names}"
                if loop.trap
                else f"this loop runs for ever if the same outcomes repeat: {names}"
            )
            finding = rule(code).finding(
                message,
                self.plan.location(acting[0]),
                scenario=self._scenario(
                    code, loop.lasso.prefix, Statement.FOR_EVER, loop=loop.lasso.loop
                ),
            )
            yield self._weighed(finding, "loop", loop.trap, frozenset(loop.runners))

    def _dangling(self) -> Iterator[Finding]:
        """One finding for all events that end the machine, and one for each that it is stuck at."""
        ending = [each for each in self.answers.dangling if each.effect == "give_up"]
        if ending:
            yield self._giving_up(ending)
        for each in self.answers.dangling:
            if each.effect != "stuck" or each.shown is None:
                continue
            element = self._element(each.signal.node)
            said = f"if {place(element)} {verb(element, each.signal.event)}"
            finding = rule("GP302").finding(
                f"{said}, nothing handles that: the {self.terms.whole} is stuck",
                self.plan.location(element),
                severity=Severity.WARNING,
                hint="connect this event to the node that should follow it",
                scenario=self._scenario("GP302", each.shown),
            )
            yield self._weighed(finding, "dangling", each.signal)

    def _giving_up(self, ending: Sequence[DanglingAt]) -> Finding:
        """The events after which the machine gives up; a warning where too few failures do it."""
        elements = [self._element(each.signal.node) for each in ending]
        failures = all(each.signal.event is Event.FAILED for each in ending)
        numbers = sorted({(each.file, each.line) for each in elements})
        lines = [line_words(str(line), file) for file, line in numbers]
        where = f"line{'s' * (len(numbers) > 1)} {listed(lines, most=_MOST_LINES)}"
        if any(each.lineless for each in elements):
            where = listed(list(dict.fromkeys(each.where for each in elements)), most=_MOST_LINES)
        terms, fewest = self.terms, self.answers.fewest_failures
        one = len(ending) == 1
        broken = fewest is not None and fewest <= self.tolerate and self.tolerate > 0
        what = count(len(ending), "failure" if failures else "outcome")
        least = ("fewest",) in self.answers.may
        message = f"{what} {terms.ends_it[0 if one else 1]} ({where}: {terms.unguarded}); "
        message += fewest_words(fewest, terms, failures=failures, at_least=least)
        if broken:
            message += f", but --tolerate {self.tolerate} requires more"
        finding = rule("GP302").finding(
            message,
            self.plan.location(elements[0]),
            severity=Severity.WARNING if broken else Severity.INFO,
            hint=terms.tolerate_more if broken else terms.tolerate_hint,
            related=tuple(
                Related(self.plan.location(each), terms.unguarded) for each in elements[1:]
            ),
            scenario=self._scenario(
                "GP302", self.answers.with_fewest or self.answers.shown[GAVE_UP]
            ),
        )
        doubted = any(("dangling", each.signal) in self.answers.may for each in ending)
        return finding.as_may() if doubted else finding

    def _waiting(self) -> Iterator[Finding]:
        for each in self.answers.waiting:
            element = self._element(each.node)
            closing = () if each.loop else (Statement.STUCK,) * (each.effect == "stuck")
            finding = rule("GP303").finding(
                f"the join {self._name(element)} can receive some of its inputs and wait for the "
                f"others for ever: {_WAITS[each.effect]}",
                self.plan.location(element),
                severity=_SEVERITIES.get(each.effect) if each.fair else None,
                hint="stop the join where a new round begins, or connect what can happen instead",
                scenario=self._scenario("GP303", each.shown, *closing, loop=each.loop),
            )
            yield self._weighed(finding, "waiting", each.node)

    def _orphans(self) -> Iterator[Finding]:
        for number, run in self.answers.orphans:
            element = self.plan.runners[number]
            left = Sentence(Statement.LEFT_RUNNING, arguments=(place(element),))
            finding = rule("GP311").finding(
                f"the machine can complete while {place(element)} is still active",
                self.plan.location(element),
                hint="connect the event that completes the machine to it with the action stop",
                scenario=self._scenario("GP311", run, left),
            )
            yield self._weighed(finding, "orphan", number)

    def of_overlaps(self, overlaps: Iterable[Overlap]) -> Iterator[Finding]:
        """The findings about runners that hold one resource at once."""
        for each in overlaps:
            first, second = self.plan.runners[each.first], self.plan.runners[each.second]
            resource = clip(each.resource, _MAX_NAME)
            finding = rule("GP501").finding(
                f"{place(first)} and {place(second)} can be active at the same time, but both "
                f"need exclusive use of the {resource}",
                self.plan.location(first),
                hint="stop one of them with the event that starts the other",
                related=(Related(self.plan.location(second), f"holds the {resource}"),),
                scenario=self._scenario(
                    "GP501",
                    each.shown,
                    Sentence(Statement.HELD_TWICE, arguments=(resource,)),
                    then=each.then,
                ),
            )
            yield finding if each.sure else finding.as_may()

    def _element(self, node: int) -> Element:
        return self.plan.elements[self.automaton.nodes[node].origin]

    def _name(self, element: Element) -> str:
        return self.plan.path(element).removeprefix("/machine/")

    # -- scenarios --------------------------------------------------------------------------

    def _scenario(
        self,
        code: str,
        run: Run,
        *closing: Statement | Sentence,
        loop: Run = (),
        then: Run = (),
    ) -> Scenario | None:
        """A run as a scenario: replayed step by step, and a loop until it closes.

        ``then``: the rest of the run, which is not told. None also where it takes too long to say
        that the options allow the run. Raises InternalError if they do not.
        """
        self._shown[code] = self._shown.get(code, 0) + 1
        if self._shown[code] > self.most:
            return None
        try:
            at, trace = self._replayed((*run, *then), loop)
        except InconclusiveError:
            return None
        end = _ENDS.get(at.ended, End.ENDLESS if loop or at.active else End.STUCK)
        sentences = list(self._sentences(run))
        if loop:
            sentences += (Sentence(Statement.BEGINS_LOOP), *self._sentences(loop))
        sentences += (each if isinstance(each, Sentence) else Sentence(each) for each in closing)
        return Scenario(
            outcomes=tuple(
                (self.plan.path(self.plan.runners[number]), _OUTCOMES[outcome])
                for number, outcome in (*run, *then, *loop)
            ),
            ends=end,
            trace=tuple(trace[-_MOST_TRACE:]),
            trace_truncated=len(trace) > _MOST_TRACE,
            sentences=tuple(sentences),
            vocabulary=self.vocabulary,
        )

    def _replayed(self, run: Run, loop: Run) -> tuple[Configuration, list[TraceStep]]:
        """The configuration after a run, and its events; each outcome by the definitions."""
        plain = self.plain
        plain.definitions.effort = MAX_EFFORT
        instant = plain.instants.first()
        at, trace = plain.remembered(instant, -1, STARTED), list(self._trace(instant.events))
        begin = at
        for steps, (number, outcome) in enumerate((*run, *loop), start=1):
            if not at.active >> number & 1 or outcome not in plain.possible(at, number):
                raise InternalError("a scenario does not obey the options")
            if outcome == HANG:
                at = plain.after(at, number, outcome)
            else:
                instant = plain.instants.after(at, number, outcome)
                at = plain.remembered(instant, number, outcome)
                trace += self._trace(instant.events)
            begin = at if steps == len(run) else begin
        if loop and at != begin:
            raise InternalError("a loop of a scenario does not lead back to its beginning")
        return at, trace

    def _trace(self, events: Iterable[int]) -> Iterator[TraceStep]:
        for code in events:
            place_of = self.plan.location(self.automaton.nodes[code >> 2].origin)
            yield TraceStep(EVENTS[code & 3], place_of.element, place_of.line, place_of.file)

    def _sentences(self, run: Run) -> Iterator[Sentence]:
        hidden = max(0, len(run) - _MOST_SENTENCES)
        for number, outcome in run[: _MOST_SENTENCES // 2] if hidden else run:
            yield self._sentence(number, outcome)
        if hidden:
            yield Sentence(Statement.STEPS_LEFT_OUT, count=hidden)
            for number, outcome in run[-_MOST_SENTENCES // 2 :]:
                yield self._sentence(number, outcome)

    def _sentence(self, number: int, outcome: int) -> Sentence:
        element = self.plan.runners[number]
        statements = _STATEMENTS | (_OF_CHOICES if element.interface == CHOICE else {})
        return Sentence(statements[_OUTCOMES[outcome]], (actor(self.plan, element.index),))


# -- behaviour trees ------------------------------------------------------------------------
#
# A leaf has several uses in the machine of a tree: one for each round of a loop that is written
# out, and one that watches in a reactive node. It is unreachable if none of them is ever started.
# Choices and ticks stand for what a node does by itself, so nothing is said of them.


def answers_for_tree(answers: Answers, automaton: Automaton) -> Answers:
    """The answers that are about the tree: of leaves, each named by its first use.

    A Parallel that has ended waits for nobody, whatever its joins have taken in.
    """
    runners = automaton.plan.runners
    started = {
        each.spot for number, each in enumerate(runners) if number not in answers.unreachable
    }
    named: dict[tuple[str, int], int] = {}
    for number in answers.unreachable:
        each = runners[number]
        if each.spot not in started and each.interface not in OWN:
            named.setdefault(each.spot, number)
    dangling: dict[tuple[tuple[str, int], Event], DanglingAt] = {}
    for event in answers.dangling:
        spot = automaton.plan.elements[automaton.nodes[event.signal.node].origin].spot
        dangling.setdefault((spot, event.signal.event), event)
    return replace(
        answers,
        unreachable=tuple(sorted(named.values())),
        dangling=tuple(dangling.values()),
        waiting=(),
        orphans=(),
    )


class TreeFindings(Findings):
    """The findings about one tree."""

    def _cause(self, element: Element) -> str:
        pruned = self.plan.pruned if isinstance(self.plan, TreeMachine) else ()
        for each in pruned:
            if each.spot == element.spot:
                verb = "fails" if each.fails else "succeeds"
                return f": {each.before} at {each.location.words} never {verb}"
        return ""

    def _severity_of_never(self) -> Severity | None:
        """A tree that goes round for ever is mostly meant to."""
        return Severity.INFO if self._goes_on() else None

    def _hint_of_never(self) -> str:
        return "nothing if the tree is meant to run for ever" if self._goes_on() else ""

    def _goes_on(self) -> bool:
        return self.answers.endless is not Frequency.NEVER

    def _loops(self) -> Iterator[Finding]:
        """Loops that really go on: a choice among its steps may be one that never comes."""
        for loop in self.answers.loops:
            elements = [self.plan.runners[number] for number in loop.runners]
            if not loop.trap and any(each.interface in OWN for each in elements):
                continue
            acting = [each for each in elements if each.interface not in OWN]
            names = listed([place(each) for each in _once(acting)]) or "no action"
            code = "GP313" if loop.trap else "GP314"
            message = (
                f"once entered, this loop runs for ever, whatever the outcomes: {names}"
                if loop.trap
                else f"this loop runs for ever if the same outcomes repeat: {names}"
            )
            finding = rule(code).finding(
                message,
                self.plan.location((acting or elements)[0]),
                severity=Severity.INFO,
                hint="nothing if that is intended; otherwise bound the loop",
                scenario=self._scenario(
                    code, loop.lasso.prefix, Statement.FOR_EVER, loop=loop.lasso.loop
                ),
            )
            yield self._weighed(finding, "loop", loop.trap, frozenset(loop.runners))


def _once(elements: list[Element]) -> list[Element]:
    """The first use of each leaf."""
    return list({each.spot: each for each in reversed(elements)}.values())[::-1]
