"""The scale families: right shapes, well-formed, reproducible, linear."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET  # our own text, so no defence is needed

import pytest
from hypothesis import given
from hypothesis import strategies as st

from corpus import generate

SCRIPT = Path(generate.__file__)


def tree(text: str) -> ET.Element:
    return ET.fromstring(text)  # noqa: S314  (our own text)


def runners(text: str) -> int:
    return text.count("<Runner ")


def types(element: ET.Element) -> list[str]:
    return [child.get("type", child.tag) for child in element]


def action(runner: ET.Element) -> tuple[tuple[str, str], ...]:
    return tuple(sorted(runner.items()))


def height(text: str) -> int:
    """The deepest nesting, from the order of the tags alone: the parser's stack is not ours."""
    depth = deepest = 0
    for line in text.splitlines():
        tag = line.strip()
        if tag.startswith("</"):
            depth -= 1
        elif not tag.endswith("/>"):
            depth += 1
            deepest = max(deepest, depth)
    assert depth == 0
    return deepest


class TestChain:
    def test_each_waypoint_is_followed_by_its_recovery(self) -> None:
        (control,) = tree(generate.chain(3))
        assert control.get("type") == "sequential"
        assert types(control) == ["Runner", "recovery"] * 3
        assert [len(child) for child in control] == [0, 1] * 3

    def test_all_actions_differ(self) -> None:
        (control,) = tree(generate.chain(250))
        waypoints, recoveries = list(control)[::2], list(control)[1::2]
        actions = [action(runner) for runner in waypoints]
        actions += [action(recovery[0]) for recovery in recoveries]
        assert len(set(actions)) == 500

    def test_recoveries_and_only_they_speak(self) -> None:
        (control,) = tree(generate.chain(4))
        speaking = [r for r in control.iter("Runner") if "Speech" in r.get("interface", "")]
        assert speaking == [child[0] for child in control if child.tag == "Control"]

    @given(st.integers(1, 300))
    def test_it_has_two_runners_per_waypoint(self, n: int) -> None:
        assert runners(generate.chain(n)) == 2 * n


class TestFanout:
    @pytest.mark.parametrize(
        ("variant", "inner", "total"),
        [
            ("unsafe", ["Runner"] * 3, 5),
            ("needle", ["Runner", "recovery", "Runner", "recovery", "Runner"], 7),
            ("safe", ["Runner", "recovery"] * 3, 8),
        ],
    )
    def test_variants(self, variant: generate.Variant, inner: list[str], total: int) -> None:
        text = generate.fanout(3, variant)
        (control,) = tree(text)
        assert types(control) == ["Runner", "parallel_all", "Runner"]
        assert types(control[1]) == inner
        assert runners(text) == total

    def test_unsafe_is_the_default(self) -> None:
        assert generate.fanout(4) == generate.fanout(4, "unsafe")

    def test_recoveries_and_only_they_speak(self) -> None:
        root = tree(generate.fanout(5, "needle"))
        speaking = [r for r in root.iter("Runner") if "SpeechRunner" in r.get("interface", "")]
        recovering = [r for c in root.iter("Control") if c.get("type") == "recovery" for r in c]
        assert speaking == recovering
        assert len(speaking) == 4

    def test_unknown_variant(self) -> None:
        with pytest.raises(ValueError, match="unsafe, needle, safe"):
            generate.fanout(3, "sae")  # type: ignore[arg-type]


class TestNested:
    @pytest.mark.parametrize(("depth", "width"), [(0, 5), (1, 1), (1, 10), (2, 3), (5, 4), (9, 2)])
    def test_number_of_runners(self, depth: int, width: int) -> None:
        text = generate.nested(depth, width)
        assert runners(text) == width**depth
        assert len(tree(text)) == 1

    def test_levels_take_turns(self) -> None:
        (sequential,) = tree(generate.nested(5, 2))
        parallel_all = sequential[0]
        guarded = parallel_all[0]
        parallel_any = guarded[0]
        again = parallel_any[0]
        responses = [
            c.get("type") for c in (sequential, parallel_all, guarded, parallel_any, again)
        ]
        assert responses == [
            "sequential",
            "parallel_all",
            "sequential",
            "parallel_any",
            "sequential",
        ]
        assert types(guarded) == ["parallel_any", "recovery"]
        assert types(guarded[1]) == ["parallel_any"]

    def test_a_recovery_holds_the_other_children(self) -> None:
        guarded = tree(generate.nested(3, 4))[0][0][0]
        assert types(guarded) == ["Runner", "recovery"]
        assert types(guarded[1]) == ["Runner"] * 3

    def test_one_child_has_nothing_to_recover_with(self) -> None:
        assert "recovery" not in generate.nested(8, 1)

    def test_depth_beyond_the_interpreters_stack(self) -> None:
        text = generate.nested(20_000, 1)
        assert height(text) == 20_001
        assert len(text) < 3_000_000


