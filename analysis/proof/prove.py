"""The proof of what the structural pass proposes: replays for "can", one refutation for "never".

Each analysis says what runs show its answer (``show``) and what never holds if it is right
(``refute``). All runs are replayed together (``witnesses.py``), and z3 refutes the disjunction of
all that never holds in one query (``refutation.py``). What cannot be put in these terms z3 answers
by itself, and the answers are compared, on plans that are small enough (``second_opinion``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.decisions import Analysis, analyses
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.analysis.proof.parts import LOCAL, Parts
from gpsfsm.analysis.proof.refutation import Refutation, UnprovedError
from gpsfsm.analysis.proof.witnesses import Witnesses
from gpsfsm.errors import InternalError
from gpsfsm.model.report import By, Proof
from gpsfsm.workers import Z3_MB, require_memory

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.decide import Deciders
    from gpsfsm.analysis.options import Purse

_PER_CHARACTER = 10
_PER_NODE = 3


GUESSED = frozenset({"data_flow", "overlaps", "prompts"})
"""Analyses whose runs are the simplest ones: a later failure may be what loses a value, or what
brings two runners together, so that these runs need not show it."""


def prove(deciders: Deciders, answers: Mapping[str, Any]) -> Proof:
    """Prove the answers of the structural pass; InternalError if a proof shows one to be wrong."""
    structure = deciders.structure
    assert structure is not None
    witnesses, refutation = Witnesses(structure), Refutation(structure)
    decided: dict[str, By] = {}
    by_itself: set[str] = set()
    local = _handed_in_by_units(deciders, answers, refutation)
    for analysis in analyses():
        decided[analysis.name] = By.STRUCTURAL
        if not analysis.compared:
            continue
        witnesses.analysis = analysis.name
        claims = refutation.claims
        try:
            _put(
                analysis,
                answers[analysis.name],
                witnesses,
                None if analysis.name in local else refutation,
            )
        except UnprovedError:
            by_itself.add(analysis.name)
            continue
        refutes = refutation.claims > claims or analysis.name in local
        decided[analysis.name] = By.Z3 if refutes else By.REPLAY
    purse = deciders.budget.deciding
    open_: set[By] = set()  # what is proved in this way remains unproved
    try:
        by_itself |= _unshown(witnesses, purse)
    except InconclusiveError:
        open_.add(By.REPLAY)
    try:
        refuted = _refuted(refutation.text(), deciders.options.rlimit, purse)
    except InconclusiveError:
        refuted = None
    if refuted is False:
        raise InternalError("z3 has found a run that the structural pass rules out")
    if refuted is None or open_:
        open_.add(By.Z3)
    unproved = dict.fromkeys((name for name, by in decided.items() if by in open_), "--rlimit")
    decided |= dict.fromkeys(unproved, By.STRUCTURAL)
    for analysis in analyses():
        if analysis.name in by_itself:
            reason = _answered(analysis, deciders, answers[analysis.name])
            decided[analysis.name] = By.STRUCTURAL if reason else By.Z3
            if reason and analysis.matters(deciders.options):
                unproved[analysis.name] = reason
    return Proof(decided, unproved)


def _unshown(witnesses: Witnesses, purse: Purse) -> set[str]:
    """The analyses that runs do not show and z3 has to be asked about, of those that are GUESSED.

    Of all others, a run that does not show its claim is a defect. Raises InternalError for that,
    and InconclusiveError at a limit.
    """
    purse.require(_PER_NODE * witnesses.cost)
    missed = witnesses.missed()
    if missed - GUESSED:
        names = ", ".join(sorted(missed - GUESSED))
        raise InternalError(f"a run does not show what the structural pass says of: {names}")
    return missed


def _handed_in_by_units(
    deciders: Deciders, answers: Mapping[str, Any], refutation: Refutation
) -> frozenset[str]:
    """The analyses that are refuted unit by unit: of large plans, those that can be."""
    structure = deciders.structure
    if structure is None or deciders.small:
        return frozenset()
    by_name = {each.name: each for each in analyses() if each.name in LOCAL}
    if any(each.by_structure(structure) != answers[name] for name, each in by_name.items()):
        return frozenset()  # the contracts of the units are about other answers
    try:
        Parts(structure, answers["completion"], answers["fewest"]).hand_in(refutation)
    except UnprovedError:
        return frozenset()
    absorbing = any(each.effect == "absorbed" for each in answers["joins"])
    return LOCAL - {"joins"} if absorbing else LOCAL


def _put(
    analysis: Analysis, answer: Any, witnesses: Witnesses, refutation: Refutation | None
) -> None:
    """Hand in what proves an answer, without a ``refutation`` what shows it.

    Raises UnprovedError where nothing does but z3 by itself.
    """
    if analysis.show is not None and analysis.refute is not None:
        analysis.show(answer, witnesses)
        if refutation is not None:
            analysis.refute(answer, refutation)
    elif answer is not None:
        raise UnprovedError


def _answered(analysis: Analysis, deciders: Deciders, answer: Any) -> str:
    """The reason why z3 does not answer by itself; InternalError if it answers otherwise."""
    if not deciders.small:
        return f"{deciders.options.second_opinion} runners"
    try:
        second = analysis.by_solver(deciders.solver)
    except InconclusiveError:
        return "--rlimit"
    if second != answer:
        raise InternalError(
            f"the structural pass and z3 disagree on '{analysis.name}': {answer} and {second}"
        )
    return ""


def _refuted(text: str, rlimit: int, purse: Purse) -> bool | None:
    """True if z3 refutes the problem, False if it has a solution, None at the limit of steps."""
    if not text:
        return True
    purse.require(_PER_CHARACTER * len(text))
    require_memory(Z3_MB, module="z3")
    import z3

    from gpsfsm.analysis.solver import add_text, steps_of

    if purse.empty:
        return None
    solver: Any = z3.SolverFor("QF_FD")
    solver.set("random_seed", 0)
    solver.set("rlimit", min(rlimit, purse.left))
    solver.set("ctrl_c", False)
    add_text(solver, text)
    before = steps_of(solver)
    answer = solver.check()
    purse.pay(steps_of(solver) - before)
    return None if answer == z3.unknown else bool(answer == z3.unsat)
