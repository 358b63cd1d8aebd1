"""A plan and its scenarios, and assumptions about it with what they mean."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import pytest

from gpsfsm.analysis.assumptions import Formula, parse_assumption
from gpsfsm.errors import AssumptionError
from gpsfsm.model.event import Outcome
from gpsfsm.model.plan import Attribute, ControlType, Element, Kind, Plan, Value

S, F, N, H = Outcome
Scenario = Sequence[Outcome]
Predicate = Callable[[Scenario], bool]
NAV, TALK = "nav2_capabilities/WaypointRunner", "fp_capabilities/SpeechRunner"


def plan_of(*rows: tuple[int, str, int, int, dict[str, Value]], spread: int = 0) -> Plan:
    """A plan from (depth, interface or "", line, column, attributes); "" makes a control.

    ``spread``: the last attribute stands that many lines below the tag's first line.
    """
    rows = ((0, "", 1, 1, {}), *rows)
    parents: list[int] = []
    for place, (depth, *_) in enumerate(rows):
        before = [other for other in range(place) if rows[other][0] == depth - 1]
        parents.append(before[-1] if before else -1)
    elements: list[Element] = []
    for place, (_, interface, line, column, values) in enumerate(rows):
        kind = Kind.RUNNER if interface else Kind.CONTROL if place else Kind.PLAN
        same = [other for other in range(place) if parents[other] == parents[place]]
        texts = {"interface": interface, **values} if interface else values
        elements.append(
            Element(
                index=place,
                kind=kind,
                parent=parents[place],
                ordinal=1 + sum(elements[other].kind is kind for other in same),
                children=tuple(n for n, parent in enumerate(parents) if parent == place),
                attributes=tuple(
                    Attribute(name, str(value).lower() if value is True else str(value), value,
                              line + spread, column)
                    for name, value in texts.items()
                ),
                line=line,
                column=column,
                start=0,
                end=0,
                control_type=ControlType.SEQUENTIAL if kind is Kind.CONTROL else None,
            )
        )  # fmt: skip
    return Plan("plan.xml", tuple(elements))


PLAN = plan_of(
    (1, NAV, 2, 3, {"x": 1.0, "y": 3}),
    (1, "", 3, 3, {"name": "greet the guest"}),
    (2, TALK, 4, 5, {"name": "greet", "loud": True}),
    (2, NAV, 5, 5, {"x": 2, "goal": "dock"}),
    (2, "line", 5, 60, {}),
    (1, "", 6, 3, {}),
)


def bind(text: str, plan: Plan = PLAN) -> Formula:
    return parse_assumption(text).bind(plan).formula


def scenarios(size: int) -> list[tuple[Outcome, ...]]:
    return list(itertools.product(Outcome, repeat=size))


def failed(outcome: Outcome) -> bool:
    return outcome in (F, N)


def refusal(text: str, plan: Plan | None = None) -> AssumptionError:
    if plan is None:
        with pytest.raises(AssumptionError) as caught:
            parse_assumption(text)
    else:
        assumption = parse_assumption(text)
        with pytest.raises(AssumptionError) as caught:
            assumption.bind(plan)
    return caught.value


MEANINGS: list[tuple[str, Predicate]] = [
    ("never fails: SpeechRunner", lambda o: not failed(o[1])),
    ("SpeechRunner never fails", lambda o: not failed(o[1])),
    ("NEVER FAILS SpeechRunner", lambda o: not failed(o[1])),
    ("never fails: WaypointRunner, line 4", lambda o: not any(map(failed, o[:3]))),
    ("always succeeds: WaypointRunner", lambda o: o[0] is S and o[2] is S),
    ("always fails: line 2", lambda o: failed(o[0])),
    ("never succeeds: /Plan/Control[1]", lambda o: S not in o[1:]),
    ("never hangs: *", lambda o: H not in o),
    ("always starts: *Runner", lambda o: N not in o[:3]),
    ("line 2 does not start", lambda o: o[0] is N),
    ("line 2 no-start", lambda o: o[0] is N),
    ("line 2 starts", lambda o: o[0] is not N),
    ("line 2 doesn't fail", lambda o: not failed(o[0])),
    ("line 2 hangs", lambda o: o[0] is H),
    ("line 2 fails implies line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("if line 2 fails then line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("line 2 fails => line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("line 2 fails only if line 4 succeeds", lambda o: not failed(o[0]) or o[1] is S),
    ("line 2 fails iff line 4 fails", lambda o: failed(o[0]) == failed(o[1])),
    ("line 2 fails if and only if line 4 fails", lambda o: failed(o[0]) == failed(o[1])),
    ("line 2 fails xor line 4 fails", lambda o: failed(o[0]) != failed(o[1])),
    ("!line 2 fails & line 4 hangs", lambda o: not failed(o[0]) and o[1] is H),
    (
        "line 2 fails or line 4 fails and line 5:5 fails",
        lambda o: failed(o[0]) or (failed(o[1]) and failed(o[2])),
    ),
    (
        "line 2 fails -> line 4 fails -> line 5:5 fails",
        lambda o: not failed(o[0]) or not failed(o[1]) or failed(o[2]),
    ),
    ("any WaypointRunner fails", lambda o: failed(o[0]) or failed(o[2])),
    ("every WaypointRunner fails", lambda o: failed(o[0]) and failed(o[2])),
    ("no WaypointRunner fails", lambda o: not failed(o[0]) and not failed(o[2])),
    ("all line 5 fail", lambda o: failed(o[2]) and failed(o[3])),
    ("at most one of * fails", lambda o: sum(map(failed, o)) <= 1),
    ("at least 2 * fail", lambda o: sum(map(failed, o)) >= 2),
    ("exactly two of (line 2, line 4, line 5:5) hang", lambda o: o[:3].count(H) == 2),
    ("exactly one of (line 2 fails, not line 4 hangs)", lambda o: failed(o[0]) != (o[1] is not H)),
    ("none of (line 2 fails, line 4 hangs)", lambda o: not failed(o[0]) and o[1] is not H),
    ("same: WaypointRunner", lambda o: o[0] is o[2]),
    ("same: line 2, line 4, line 5:60", lambda o: o[0] is o[1] is o[3]),
    ("if line 4 fails then WaypointRunner agree", lambda o: not failed(o[1]) or o[0] is o[2]),
    ('"line" fails', lambda o: failed(o[3])),
    ("/Plan/Control[1]/Runner[2] fails", lambda o: failed(o[2])),
    ("nav2_*/Way* never fails", lambda o: not failed(o[0]) and not failed(o[2])),
    ('name "greet" fails', lambda o: failed(o[1])),
    ("all named 'greet the guest' fail", lambda o: all(map(failed, o[1:]))),
]  # fmt: skip