class TestRandom:
    @given(st.integers(0, 2**64), st.integers(1, 200))
    def test_exactly_n_runners_and_well_formed(self, seed: int, n: int) -> None:
        text = generate.random(seed, n)
        root = tree(text)
        assert runners(text) == n == len(list(root.iter("Runner")))
        for control in root.iter("Control"):
            assert len(control) > 0
            assert types(control)[0] != "recovery"  # it would guard nothing

    def test_same_seed_same_text(self) -> None:
        assert generate.random(7, 500) == generate.random(7, 500)
        assert generate.random(7, 500) != generate.random(8, 500)

    def test_the_text_is_the_same_on_every_machine(self) -> None:
        digest = hashlib.sha256(generate.random(2026, 1000).encode()).hexdigest()
        assert digest.startswith("36dcd6fb0009d337")

    def test_all_control_types_and_equal_actions_occur(self) -> None:
        root = tree(generate.random(1, 300))
        responses = {control.get("type") for control in root.iter("Control")}
        assert responses == {"sequential", "recovery", "parallel_any", "parallel_all"}
        actions = [action(runner) for runner in root.iter("Runner")]
        assert 30 < len(set(actions)) < len(actions)

    def test_depth_stays_moderate(self) -> None:
        assert all(height(generate.random(seed, 20_000)) < 130 for seed in range(3))


@pytest.mark.parametrize(
    ("family", "small", "large"),
    [
        ("chain", [1_000], [50_000]),
        ("fanout", [2_000], [100_000]),
        ("nested", [3, 13], [4, 18]),  # 2,197 and 104,976
        ("random", [1, 2_000], [1, 100_000]),
    ],
)
def test_text_grows_with_the_number_of_runners(
    family: str, small: list[int], large: list[int]
) -> None:
    texts = [getattr(generate, family)(*size) for size in (small, large)]
    per_runner = [len(text) / runners(text) for text in texts]
    assert runners(texts[1]) >= 100_000
    for before, after in pairwise(per_runner):
        assert after < 1.5 * before


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: generate.chain(0), "n must be between 1"),
        (lambda: generate.chain(generate.MAX_RUNNERS), "n must be between"),
        (lambda: generate.fanout(-1), "not -1"),
        (lambda: generate.nested(-1, 2), "depth must be between 0"),
        (lambda: generate.nested(3, 0), "width must be between 1"),
        (lambda: generate.nested(50, 10), "more than 1,000,000 runners"),
        (lambda: generate.nested(100_000, 1_000_000), "more than 1,000,000 runners"),
        (lambda: generate.random(1, 0), "n must be between 1"),
    ],
)
def test_sizes_out_of_range(call: object, message: str) -> None:
    assert callable(call)
    with pytest.raises(ValueError, match=message):
        call()


class TestCommandLine:
    @pytest.mark.parametrize(
        ("arguments", "expected"),
        [
            (["chain", "3"], generate.chain(3)),
            (["fanout", "3"], generate.fanout(3)),
            (["fanout", "3", "--variant", "needle"], generate.fanout(3, "needle")),
            (["nested", "2", "3"], generate.nested(2, 3)),
            (["random", "5", "20"], generate.random(5, 20)),
        ],
    )
    def test_it_prints_the_plan(
        self, arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert generate.main(arguments) == 0
        assert capsys.readouterr().out == expected

    def test_out_of_range_is_a_message(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert generate.main(["nested", "50", "10"]) == 2
        output = capsys.readouterr()
        assert output.out == ""
        assert output.err.startswith("generate.py: that plan would have more than")

    def test_as_a_script(self) -> None:
        done = subprocess.run(
            [sys.executable, SCRIPT, "chain", "2"], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout, done.stderr) == (0, generate.chain(2), "")

    def test_a_reader_that_stops_early_is_no_error(self) -> None:
        command = [sys.executable, str(SCRIPT), "chain", "20000"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            assert process.stdout.readline() == b"<Plan>\n"
            process.stdout.close()
            assert process.stderr.read() == b""
            assert process.wait(timeout=60) == 0
