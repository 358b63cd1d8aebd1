"""Project files and comments that would have a plan accepted, or a file written.

The user checks, gates and runs plans in a project of ``tests.hostile_projects``, and

- no file is written that the user has not named,
- no plan that is rejected without all this ends with exit code 0 before somebody says why,
- what decides about runs is the same with and without the file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.campaigns.base import Pair
from tests.hostile_projects import OF_OTHERS, Case, World, cases, played, truth

if TYPE_CHECKING:
    from collections.abc import Iterator


def judge(case: Case) -> Iterator[str]:
    """Who checks, gates and runs is not fooled."""
    with played(case) as world:
        yield from _check(world)
        yield from _runs(world)


def _check(world: World) -> Iterator[str]:
    """Whoever checks a plan that is wrong is not told that it is right, or is told why."""
    case = world.case
    deserved = truth(case.plan, case.comment)
    assert deserved.code >= deserved.plain_code, "a comment made the exit code better"
    arguments = ["--config", str(world.config)] if case.named else []
    ended = world.run("check", "plan.xml", *arguments)
    said = ended.out + ended.errors
    if case.place in OF_OTHERS and not case.named:
        assert ended.code == 2, "a file of others was used"
        assert str(world.config) in said
        assert f"--config {world.config}" in said
        yield "check: the file of others is refused"
        return
    if ended.code == 2:
        assert "gpsfsm: " in said or '"verdict": "undecided"' in said or "GP103" in said, said
        yield "check: cannot be done"
    elif ended.code == 1 or deserved.plain_code == 0:
        yield f"check: {'rejected' if ended.code else 'nothing to reject'}"
    else:
        assert case.name in said, f"nobody says why the exit code is 0:\n{said}"
        assert " hidden by " in said or " excused by " in said or "decided with " in said
        yield "check: let pass, and told by which setting"


def _runs(world: World) -> Iterator[str]:
    """The gate decides as if the file and the comment were not there, and a run as the gate."""
    deserved = truth(world.case.plan, world.case.comment)
    gate = world.run("gate", "plan.xml")
    assert (gate.code, gate.out) == deserved.gate, "the gate was fooled"
    assert gate.code == deserved.plain_gate, "a comment fooled the gate"
    ran = world.run("run", "plan.xml")
    refused = "it is not run" in ran.errors
    assert refused == (gate.code != 0), f"gate and run disagree: {ran.errors}"
    yield f"run: {'refused' if refused else 'done'}, as the gate says"


PAIR = Pair(
    name="settings",
    about="hostile project files and comments: check, gate and run are not fooled",
    cases=cases,
    judge=judge,
    text=str,
    full=3_000,
    batch=10,
    few=4,
    attack=True,
)
