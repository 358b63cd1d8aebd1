"""What do failures and Parallel change in the verdict on a mission, and what does it cost?

A mission in an orchard is a behaviour tree whose leaves name an action, and its demands are
formulas of a task file. ``gpsfsm check --task`` decides them; and so does SPIN, through gcc, on
four models of the tree: with and without failures of actions, with and without Parallel. The model
without both is a translation of the kind that mission planners with SPIN have used
(``benchmarks/other_tools/promela_tree.py``); it is not the translation of any of them.

The benchmark ends with an error if gpsfsm and SPIN disagree where the model says all that the tree
says, or where gpsfsm is told to assume that no action fails.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET  # our own text, so no defence is needed

from benchmarks.common import GPSFSM, ROOT, Measured, circumstances, median, run, seconds, table
from benchmarks.other_tools.promela_tree import model_of
from benchmarks.other_tools.tools import read_pan_formula, versions

TREE, TASK = (ROOT / "docs" / "examples" / f"orchard.{suffix}" for suffix in ("xml", "yaml"))
"""The mission with one row, as ``mission(1)`` and ``task(1)`` write it."""
ACTIONS = ("MoveToPosition", "TakePicture", "MeasureSoil", "OpenValve", "SendMessage")
NO_FAILURE = f"never fails: {', '.join(ACTIONS)}"
TIMES = 3
TIMEOUT_S = 120.0
KINDS = {
    "neither": (False, False),
    "Parallel": (False, True),
    "failures": (True, False),
    "both": (True, True),
}
"""The models: with failures of actions, with Parallel."""
DEMANDS = {
    "home": ("the robot drives to the row, and then home", "F (start(to_row_{n}) & F start(home))"),
    "once": (
        "the row is watered or reported, never both",
        "!(F start(water_{n}) & F start(report_{n}))",
    ),
    "picture": (
        "the picture is taken before the probe is in the soil",
        "!start(soil_{n}) W succeeds(picture_{n})",
    ),
    "soil": (
        "no water before the soil was measured",
        "!start(water_{n}) W succeeds(soil_{n})",
    ),
    "row": (
        "no picture before the robot drives to the row",
        "!start(picture_{n}) W start(to_row_{n})",
    ),
}


def mission(rows: int) -> str:
    """The tree: in each row a picture and a measurement at once, and then water or a report."""
    lines = [
        '<root BTCPP_format="4" schema_location="schemas/orchard.xsd">',
        "  <Mission>In each row, take a picture and measure the soil at once. Water the row if it "
        "is dry, else report it. Come home.</Mission>",
        '  <BehaviorTree ID="Orchard">',
        "    <Sequence>",
    ]
    for row in range(1, rows + 1):
        lines += [
            f'      <MoveToPosition name="to_row_{row}" action_name="drive" row="{row}"/>',
            '      <Parallel success_count="-1" failure_count="1">',
            f'        <TakePicture name="picture_{row}" action_name="camera" row="{row}"/>',
            f'        <MeasureSoil name="soil_{row}" action_name="probe" row="{row}" '
            f'moisture="{{moisture_{row}}}"/>',
            "      </Parallel>",
            "      <Fallback>",
            "        <Sequence>",
            f'          <IsBelow value="{{moisture_{row}}}" limit="0.2"/>',
            f'          <OpenValve name="water_{row}" action_name="valve" row="{row}"/>',
            "        </Sequence>",
            f'        <SendMessage name="report_{row}" action_name="radio" row="{row}"/>',
            "      </Fallback>",
        ]
    return "\n".join(
        [
            *lines,
            '      <MoveToPosition name="home" action_name="drive" row="0"/>',
            "    </Sequence>",
            "  </BehaviorTree>",
            "</root>",
            "",
        ]
    )


def demands(rows: int) -> dict[str, str]:
    """The formulas, about the last row."""
    return {key: formula.format(n=rows) for key, (_, formula) in DEMANDS.items()}


def task(rows: int) -> str:
    """The task file. A label is no parameter, so the row is what tells the actions apart."""
    words = ("to_row", "picture", "soil", "water", "report")
    lines = [
        "task: >",
        "  In each row, take a picture and measure the soil at once. Water the row if it is dry,",
        "  else report it. Come home.",
        "",
        "actions:",
        *(
            f"  {word}_{rows}: {{interface: {interface}, row: {rows}}}"
            for word, interface in zip(words, ACTIONS, strict=True)
        ),
        "  home: {interface: MoveToPosition, row: 0}",
        "",
        "others: allowed",
        "",
        "rules:",
    ]
    for key, formula in demands(rows).items():
        lines += [f"  - name: {DEMANDS[key][0]}", f'    ltlf: "{formula}"']
    return "\n".join([*lines, ""])


@dataclass(frozen=True, slots=True)
class Outcome:
    """Which demands hold, and the seconds of each part of the work."""

    holds: Mapping[str, bool]
    parts: Mapping[str, float]

    @property
    def seconds(self) -> float:
        """The time of the whole."""
        return sum(self.parts.values())


def by_gpsfsm(tree: Path, task_file: Path, *, failures: bool = True) -> Outcome:
    """The whole command, which decides all that it always decides as well."""
    options = [] if failures else ["--assume", NO_FAILURE]
    command = [*GPSFSM, "check", tree, "--task", task_file, "--format", "json", *options]
    done = run([str(word) for word in command], timeout_s=TIMEOUT_S, cwd=tree.parent)
    _finished(done, "gpsfsm", codes=(0, 1))
    (plan,) = json.loads(done.out)["plans"]
    if plan["verdict"] not in ("accepted", "rejected"):
        raise SystemExit(f"gpsfsm: {plan['verdict']}")
    errors = [each for each in plan["findings"] if each["severity"] == "error"]
    # Another error would hide what is broken: then the table would say that all is well.
    if any(error["rule"] != "GP608" for error in errors):
        raise SystemExit(f"gpsfsm: other errors: {sorted({error['rule'] for error in errors})}")
    broken = [error["message"] for error in errors]
    holds = {
        key: not any(f"'{name}'" in message for message in broken)
        for key, (name, _) in DEMANDS.items()
    }
    if list(holds.values()).count(False) != len(broken):
        raise SystemExit("gpsfsm: a broken rule that is none of the demands")
    return Outcome(holds, {"gpsfsm": done.seconds})


def by_spin(text: str, folder: Path, rows: int) -> Outcome:
    """One verifier for all demands, and one search of it for each.

    What SPIN sets aside for its search is made to measure: more would take longer to set aside
    than the search takes. Too little is an abort, which is no verdict.
    """
    (folder / "model.pml").write_text(text, encoding="utf-8")
    parts: dict[str, float] = {}
    # Searches are short, and so the program is not optimised: that would take longer.
    compile_ = ["gcc", "-O0", "-w", f"-DVECTORSZ={2_048 + 64 * rows}", "-o", "pan", "pan.c"]
    for command in (["spin", "-a", "model.pml"], compile_):
        done = run(command, timeout_s=TIMEOUT_S, cwd=folder)
        _finished(done, command[0], codes=(0,))
        parts[command[0]] = done.seconds
    holds: dict[str, bool] = {}
    parts["pan"] = 0.0
    for key in DEMANDS:
        done = run(
            ["./pan", "-a", f"-m{2_000 + 500 * rows}", "-w20", "-N", key],
            timeout_s=TIMEOUT_S,
            cwd=folder,
        )
        _finished(done, "pan", codes=(0,))
        broken, why = read_pan_formula(done.out + done.err)
        if broken is None:
            raise SystemExit(f"pan: {why}")
        holds[key] = not broken
        parts["pan"] += done.seconds
    return Outcome(holds, parts)


def _finished(done: Measured, name: str, *, codes: tuple[int, ...]) -> None:
    if done.timed_out:
        raise SystemExit(f"{name}: over {TIMEOUT_S:.0f} s")
    if done.code not in codes:
        raise SystemExit(f"{name}: exit {done.code}\n{done.out}{done.err}")


def models(rows: int) -> dict[str, str]:
    """The four models of a mission."""
    root = ET.fromstring(mission(rows)).find("BehaviorTree")  # noqa: S314
    assert root is not None
    return {
        kind: model_of(root, demands(rows), failures=failures, parallel=parallel)
        for kind, (failures, parallel) in KINDS.items()
    }


def agree(name: str, ours: Outcome, spin: Outcome) -> None:
    """Refuse to print a table in which two judges of the same question differ."""
    if ours.holds != spin.holds:
        raise SystemExit(f"gpsfsm and SPIN disagree, {name}:\n{ours.holds}\n{spin.holds}")


def verdicts(rows: int, folder: Path) -> tuple[dict[str, Outcome], Outcome]:
    """What SPIN says of each model, and gpsfsm of the tree; where they must agree, they do."""
    tree, task_file = folder / "orchard.xml", folder / "orchard.yaml"
    tree.write_text(mission(rows), encoding="utf-8")
    task_file.write_text(task(rows), encoding="utf-8")
    spin = {kind: by_spin(text, folder, rows) for kind, text in models(rows).items()}
    ours = by_gpsfsm(tree, task_file)
    agree("everything may fail", ours, spin["both"])
    agree("no action fails", by_gpsfsm(tree, task_file, failures=False), spin["Parallel"])
    return spin, ours


def typical(outcomes: list[Outcome]) -> dict[str, float]:
    """The median of each part, and of the whole."""
    parts = {name: median(each.parts[name] for each in outcomes) for name in outcomes[0].parts}
    return {**parts, "all": median(each.seconds for each in outcomes)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, nargs="+", default=[1, 5, 20, 50])
    sizes = parser.parse_args().rows
    spin_version = versions().get("spin")
    if spin_version is None or not shutil.which("gcc"):
        raise SystemExit("this needs SPIN (the Debian package spin) and gcc")
    where = circumstances()
    said = {True: "holds", False: "broken"}
    first: list[list[str]] = []
    times: list[list[str]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for rows in sizes:
            several = [verdicts(rows, folder) for _ in range(TIMES)]
            spin, ours = several[0]
            if not first:
                for key, (words, _) in DEMANDS.items():
                    answers = [said[outcome.holds[key]] for outcome in spin.values()]
                    first.append([words, *answers, said[ours.holds[key]]])
            mine = typical([each for _, each in several])["all"]
            times.append([f"{rows}", "gpsfsm", "", "", "", seconds(mine), ""])
            for kind in ("neither", "both"):
                took = typical([each[kind] for each, _ in several])
                parts = [seconds(took[part]) for part in ("spin", "gcc", "pan")]
                ratio = f"{took['all'] / mine:.1f}x"
                model = "SPIN, " + ("of that kind" if kind == "neither" else "with both")
                times.append([f"{rows}", model, *parts, seconds(took["all"]), ratio])
            print(*times[-3:], sep="\n", file=sys.stderr, flush=True)
    print(f"{where}\nSPIN {spin_version}; medians of {TIMES}.\n")
    head = ["demand", "of that kind", "with Parallel", "with failures", "with both", "gpsfsm"]
    print(re.sub("---:", "---", table(head, first)))
    print()
    print(table(["rows", "", "spin, s", "gcc, s", "pan, s", "all, s", "against gpsfsm"], times))
    return 0


if __name__ == "__main__":
    sys.exit(main())
