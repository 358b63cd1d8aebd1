"""Draw the pictures of README.md and docs/semantics.md with the real compiler.

``python docs/pictures.py`` rewrites them in docs/pictures; with ``--check`` it compares them with
what the compiler makes now. In the picture of README.md findings of the check are marked.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import gpsfsm
from gpsfsm.compile import Compiled, compile_plan
from gpsfsm.model.automaton import NodeKind
from gpsfsm.picture import automaton_to_svg
from gpsfsm.syntax import parse

FOLDER = Path(__file__).parent / "pictures"


@dataclass(frozen=True, slots=True)
class Picture:
    """A plan to draw. ``start_chain`` as the compiler takes it (fault model ``no-start``)."""

    name: str
    plan: str
    start_chain: bool = False
    marked: tuple[str, ...] = ()
    """Rules whose findings are marked."""


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
    Picture(
        "welcome",
        (FOLDER.parent / "examples" / "welcome.xml").read_text(encoding="utf-8"),
        marked=("GP303", "GP402"),
    ),
    Picture("no_start", _plan(_control("parallel_all", U1, U2, U3)), start_chain=True),
)


def svg(picture: Picture) -> str:
    """The picture as SVG."""
    plan = parse(picture.plan, file=f"{picture.name}.xml").plan
    if plan is None:
        raise SystemExit(f"{picture.name}: the plan does not parse")
    compiled = compile_plan(plan, start_chain=picture.start_chain)
    return automaton_to_svg(compiled.automaton, _marks(picture, compiled))


def _marks(picture: Picture, compiled: Compiled) -> dict[int, str]:
    """The rule of each finding that is to be marked, by the runner or join that it speaks of."""
    if not picture.marked:
        return {}
    automaton = compiled.automaton
    drawn = (NodeKind.RUNNER, NodeKind.JOIN)
    nodes = {
        automaton.plan.path(node.origin): node.index
        for node in reversed(automaton.nodes)  # of several joins of a control, the first
        if node.kind in drawn
    }
    findings = gpsfsm.check(picture.plan, select=picture.marked).findings
    return {nodes[each.location.element]: f"{each.rule} {each.name}" for each in findings}


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
