"""The brute force of prompt buffers against answers computed by hand, and its own theorem."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cases import many
from tests.oracle import (
    SUCCEEDED,
    C,
    R,
    Says,
    par_all,
    par_any,
    plan,
    rec,
    seq,
)
from tests.oracle.buffers import effects, empty_answer, empty_flush, prompting, unflushed
from tests.oracle.capabilities import (
    Described,
    Input,
    Output,
    Parameter,
    Prompt,
    World,
)
from tests.oracle.support import C1, R1, R2
from tests.strategies import faults
from tests.strategies_capabilities import libraries, plans_over

if TYPE_CHECKING:
    from tests.oracle import Run

R3 = "/Plan/Runner[3]"
HANG, NO_START = frozenset({"hang"}), frozenset({"no-start"})
few = settings(max_examples=many(60))

ASK = Described(
    "Ask",
    parameters=(Parameter("uuid"), Parameter("flush", default=False)),
    outputs=(Output("answer"),),
    prompt=Prompt(answer="answer"),
)
SENDS = Described("Send", outputs=(Output("uuid"),))
MAY_SEND = Described("MaySend", outputs=(Output("flush", optional=True),))
HEARS = Described("Hear", inputs=(Input("answer"),))
PROMPTS = (ASK, SENDS, MAY_SEND, HEARS, Described("Mute"))
FILL, FLUSH = "Ask uuid=a", "Ask uuid=a flush=true"


def prompts(*children: C | R | str, **options: Any) -> World:
    return World(plan(*children), PROMPTS, **options)


def test_unflushed() -> None:
    first, second = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    assert unflushed(prompts(FILL, FLUSH)) == set()
    assert unflushed(prompts(FLUSH, FILL)) == {R2}
    assert unflushed(prompts(FILL)) == {R1}
    assert unflushed(prompts(FILL, "Ask uuid=b flush=true")) == {R1}
    assert unflushed(prompts(FILL, "Ask flush=true")) == {R1}
    assert unflushed(prompts("Ask", "Ask flush=true")) == {R1}  # a buffer to itself
    assert unflushed(prompts("Ask uuid=", "Ask uuid= flush=true")) == {R1}
    assert unflushed(prompts(FILL, FLUSH, rec("Mute"))) == set()  # to try it is enough
    assert unflushed(prompts(FILL, FLUSH, rec(FLUSH))) == set()
    # In parallel the flush may come first.
    assert unflushed(prompts(par_all(FILL, FLUSH))) == {first}
    assert unflushed(prompts(par_any(FILL, FLUSH))) == {first}
    assert unflushed(prompts(par_any(FILL, "Mute"), FLUSH)) == {first}  # the fill runs on
    assert unflushed(prompts(par_all(FILL, "Mute"), FLUSH)) == set()
    assert unflushed(prompts(par_any(FILL, "Mute"))) == {first}
    assert unflushed(prompts(par_any("Mute", FILL), constraint=Says(second, "fails"))) == set()


def test_a_flush_after_the_end_is_a_flush() -> None:
    # Mute completes the plan, but the other unit runs on and flushes.
    assert unflushed(prompts(par_any("Mute", seq(FILL, FLUSH)))) == set()
    fill = f"{C1}/Control[1]/Runner[1]"
    assert unflushed(prompts(par_any("Mute", seq(FILL, "Mute", FLUSH)))) == {fill}


def test_runs_that_do_not_complete_do_not_count() -> None:
    assert unflushed(prompts(FILL, FLUSH, "Mute")) == set()
    assert unflushed(prompts(FILL, "Mute", constraint=Says(R2, "fails"))) == set()
    assert unflushed(prompts(FILL, "Mute", faults=HANG, constraint=Says(R2, "hangs"))) == set()
    assert unflushed(prompts(par_any(FILL, "Mute"), faults=HANG)) == {f"{C1}/Runner[1]"}


def test_empty_flush() -> None:
    first, second = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    assert empty_flush(prompts(FLUSH)) == {R1}
    assert empty_flush(prompts("Ask flush=true")) == set()  # without a uuid
    assert empty_flush(prompts(FILL, FLUSH)) == set()
    assert empty_flush(prompts(FILL, FLUSH, FLUSH)) == set()  # the buffer is not emptied
    assert empty_flush(prompts("Ask uuid=b", FLUSH)) == {R2}
    assert empty_flush(prompts(FLUSH, FILL)) == {R1}
    assert empty_flush(prompts(FLUSH, FLUSH)) == {R1, R2}  # flushing is no filling
    assert empty_flush(prompts(FILL, rec("Mute"), FLUSH)) == {R2}
    assert empty_flush(prompts(FILL, rec(FLUSH))) == {first}  # only because the fill has failed
    assert empty_flush(prompts(par_all(FILL, FLUSH))) == {second}
    assert empty_flush(prompts(par_any(FILL, "Mute"), FLUSH)) == {R1}
    assert empty_flush(prompts(par_any(FILL, FILL), FLUSH)) == set()
    assert empty_flush(prompts(FILL, FLUSH, constraint=Says(R2, "fails"))) == set()
    # Not only runs that complete count.
    assert empty_flush(prompts(FLUSH, "Mute", constraint=Says(R2, "fails"))) == {R1}
    # Under the chain of starts both are active together all the same.
    assert empty_flush(prompts(par_all(FILL, FLUSH), faults=NO_START)) == {second}
    assert empty_flush(prompts(par_all(FLUSH, FILL))) == {first}


def test_what_arrives_makes_a_buffer_unknown() -> None:
    fills, flushes = "Ask uuid=b", "Ask uuid=b flush=true"
    assert unflushed(prompts(FILL, "Send", flushes)) == set()  # it might flush a
    assert unflushed(prompts("Ask", "Send", flushes)) == {R1}  # but not this one
    assert unflushed(prompts(FILL, "Send", fills)) == {R1}
    assert empty_flush(prompts("Send", fills, FLUSH)) == set()
    assert empty_flush(prompts("Send", flushes, FLUSH)) == {R3}
    # With flush unknown the buffer is known: only what has this uuid is not judged.
    assert unflushed(prompts(FILL, "MaySend", fills)) == {R1}
    assert unflushed(prompts(FILL, "MaySend", FILL)) == set()
    assert empty_flush(prompts("MaySend", FILL, FLUSH)) == set()
    assert empty_flush(prompts("MaySend", fills, FLUSH)) == {R3}
    # Anything may arrive from a runner that nobody describes.
    assert unflushed(prompts(FILL, "Unknown", "Ask")) == set()
    assert unflushed(prompts(FILL, "Unknown", "Mute")) == {R1}
    assert empty_flush(prompts("Unknown", FLUSH)) == set()


def test_empty_answer() -> None:
    assert empty_answer(prompts(FILL, "Hear")) == {(R2, "answer")}
    assert empty_answer(prompts(FLUSH, "Hear")) == set()
    assert empty_answer(prompts("Ask flush=true", "Hear")) == set()
    assert empty_answer(prompts(FILL)) == set()
    assert empty_answer(prompts(FILL, "Mute")) == set()  # does not know the name
    assert empty_answer(prompts(FILL, "Unknown")) == set()
    assert empty_answer(prompts(FILL, rec("Hear"))) == set()
    assert empty_answer(prompts(FILL, rec("Mute"), "Hear")) == set()
    assert empty_answer(prompts(FILL, "Hear", constraint=Says(R1, "fails"))) == set()
    assert empty_answer(prompts("MaySend", FILL, "Hear")) == set()
    assert empty_answer(prompts("Send", FILL, "Hear")) == {(R3, "answer")}


@few
@given(data=st.data(), models=faults())
def test_the_words_of_8_3_that_need_no_instants(
    data: st.DataObject, models: frozenset[str]
) -> None:
    """Both questions as the page puts them a second time, with outcomes that are held back."""
    library = data.draw(libraries(prompts=True))
    whole = data.draw(plans_over(library, max_runners=4))
    world = World(whole, library, faults=models)
    behind_unknown = len(prompting(world)) != sum(one.fixed for one in prompting(world))
    if behind_unknown:
        return
    unsent, empty = set(), set()

    def triggered(path: str, held: set[str], run: Run) -> bool:
        """Whether the instance is triggered even if these outcomes are held back."""
        delivered = frozenset(world.system.paths) - held
        return bool(run._after(delivered) & world.instance(path).node.trigger)

    for run in world.runs:
        for one in prompting(world):
            node = world.instance(one.path).node
            if not run.fired & node.succeeded:
                continue
            others = [two for two in prompting(world) if two.may_have(one.uuid)]
            flushes = [two.path for two in others if two.flush]
            done = [p for p in flushes if run.fired & world.instance(p).node.trigger]
            held = {one.path}
            if run.completed and not one.flush and all(triggered(p, held, run) for p in done):
                unsent.add(one.path)
            fills = {
                two.path
                for two in others
                if not two.flush and run.fired & world.instance(two.path).node.succeeded
            }
            if one.flush and one.uuid is not None and triggered(one.path, fills, run):
                empty.add(one.path)
    assert unflushed(world) == unsent
    assert empty_flush(world) == empty


def test_orders_of_effects() -> None:
    world = prompts(par_all(FILL, FLUSH), FILL)
    one, two = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    best = next(run for run in world.runs if set(run.outcomes) == {SUCCEEDED})
    assert effects(best, prompting(world)) == {(one, two, R1), (two, one, R1)}
