"""The brute force of sections 8.1 and 8.2 against answers computed by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cases import many
from tests.oracle import (
    FAILED,
    C,
    R,
    Says,
    facts,
    par_all,
    par_any,
    plan,
    rec,
    runner_paths,
    seq,
)
from tests.oracle.capabilities import (
    CONFIGURATION,
    EXTERNAL,
    UPSTREAM,
    Described,
    Input,
    Output,
    Parameter,
    World,
)
from tests.oracle.support import C1, C2, R1, R2
from tests.oracle.values import lost, missing, overwritten
from tests.strategies import faults
from tests.strategies_capabilities import libraries, plans_over

if TYPE_CHECKING:
    from tests.oracle import P

R3 = "/Plan/Runner[3]"
HANG, NO_START = frozenset({"hang"}), frozenset({"no-start"})
few = settings(max_examples=many(60))

GIVES = Described("Give", outputs=(Output("text"), Output("why", FAILED)))
MAYBE = Described("Maybe", outputs=(Output("text", optional=True),))
TAKES = Described("Take", parameters=(Parameter("text", required=True),))
READS = Described("Read", inputs=(Input("text", required=True),))
EITHER = Described(
    "Either",
    parameters=(Parameter("words"), Parameter("spare", default="hm")),
    inputs=(Input("text", required=True, sources=(CONFIGURATION, UPSTREAM), fallback="words"),),
)
VALUES = (GIVES, MAYBE, TAKES, READS, EITHER, Described("Mute"))


def of(*children: C | R | str, **options: Any) -> World:
    return World(plan(*children), VALUES, **options)


def test_missing() -> None:
    always, sometimes = "always", "sometimes"
    assert missing(of("Take")) == {(R1, "text"): always}
    assert missing(of("Take text=x")) == {}
    assert missing(of("Read text=x")) == {(R1, "text"): always}  # only upstream counts
    assert missing(of("Give", "Take", "Read")) == {(R3, "text"): always}  # Take gives nothing on
    assert missing(of("Give", "Read")) == {}
    assert missing(of("Maybe", "Read")) == {(R2, "text"): sometimes}
    assert missing(of("Maybe", "Take text=x")) == {}
    assert missing(of("Unknown", "Read", "Take")) == {(R3, "text"): always}
    assert missing(of("Give x=1", rec("Read"))) == {(f"{C1}/Runner[1]", "text"): always}
    assert missing(of(rec("Take"))) == {}  # unreachable


def test_joins_drop_values() -> None:
    always = "always"
    read = f"{C2}/Runner[1]"
    assert missing(of("Give", rec("Mute"), "Read")) == {(R2, "text"): always}
    assert missing(of(seq(par_any("Give", "Give")), seq("Read"))) == {(read, "text"): always}
    assert missing(of(seq(par_all("Give", "Give")), seq("Read"))) == {(read, "text"): always}
    # A parallel of one unit has no join, nor has an empty recovery.
    assert missing(of(par_all("Give"), "Read")) == {}
    assert missing(of("Give", rec(), "Read")) == {}
    # All units of a parallel are triggered by what triggers it, each gets all of it, but under
    # the chain of starts only the first.
    both = ("Give", par_all("Read", "Read"))
    assert missing(of(*both)) == {}
    assert missing(of(*both, faults=NO_START)) == {(f"{C1}/Runner[2]", "text"): always}


def test_a_failure_hands_over_other_outputs() -> None:
    why = Described("Why", inputs=(Input("why", required=True),))
    whole = plan("Give", rec("Why"))
    assert missing(World(whole, (*VALUES, why))) == {}
    assert missing(World(whole, (*VALUES, why), faults=NO_START)) == {}
    only = Says(R1, "succeeds")
    assert missing(World(plan("Give", rec("Read")), VALUES, constraint=only)) == {}  # unreachable


def test_where_an_input_may_come_from() -> None:
    def needs(*sources: str, fallback: str = "", default: str | None = None) -> Described:
        entry = Input("text", True, None, sources, fallback)
        return Described("Need", parameters=(Parameter("spare", default=default),), inputs=(entry,))

    def of_need(described: Described, *children: str) -> bool:
        return bool(missing(World(plan(*children), (GIVES, MAYBE, described))))

    assert not of_need(needs(EXTERNAL), "Need text=x")
    assert not of_need(needs(CONFIGURATION), "Need text=x")
    assert of_need(needs(UPSTREAM), "Need text=x")
    assert of_need(needs(CONFIGURATION), "Give", "Need")
    assert of_need(needs(EXTERNAL, fallback="spare"), "Need spare=x")
    assert not of_need(needs(CONFIGURATION, fallback="spare"), "Need spare=x")
    assert not of_need(needs(CONFIGURATION, fallback="spare", default="y"), "Need")
    assert of_need(needs(CONFIGURATION, default="y"), "Need")
    # Behind a runner that nobody describes only what may come from upstream is not judged.
    assert not of_need(needs(), "Unknown", "Need")
    assert of_need(needs(CONFIGURATION), "Unknown", "Need")


def test_of_a_parameter_and_an_input_of_one_name_the_input_counts() -> None:
    parameters = (Parameter("text", required=True),)
    calm = Described("Calm", parameters=parameters, inputs=(Input("text"),))
    assert missing(World(plan("Calm"), [calm])) == {}
    strict = Described("Calm", parameters=parameters, inputs=(Input("text", required=True),))
    assert missing(World(plan("Calm text=x"), [strict])) == {(R1, "text"): "always"}


def test_overwritten() -> None:
    assert overwritten(of("Give", "Take text=x")) == {(R2, "text"): "always"}
    assert overwritten(of("Maybe", "Take text=x")) == {(R2, "text"): "sometimes"}
    assert overwritten(of("Give", "Take")) == {}
    assert overwritten(of("Give", "Mute", "Take text=x")) == {}
    assert overwritten(of("Give", rec("Mute"), "Take text=x")) == {}
    assert overwritten(of("Give", rec("Take text=x"))) == {}
    assert overwritten(of("Unknown", "Take text=x")) == {}
    assert overwritten(of("Give", "Take text=x", constraint=Says(R1, "fails"))) == {}
    assert overwritten(of("Give", par_any("Take text=x", "Take"))) == {
        (f"{C1}/Runner[1]", "text"): "always"
    }
    assert overwritten(of("Give", "Either words=x")) == {}  # a fallback is meant to give way


def test_lost() -> None:
    assert lost(of("Give", "Mute", "Read")) == {(R1, "text", R3)}
    assert lost(of("Give", "Mute", "Take text=x")) == set()
    assert lost(of("Give", "Mute", "Take text=$text")) == {(R1, "text", R3)}
    assert lost(of("Give", "Mute", "Take text={a}")) == {(R1, "text", R3)}
    assert lost(of("Give", "Mute", "Take text=${a.b}")) == {(R1, "text", R3)}
    assert lost(of("Give", "Take text=$text")) == set()  # it is overwritten
    assert lost(of("Give", "Maybe", "Read")) == set()  # it may get another text
    assert lost(of("Give", "Give", "Read")) == set()  # it gets another text
    assert lost(of("Give", rec("Mute"), "Read")) == {(R1, "text", R2)}
    assert lost(of("Give", "Mute", "Either")) == {(R1, "text", R3)}
    assert lost(of("Give", "Mute", "Either words=x")) == set()
    assert lost(of("Give", "Unknown", "Read")) == set()
    assert lost(of("Read", "Give")) == set()  # not a later one
    assert lost(of("Mute", rec("Read"), "Give")) == set()


def test_lost_needs_a_run_that_shows_both() -> None:
    recovery = f"{C1}/Runner[1]"
    assert lost(of("Give", rec("Read"))) == set()  # Give has failed then
    assert lost(of("Give", "Mute", rec("Read"))) == {(R1, "text", recovery)}
    one, two = f"{C1}/Runner[1]", f"{C1}/Control[1]/Runner[2]"
    beside = (par_any("Give", seq("Mute", "Read")),)
    assert lost(of(*beside)) == {(one, "text", two)}
    # Later means further down, also where both begin at once.
    both = (f"{C1}/Runner[1]", "text", f"{C1}/Runner[2]")
    assert lost(of(par_any("Give", "Read"))) == {both}
    assert lost(of(par_any("Read", "Give"))) == set()
    assert lost(of(*beside, constraint=Says(one, "fails"))) == set()


def test_declared_outcomes() -> None:
    def ends(described: Described, whole: P, **options: Any) -> set[str]:
        return {run.ends for run in World(whole, [described], **options).runs}

    whole = plan("A")
    assert ends(Described("A", never_fails=True), whole) == {"COMPLETED"}
    assert ends(Described("A", never_fails=True), whole, faults=NO_START) == {"COMPLETED"}
    assert ends(Described("A", never_fails=True), whole, faults=HANG) == {"COMPLETED", "STUCK"}
    assert ends(Described("A", never_succeeds=True), whole) == {"GAVE_UP"}
    assert ends(Described("A", may_hang=True), whole) == {"COMPLETED", "GAVE_UP", "STUCK"}
    assert ends(Described("A", never_fails=True, never_succeeds=True), whole) == set()
    assert ends(Described("B", may_hang=True), plan("A", "B")) == {"COMPLETED", "GAVE_UP", "STUCK"}
    only = Described("B", may_hang=True)
    assert all(run.scenario[R1] != "HANG" for run in World(plan("A", "B"), [only]).runs)


def test_unless() -> None:
    def may_fail(*words: str, default: bool | int | None = None) -> bool:
        described = Described(
            "A",
            parameters=(Parameter("x", default=default),),
            never_fails=True,
            unless=(("x", 1),),
        )
        return any(run.gave_up for run in World(plan(" ".join(["A", *words])), [described]).runs)

    assert not may_fail()
    assert may_fail("x=1")
    assert may_fail("x=1.0")
    assert not may_fail("x=true")  # a Boolean never equals a number
    assert may_fail(default=1)
    assert not may_fail("x=2", default=1)
    assert not may_fail(default=True)


@few
@given(data=st.data(), models=faults(), consistent=st.booleans())
def test_the_world_plays_what_the_oracle_plays(
    data: st.DataObject, models: frozenset[str], consistent: bool
) -> None:
    library = data.draw(libraries(outcomes=True))
    whole = data.draw(plans_over(library, max_runners=4))
    world = World(whole, library, faults=models, consistent=consistent)
    answer = facts(whole, faults=world.faults, consistent=consistent, constraint=world.allows)
    assert (answer is None) == (not world.runs)
    if answer is not None:
        unreachable = set(runner_paths(whole)) - {one.path for one in world.reachable}
        assert set(answer["unreachable"]) == unreachable
