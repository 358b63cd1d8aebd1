"""Plans of any size, for tests and measurements: the families chain, fanout, nested and random.

Every family is a function that returns the text of a plan, the same text for the same arguments
on every machine. On the command line::

    python corpus/generate.py chain 100 > plan.xml
    python corpus/generate.py fanout 8 --variant needle
    python corpus/generate.py nested 3 10
    python corpus/generate.py random 7 1000

The text is produced line by line from loops, so time and memory grow linearly with the number of
runner instances and no depth of nesting exhausts the interpreter's stack.
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from random import Random
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

__all__ = ["MAX_RUNNERS", "Variant", "chain", "fanout", "main", "nested", "random"]

Variant: TypeAlias = Literal["unsafe", "needle", "safe"]
"""Which units of a fan-out have a recovery: none, all but the last, or all."""

MAX_RUNNERS = 1_000_000
"""The most runner instances that a generated plan may have, so that a slip of the keyboard ends
in a message instead of a full disk."""

_MAX_NESTING = 100_000
_MAX_RANDOM_DEPTH = 60  # random plans stay far below the nesting that parsers refuse
_MAX_INDENT = 20

_Line: TypeAlias = tuple[int, str]
"""Nesting depth and the text of one line."""

_CONTROL_OPEN = '<Control type="{}">'
_CONTROL_CLOSE = "</Control>"


def chain(n: int) -> str:
    """``n`` waypoints in a row, each with a recovery that says so and lets the plan go on.

    ``n`` counts waypoints: the plan has 2n runners. It completes in some runs and gives up in
    others; two failures are the fewest that make it give up. The recoveries are SpeechRunners,
    and nothing else is: under the assumption ``never fails: SpeechRunner`` it always completes.
    """
    _check("n", n, most=MAX_RUNNERS // 2)
    return _text(_chain(n))


def fanout(n: int, variant: Variant = "unsafe") -> str:
    """Drive somewhere, look with ``n`` cameras at once, drive home: the join is what is asked.

    ``unsafe`` (n + 2 runners): no camera has a recovery. ``needle`` (2n + 1 runners): all but the
    last have one. ``safe`` (2n + 2 runners): all have one. The recoveries are SpeechRunners, and
    nothing else is: under the assumption ``never fails: SpeechRunner`` the join of a safe fan-out
    always fires, the join of a needle can wait for ever because of one unit only.
    """
    _check("n", n, most=MAX_RUNNERS // 2 - 1)
    if variant not in get_args(Variant):
        raise ValueError(f"variant must be one of {', '.join(get_args(Variant))}")
    return _text(_fanout(n, {"unsafe": 0, "needle": n - 1, "safe": n}[variant]))


def nested(depth: int, width: int) -> str:
    """Nest controls ``depth`` levels deep, ``width`` children each: width ** depth runners.

    The levels take turns: sequential, parallel_all, a first child with a recovery that holds the
    others, parallel_any.
    """
    _check("depth", depth, least=0, most=_MAX_NESTING)
    _check("width", width, most=MAX_RUNNERS)
    if width > 1 and (depth > MAX_RUNNERS.bit_length() or width**depth > MAX_RUNNERS):
        raise ValueError(f"that plan would have more than {MAX_RUNNERS:,} runners")
    return _text(_nested(depth, width))


def random(seed: int, n: int) -> str:
    """Nest controls at random; a plan of exactly ``n`` runners, the same for the same seed.

    Some runners are equal actions (same interface, same parameters), so that the option
    ``--consistent`` makes a difference.
    """
    _check("n", n, most=MAX_RUNNERS)
    return _text(_random(Random(seed), n))  # noqa: S311  (a reproducible plan, not a secret)


def _check(name: str, value: int, *, most: int, least: int = 1) -> None:
    if not least <= value <= most:
        raise ValueError(f"{name} must be between {least} and {most:,}, not {value}")


def _text(lines: Iterable[_Line]) -> str:
    body = "".join(f"{'  ' * min(depth, _MAX_INDENT)}{line}\n" for depth, line in lines)
    return f"<Plan>\n{body}</Plan>\n"


def _runner(interface: str, parameters: str) -> str:
    return f'<Runner interface="{interface}" provider="{interface}" {parameters}/>'


def _waypoint(number: int) -> str:
    """Drive to place ``number`` of a grid; different numbers are different places."""
    row, column = divmod(number, 100)
    parameters = f'x="{column / 2}" y="{row / 2}"'
    return _runner("nav2_capabilities/WaypointRunner", parameters)


def _look(number: int) -> str:
    prompt = f"What does camera {number} see?"
    return _runner("perception_capabilities/ImageAnalysisRunner", f'prompt="{prompt}"')


def _say(number: int) -> str:
    return _runner("perception_capabilities/SpeechRunner", f'text="Step {number} needs help."')


def _action(number: int) -> str:
    """One of the three kinds of runner, in turn."""
    kinds = (_waypoint, _look, _say)
    return kinds[number % len(kinds)](number // len(kinds))


def _chain(n: int) -> Iterator[_Line]:
    yield 1, _CONTROL_OPEN.format("sequential")
    for number in range(n):
        yield 2, _waypoint(number)
        yield 2, _CONTROL_OPEN.format("recovery")
        yield 3, _say(number)
        yield 2, _CONTROL_CLOSE
    yield 1, _CONTROL_CLOSE


def _fanout(n: int, recovered: int) -> Iterator[_Line]:
    yield 1, _CONTROL_OPEN.format("sequential")
    yield 2, _waypoint(1)
    yield 2, _CONTROL_OPEN.format("parallel_all")
    for number in range(n):
        yield 3, _look(number)
        if number < recovered:
            yield 3, _CONTROL_OPEN.format("recovery")
            yield 4, _say(number)
            yield 3, _CONTROL_CLOSE
    yield 2, _CONTROL_CLOSE
    yield 2, _waypoint(0)
    yield 1, _CONTROL_CLOSE


def _nested(depth: int, width: int) -> Iterator[_Line]:
    """Work through a stack of lines still to write and (level, indentation) still to expand."""
    levels = ("sequential", "parallel_all", "recovery", "parallel_any")
    number = 0
    stack: list[tuple[int, str | int]] = [(1, 0)]
    while stack:
        indent, item = stack.pop()
        if isinstance(item, str):
            yield indent, item
            continue
        if item == depth:
            yield indent, _action(number)
            number += 1
            continue
        inside: list[tuple[int, str | int]] = [(indent + 1, item + 1)] * width
        kind = levels[item % len(levels)]
        if kind == "recovery":
            kind = "sequential"
            if width > 1:
                inside[1:] = [
                    (indent + 1, _CONTROL_OPEN.format("recovery")),
                    *[(indent + 2, item + 1)] * (width - 1),
                    (indent + 1, _CONTROL_CLOSE),
                ]
        yield indent, _CONTROL_OPEN.format(kind)
        stack.append((indent, _CONTROL_CLOSE))
        stack.extend(reversed(inside))


def _random(rng: Random, n: int) -> Iterator[_Line]:
    """Split the number of runners again and again until single runners are left."""
    stack: list[tuple[int, str | int]] = [(1, n)]
    while stack:
        depth, item = stack.pop()
        if isinstance(item, str):
            yield depth, item
        elif item == 1:
            yield depth, _action(_below(rng, 4 * n if rng.random() < 0.7 else 12))
        elif depth >= _MAX_RANDOM_DEPTH:
            stack.extend([(depth, 1)] * item)
        else:
            kind = ("sequential", "parallel_all", "parallel_any")[_below(rng, 3)]
            yield depth, _CONTROL_OPEN.format(kind)
            stack.append((depth, _CONTROL_CLOSE))
            stack.extend(reversed(_random_children(rng, depth + 1, item)))


def _random_children(rng: Random, depth: int, n: int) -> list[tuple[int, str | int]]:
    """Between 2 and 6 children that hold ``n`` runners together; some guard the one before."""
    children: list[tuple[int, str | int]] = []
    for place, size in enumerate(_parts(rng, n)):
        if place > 0 and rng.random() < 0.3:
            children += [
                (depth, _CONTROL_OPEN.format("recovery")),
                (depth + 1, size),
                (depth, _CONTROL_CLOSE),
            ]
        else:
            children.append((depth, size))
    return children


def _parts(rng: Random, n: int) -> list[int]:
    """``n`` as a sum of 2 to 6 numbers above 0, by cutting it at random places."""
    wanted = 2 + _below(rng, min(5, n - 1))
    cuts = {0, n}
    while len(cuts) < wanted + 1:
        cuts.add(1 + _below(rng, n - 1))
    places = sorted(cuts)
    return [after - before for before, after in pairwise(places)]


def _below(rng: Random, limit: int) -> int:
    """Draw a whole number from 0 to ``limit`` - 1; only ``random()`` is stable across Pythons."""
    return int(rng.random() * limit)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="generate.py", description="Print a plan of one of the scale families."
    )
    families = parser.add_subparsers(dest="family", required=True)
    family = families.add_parser("chain", help="N waypoints, each with a recovery: 2N runners")
    family.add_argument("n", type=int)
    family = families.add_parser("fanout", help="N runners in a parallel_all between two others")
    family.add_argument("n", type=int)
    family.add_argument("--variant", choices=get_args(Variant), default="unsafe")
    family = families.add_parser("nested", help="WIDTH ** DEPTH runners in nested controls")
    family.add_argument("depth", type=int)
    family.add_argument("width", type=int)
    family = families.add_parser("random", help="a random plan of N runners")
    family.add_argument("seed", type=int)
    family.add_argument("n", type=int)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the plan that the arguments ask for; 2 for arguments out of range."""
    chosen = vars(_parser().parse_args(arguments))
    make: dict[str, Callable[..., str]] = {
        "chain": chain,
        "fanout": fanout,
        "nested": nested,
        "random": random,
    }
    try:
        text = make[chosen.pop("family")](**chosen)
    except ValueError as error:
        sys.stderr.write(f"generate.py: {error}\n")
        return 2
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader, `head` for instance, has seen enough
        sys.stderr.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
