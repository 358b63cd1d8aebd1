"""Draw the pictures of docs/semantics.md with the real compiler.

``python docs/pictures.py`` rewrites them in docs/pictures; with ``--check`` it compares them with
what the compiler makes now.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from gpsfsm.compile import compile_plan
from gpsfsm.picture import automaton_to_svg
from gpsfsm.syntax import parse

FOLDER = Path(__file__).parent / "pictures"


@dataclass(frozen=True, slots=True)
class Picture:
    """A plan to draw. ``start_chain`` as the compiler takes it (fault model ``no-start``)."""

    name: str
    plan: str
    start_chain: bool = False


def _runner(name: str) -> str:
    return f'<Runner interface="{name}" provider="{name}"/>'


def _control(control_type: str, *children: str) -> str:
    return f'<Control type="{control_type}">\n' + "\n".join(children) + "\n</Control>"


def _plan(*children: str) -> str:
    return "<Plan>\n" + "\n".join(children) + "\n</Plan>\n"


U1, U2, U3, D1, D2 = map(_runner, ("u1", "u2", "u3", "d1", "d2"))

PICTURES = (
    Picture("sequential", _plan(_control("sequential", U1, U2, U3))),
    Picture("guard", _plan(_runner("u"), _control("recovery", D1, D2))),
    Picture("parallel_all", _plan(_control("parallel_all", U1, U2, U3))),
    Picture("parallel_any", _plan(_control("parallel_any", U1, U2, U3))),
    Picture("guarded", _plan(_control("parallel_all", U1, U2), _control("recovery", D1))),
    Picture("no_start", _plan(_control("parallel_all", U1, U2, U3)), start_chain=True),
)


def svg(picture: Picture) -> str:
    """The picture as SVG."""
    plan = parse(picture.plan, file=f"{picture.name}.xml").plan
    if plan is None:
        raise SystemExit(f"{picture.name}: the plan does not parse")
    return automaton_to_svg(compile_plan(plan, start_chain=picture.start_chain).automaton)


def main() -> int:
    """Write or compare all pictures."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("--check", action="store_true", help="only compare them")
    return _check() if arguments.parse_args().check else _write()


def _check() -> int:
    stale = [
        file.name
        for picture in PICTURES
        if not (file := FOLDER / f"{picture.name}.svg").is_file()
        or file.read_text(encoding="utf-8") != svg(picture)
    ]
    if stale:
        print(f"out of date: {', '.join(stale)}; run: python docs/pictures.py")
    return 1 if stale else 0


def _write() -> int:
    FOLDER.mkdir(exist_ok=True)
    for picture in PICTURES:
        (FOLDER / f"{picture.name}.svg").write_text(svg(picture), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
