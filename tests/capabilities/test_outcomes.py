"""Declared outcomes are constraints, like assumptions (semantics, section 8.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import Capabilities, Library, bind
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import compile_plan
from gpsfsm.errors import UsageError
from gpsfsm.model.capability import Interface, Outcomes, Parameter, Provider
from gpsfsm.model.report import Verdict
from tests import strategies
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from gpsfsm.analysis.options import SolverChoice
    from gpsfsm.model.report import Facts, PlanReport
    from tests.oracle import P

FLUSH = (("flush", True),)
SURE = Outcomes(never_fails=True)
HOPELESS = Outcomes(never_succeeds=True)
LAZY = Outcomes(may_hang=True)
NAMES = {
    "Sure": SURE,
    "Unless": Outcomes(never_fails=True, unless=FLUSH),
    "Hopeless": HOPELESS,
    "Lazy": LAZY,
    "SureLazy": Outcomes(never_fails=True, may_hang=True),
    "HopelessLazy": Outcomes(never_succeeds=True, may_hang=True),
    "Impossible": Outcomes(never_fails=True, never_succeeds=True),
    "Any": Outcomes(),
}
LIBRARY = Library(
    interfaces=tuple(Interface(f"demo/{name}") for name in NAMES),
    providers=tuple(
        Provider(
            f"demo/{name}",
            f"demo/{name}",
            described=True,
            configuration=(Parameter("flush", default=False),),
            outcomes=outcomes,
        )
        for name, outcomes in NAMES.items()
    ),
)


def plan(*parts: str) -> str:
    return f"<Plan>{''.join(parts)}</Plan>"


def run(name: str, flush: str = "") -> str:
    attribute = f' flush="{flush}"' if flush else ""
    return f'<Runner interface="demo/{name}" provider="demo/{name}"{attribute}/>'


def control(kind: str, *parts: str) -> str:
    return f'<Control type="{kind}">{"".join(parts)}</Control>'


def checked(text: str, library: Library = LIBRARY, **analysis: Any) -> PlanReport:
    options = CheckOptions(AnalysisOptions(**analysis), capabilities=Capabilities(library))
    return check_text(text, "plan.xml", options)


def facts(text: str, **analysis: Any) -> Facts:
    computed = checked(text, **analysis).facts
    assert computed is not None
    return computed


def ends(computed: Facts) -> tuple[str, str, str]:
    return computed.completes.value, computed.gives_up.value, computed.stuck.value


SURE_RESCUED = plan(run("Sure"), control("recovery", run("Any")))
HOPELESS_RESCUED = plan(run("Hopeless"), control("recovery", run("Any")))


@pytest.mark.parametrize("solver", ["structural", "z3", "auto"])
class TestNeverFails:
    """Outcomes stay independent, so both ways of deciding answer."""

    def test_alone(self, solver: SolverChoice) -> None:
        answer = facts(plan(run("Sure")), solver=solver)
        assert ends(answer) == ("always", "never", "never")
        assert answer.fewest_failures_to_give_up is None
        assert [event.effect for event in answer.dangling] == ["dont_care"]  # 5.3: it stays a fact

    def test_nothing_is_found(self, solver: SolverChoice) -> None:
        report = checked(plan(run("Sure")), solver=solver)
        assert (report.verdict, report.findings) == (Verdict.ACCEPTED, ())

    def test_its_recovery_is_never_tried(self, solver: SolverChoice) -> None:
        answer = facts(SURE_RESCUED, solver=solver)
        assert ends(answer) == ("always", "never", "never")
        assert answer.unreachable == ("/Plan/Control[1]/Runner[1]",)

    @pytest.mark.parametrize(
        ("flush", "completes"), [("", "always"), ("false", "always"), ("true", "sometimes")]
    )
    def test_unless(self, flush: str, completes: str, solver: SolverChoice) -> None:
        answer = facts(plan(run("Sure"), run("Unless", flush)), solver=solver)
        assert answer.completes == completes
        effect = "dont_care" if completes == "always" else "give_up"
        assert [event.effect for event in answer.dangling] == ["dont_care", effect]

    def test_as_the_last_resort(self, solver: SolverChoice) -> None:
        answer = facts(plan(run("Any"), control("recovery", run("Sure"))), solver=solver)
        assert ends(answer) == ("always", "never", "never")
        assert answer.unreachable == ()

    def test_beside_others(self, solver: SolverChoice) -> None:
        answer = facts(plan(control("parallel_any", run("Sure"), run("Any"))), solver=solver)
        assert ends(answer) == ("always", "never", "never")
        assert answer.orphans == (
            "/Plan/Control[1]/Runner[1]",
            "/Plan/Control[1]/Runner[2]",
        )
        answer = facts(plan(control("parallel_all", run("Sure"), run("Any"))), solver=solver)
        assert ends(answer) == ("sometimes", "sometimes", "never")
        assert answer.fewest_failures_to_give_up == 1


@pytest.mark.parametrize("solver", ["z3", "auto"])
class TestOtherDeclarations:
    """Outcomes that the structural pass alone cannot judge."""

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            (plan(run("Hopeless")), ("never", "always", "never")),
            (plan(run("Hopeless"), run("Any")), ("never", "always", "never")),
            (HOPELESS_RESCUED, ("sometimes", "sometimes", "never")),
            (plan(run("Lazy")), ("sometimes", "sometimes", "sometimes")),
            (plan(run("SureLazy")), ("sometimes", "never", "sometimes")),
            (plan(run("HopelessLazy")), ("never", "sometimes", "sometimes")),
            (plan(run("Hopeless"), run("Lazy")), ("never", "always", "never")),
            (
                plan(control("parallel_any", run("Lazy"), run("Sure"))),
                ("always", "never", "never"),
            ),
            (
                plan(control("parallel_all", run("SureLazy"), run("Sure"))),
                ("sometimes", "never", "sometimes"),
            ),
            (
                plan(control("parallel_all", run("Hopeless"), run("Sure"))),
                ("never", "always", "never"),
            ),
        ],
    )
    def test_ends(self, text: str, expected: tuple[str, str, str], solver: SolverChoice) -> None:
        assert ends(facts(text, solver=solver)) == expected

    def test_what_is_behind_is_unreachable(self, solver: SolverChoice) -> None:
        answer = facts(plan(run("Hopeless"), run("Any")), solver=solver)
        assert answer.unreachable == ("/Plan/Runner[2]",)
        assert answer.fewest_failures_to_give_up == 1

    def test_a_recovery_is_always_tried(self, solver: SolverChoice) -> None:
        assert facts(HOPELESS_RESCUED, solver=solver).fewest_failures_to_give_up == 2

    @pytest.mark.parametrize(
        ("name", "faults", "expected"),
        [
            ("Sure", ("no-start",), ("always", "never", "never")),
            ("Sure", ("hang",), ("sometimes", "never", "sometimes")),
            ("Sure", ("no-start", "hang"), ("sometimes", "never", "sometimes")),
            ("Hopeless", ("no-start",), ("never", "always", "never")),
            ("Hopeless", ("hang",), ("never", "sometimes", "sometimes")),
            ("Lazy", ("hang",), ("sometimes", "sometimes", "sometimes")),
        ],
    )
    def test_with_faults(
        self,
        name: str,
        faults: tuple[str, ...],
        expected: tuple[str, str, str],
        solver: SolverChoice,
    ) -> None:
        assert ends(facts(plan(run(name)), faults=faults, solver=solver)) == expected

    def test_a_start_that_cannot_be_missed_does_not_hold_others_up(
        self, solver: SolverChoice
    ) -> None:
        both = plan(control("parallel_any", run("Sure"), run("Sure")))
        assert facts(both, faults=("no-start",), solver=solver).unreachable == ()
        assert ends(facts(both, faults=("no-start",), solver=solver)) == (
            "always",
            "never",
            "never",
        )


@pytest.mark.parametrize("name", ["Hopeless", "Lazy"])
def test_the_structural_pass_says_that_it_cannot_judge(name: str) -> None:
    with pytest.raises(UsageError, match="independent outcomes"):
        checked(plan(run(name)), solver="structural")


class TestContradictions:
    DECLARED = "the assumptions, options and declared outcomes admit no scenario of this plan"

    def message(self, report: PlanReport) -> str:
        assert (report.verdict, report.facts) == (Verdict.UNDECIDED, None)
        (finding,) = report.findings
        assert finding.rule == "GP902"
        return finding.message

    @pytest.mark.parametrize(
        ("name", "assumption"),
        [
            ("Sure", "line 1 fails"),
            ("Sure", "Sure always fails"),
            ("Hopeless", "line 1 succeeds"),
            ("Sure", "line 1 hangs"),
        ],
    )
    def test_with_assumptions(self, name: str, assumption: str) -> None:
        assert self.message(checked(plan(run(name)), assumptions=(assumption,))) == self.DECLARED

    def test_of_equal_actions(self) -> None:
        """Of one interface there may be several providers."""
        surely, never = (
            Provider(f"demo/{name}", "demo/Any", described=True, outcomes=outcomes)
            for name, outcomes in (("Yes", SURE), ("No", HOPELESS))
        )
        library = Library(interfaces=(Interface("demo/Any"),), providers=(never, surely))
        both = plan(
            *(run("Any").replace('r="demo/Any', f'r="demo/{name}') for name in ("Yes", "No"))
        )
        assert ends(facts_of(both, library)) == ("never", "always", "never")
        assert self.message(checked(both, library, consistent=True)) == self.DECLARED

    def test_of_the_declaration_itself(self) -> None:
        assert self.message(checked(plan(run("Impossible")))) == self.DECLARED
        actual = checked(plan(run("Impossible")), faults=("hang",)).facts
        assert actual is not None
        assert ends(actual) == ("never", "never", "always")

    def test_nothing_is_said_of_declarations_where_there_is_none(self) -> None:
        both = ("line 1 fails", "line 1 succeeds")
        message = "the assumptions and options admit no scenario of this plan"
        assert self.message(checked(plan(run("Any")), assumptions=both)) == message


def facts_of(text: str, library: Library) -> Facts:
    computed = checked(text, library).facts
    assert computed is not None
    return computed


# ---- the same as the assumption that says it -----------------------------------------------------


def declaring(outcomes: Outcomes) -> Library:
    """``demo_runners/Demo`` with declared outcomes, for one of the two interfaces."""
    name = "demo_capabilities/GoRunner"
    provider = Provider("demo_runners/Demo", name, described=True, outcomes=outcomes)
    return Library(interfaces=(Interface(name),), providers=(provider,))


def facts_for(
    whole: P,
    library: Library,
    *,
    faults: Collection[str],
    assumptions: Sequence[str] = (),
    solver: SolverChoice,
) -> Facts:
    tree = plan_of(whole)
    compiled = compile_plan(tree, start_chain="no-start" in faults, bindings=bind(tree, library))
    allowed = constraints_of(
        tree, faults=faults, assumptions=assumptions, bindings=compiled.bindings
    )
    options = AnalysisOptions(
        faults=tuple(sorted(faults)), assumptions=tuple(assumptions), solver=solver
    )
    return decide(compiled, allowed, options).facts()


def paths(whole: P, outcomes: Outcomes, *, declared: bool) -> list[str]:
    """Of the runners whose outcomes are declared, or of the others."""
    tree = plan_of(whole)
    return [
        tree.path(runner)
        for runner, binding in zip(tree.runners, bind(tree, declaring(outcomes)), strict=True)
        if (binding is not None) is declared
    ]


@given(strategies.plans(max_runners=7), strategies.faults(), st.sampled_from([SURE, HOPELESS]))
def test_declared_outcomes_are_assumptions(
    whole: P, faults: frozenset[str], outcomes: Outcomes
) -> None:
    verb = "never fails" if outcomes.never_fails else "never succeeds"
    named = paths(whole, outcomes, declared=True)
    said = [f"{verb}: {', '.join(named)}"] if named else []
    solvers: list[SolverChoice] = ["z3", "auto"]
    if not faults and outcomes.never_fails:
        solvers.append("structural")
    for solver in solvers:
        assert facts_for(whole, declaring(outcomes), faults=faults, solver=solver) == facts_for(
            whole, Library(), faults=faults, assumptions=said, solver=solver
        )


@given(strategies.plans(max_runners=6), st.booleans())
def test_may_hang_is_the_fault_of_one_provider(whole: P, no_start: bool) -> None:
    faults = {"no-start"} if no_start else set[str]()
    others = paths(whole, LAZY, declared=False)
    said = [f"never hangs: {', '.join(others)}"] if others else []
    wanted = facts_for(whole, Library(), faults=faults | {"hang"}, assumptions=said, solver="z3")
    assert facts_for(whole, declaring(LAZY), faults=faults, solver="auto") == wanted
