"""Scenarios of every kind, stepped and played in the browser, forwards and backwards."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.tasks.load import load_task
from tests.conftest import REPO
from tests.viewing.browser.reports import document_of, expected_states

if TYPE_CHECKING:
    from tests.viewing.browser.conftest import Open
    from tests.viewing.browser.reports import Report, States

GO = '<Runner interface="a/Go" provider="a/Go" x="{}"/>'
SEQUENCE = f"<Plan>\n{GO.format(1)}\n{GO.format(2)}\n</Plan>"
BOTH = (
    f'<Plan>\n<Control type="parallel_all" name="both">\n{GO.format(1)}\n{GO.format(2)}\n'
    f'</Control>\n<Control type="recovery">\n{GO.format(3)}\n</Control>\n{GO.format(4)}\n</Plan>'
)
EITHER = (
    f'<Plan>\n<Control type="parallel_any">\n{GO.format(1)}\n{GO.format(2)}\n</Control>\n</Plan>'
)
TOUR = (REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8")

KINDS = {
    "give-up": (SEQUENCE, "GP302", {}, "GAVE_UP"),
    "hang": (SEQUENCE, "GP306", {"faults": ("hang",)}, "STUCK"),
    "no-start": (EITHER, "GP306", {"faults": ("no-start",)}, "STUCK"),
    "join": (BOTH, "GP303", {}, "COMPLETED"),
    "failures": (EITHER, "GP302", {}, "GAVE_UP"),
    "orphan": (EITHER, "GP311", {}, "COMPLETED"),
    "engine-aborts": ("GP704/fail-two-recoveries.xml", "GP704", {"engine": "fabric-v2"}, "ABORT"),
    "engine-hangs": ("GP707/fail-parallel-all.xml", "GP703", {"engine": "fabric-v2"}, "HANG"),
}


@cache
def document_for(kind: str) -> dict[str, Any]:
    text, _, options, _ = KINDS[kind]
    if text.endswith(".xml"):
        text = (REPO / "corpus" / "rules" / text).read_text(encoding="utf-8")
    analysis = AnalysisOptions(faults=options.get("faults", ()))
    engine = options.get("engine", "paper")
    return document_of(text, options=check_options(analysis, engine=engine))


def walk(report: Report, label: str) -> list[States]:
    """The states at each step, until the end."""
    states = [report.states()]
    for _ in range(200):
        number, of = report.step()
        if number == (of if label == "Step forward" else 0):
            return states
        report.page.get_by_label(label).click()
        states.append(report.states())
    raise AssertionError("the steps have no end")


@pytest.mark.parametrize("kind", KINDS)
def test_steps_show_what_a_brute_force_says(kind: str, report: Open) -> None:
    _, rule, _, ends = KINDS[kind]
    with report(document_for(kind)) as open_report:
        play = open_report.open_play(rule)
        assert play["ends"] == ends
        forwards = walk(open_report, "Step forward")
        backwards = walk(open_report, "Step back")
    assert forwards == backwards[::-1]
    records = play["records"]
    expected = [expected_states(open_report.plan, play, n) for n in range(len(records) + 1)]
    assert forwards[0] == {}
    assert forwards[-1] == expected[-1]
    place = 0
    for shown in forwards:
        place = next(n for n in range(place, len(expected)) if expected[n] == shown)
    # no step leaves out what an instance does: each state of each element is seen
    seen = {each for shown in forwards for each in shown.items()}
    lasting = {each for states in expected for each in states.items() if each[1] != "triggered"}
    assert lasting <= seen


def test_a_join_shows_that_it_waits(report: Open) -> None:
    with report(document_for("failures")) as open_report:
        open_report.open_play("GP302")
        states = walk(open_report, "Step forward")
    either = [shown.get(1, "") for shown in states]  # its two failures are joined
    first = next(n for n, shown in enumerate(states) if "failed" in shown.values())
    waits = [place for place, state in enumerate(either) if state == "waiting"]
    assert waits[0] == first  # for the other one
    assert either[-1] == ""  # it has fired
    assert sorted(states[-1].values()) == ["failed", "failed"]


def test_an_orphan_runs_at_completion_and_is_stopped(report: Open) -> None:
    with report(document_for("orphan")) as open_report:
        open_report.open_play("GP311")
        states = walk(open_report, "Step forward")
    assert states[-1][2] in ("stopped", "succeeded")
    assert any(sorted(shown.values()).count("running") == 1 for shown in states)
    assert "stopped" in states[-1].values()


def test_what_a_hang_leaves_never_runs(report: Open) -> None:
    with report(document_for("hang")) as open_report:
        open_report.open_play("GP306")
        states = walk(open_report, "Step forward")
        assert open_report.text(".play-now") == "the plan is stuck: it waits for ever"
    assert states[-1] == {1: "stopped", 2: "never"}


def test_the_story_goes_with_the_steps(report: Open) -> None:
    with report(document_for("give-up")) as open_report:
        play = open_report.open_play("GP302")
        story = play["story"]
        assert open_report.sentence() == ""
        seen = []
        while open_report.step()[0] < open_report.step()[1]:
            open_report.press(".")
            sentence = open_report.sentence()
            if sentence:
                seen.append(sentence)
        assert seen == story  # none twice: where nothing of the story happens, nothing is marked
        # a click on a sentence goes to where it happens
        open_report.page.locator(".playbar .story-line").first.click()
        assert open_report.sentence() == story[0]
        first = expected_states(open_report.plan, play, play["story_at"][0] + 1)
        assert open_report.states() == first


def test_playing_goes_to_the_end_and_stops(report: Open) -> None:
    with report(document_for("give-up")) as open_report:
        play = open_report.open_play("GP302")
        page = open_report.page
        page.get_by_label("Speed").select_option("40")
        page.get_by_role("button", name="Play", exact=True).click()
        page.wait_for_function(
            "() => { const [at, of] = document.querySelector('.play-place').textContent"
            ".split(' / '); return at === of; }"
        )
        open_report.drawn()
        assert page.get_by_role("button", name="Play", exact=True).count() == 1
        last = expected_states(open_report.plan, play, len(play["records"]))
        assert open_report.states() == last
        # once more: from the start again, and a pause holds it
        page.get_by_label("Speed").select_option("0.5")
        page.get_by_role("button", name="Play", exact=True).click()
        page.get_by_role("button", name="Pause").click()
        held, of = open_report.step()
        assert held < of
        page.wait_for_timeout(200)
        assert open_report.step()[0] == held
        page.get_by_label("Close the player").click()
        open_report.drawn()
        assert not page.locator(".playbar").is_visible()
        assert open_report.states() == {}


def test_space_pauses_what_the_button_of_a_finding_plays(report: Open) -> None:
    playing = "() => globalThis.gpsfsmPage.store.state.playing"
    with report(document_of(TOUR)) as open_report:
        page = open_report.page
        page.locator(".finding", has_text="GP303").locator(".finding-play").first.click()
        page.locator(".play-button[aria-label=Pause]:focus").wait_for()
        assert open_report.step()[1] > 10, "it is not over before it is paused"
        for is_playing in (False, True, False):
            open_report.press(" ")
            assert page.evaluate(playing) is is_playing
            assert page.locator(".playbar").is_visible()


def test_a_row_of_the_timeline_names_its_coordinates(report: Open) -> None:
    text = (REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8")
    with report(document_of(text), size=(1280, 800)) as open_report:
        open_report.open_play("GP303")
        page = open_report.page
        row = page.locator(".timeline-label", has_text="(x=8.0, y=1.5)")
        assert row.locator(".timeline-name").inner_text() == "14: WaypointRunner"
        cut = "(one) => one.scrollWidth > one.clientWidth"
        assert not row.locator(".timeline-detail").evaluate(cut)
        assert row.locator(".timeline-name").evaluate(cut)  # it gives way


def test_what_is_marked_is_what_happens_in_the_step(report: Open) -> None:
    """In a join as well: first the failure, then that the join can no longer succeed."""
    with report(document_for("join")) as open_report:
        play = open_report.open_play("GP303")
        marked = []
        while open_report.step()[0] < open_report.step()[1]:
            open_report.press(".")
            if open_report.sentence():
                marked.append((open_report.text(".play-now"), open_report.sentence()))
                of_finding = open_report.page.locator(".finding.selected .story li.current")
                assert of_finding.all_text_contents() == [open_report.sentence()]
    failure, join, *_, end = marked
    assert failure[0] == failure[1] == play["story"][0]
    assert join[0].startswith("parallel_all")
    assert "fails" in join[0]
    assert "the parallel_all 'both' at line 2 can no longer succeed" in join[1]
    assert end[0] == "the plan completes"
    assert sorted(sentence for _, sentence in marked) == sorted(play["story"])


def test_scrubbing_is_like_stepping(report: Open) -> None:
    with report(document_for("join")) as open_report:
        open_report.open_play("GP303")
        stepped = walk(open_report, "Step forward")
        scrub = open_report.page.get_by_label("Step", exact=True)
        scrubbed = {}
        for number in (3, 0, len(stepped) - 1, 1, 2):
            scrub.fill(str(number))
            scrubbed[number] = open_report.states()
        assert scrubbed == {number: stepped[number] for number in scrubbed}


def test_two_plans_are_played_at_once(report: Open) -> None:
    other = SEQUENCE.replace('x="2"', 'x="3"')
    document = document_of(SEQUENCE, other, diff=True)
    assert document["diff"]["verdict"] == "different"
    with report(document) as open_report:
        page = open_report.page
        assert "the plans differ" in open_report.text(".compare-head")
        assert open_report.texts(".compare-words li") == document["diff"]["words"]
        number, of = open_report.step()
        for _ in range(of - number):
            open_report.press(".")
        ends = [play["ends"] for play in document["diff"]["plays"]]
        shown = open_report.texts(".compare-side-head .end")
        assert [text[2:].upper().replace(" ", "_") for text in shown] == ends
        open_report.press("Home")
        page.get_by_label("To the start").click()
        open_report.drawn()
        nothing = "Nothing has happened yet: step or play."
        assert open_report.texts(".compare-said .play-now") == [nothing, nothing]
        page.locator(".compare-side-head .plan-link").nth(1).click()
        open_report.drawn()
        assert page.locator(".plan-chooser").input_value() == "1"
        assert page.locator(".stage-plan .source").is_visible()


def test_a_comparison_opens_where_the_plans_part(report: Open) -> None:
    first, second = (
        f"<Plan>{walk}<Control type='recovery'>{speech}</Control></Plan>"
        for walk in [
            "".join(f"<Runner interface='n/Go' provider='n/Go' x='{n}'/>" for n in range(5))
        ]
        for speech in (
            "<Runner interface='p/Say' provider='p/Say' text='no'/>",
            "<Runner interface='p/Say' provider='p/Say' text='yes'/>",
        )
    )
    document = document_of(first, second, diff=True)
    with report(document) as open_report:
        current = ".compare-words li.current"
        assert open_report.texts(current) == document["diff"]["words"][-2:]
        assert open_report.text(".compare-foot .play-now") == "Here the plans part."
        place = f"line 1 column {first.index('<Runner', first.index('recovery')) + 1}"
        starts = [f"Say (text={text}) at {place} starts" for text in ("no", "yes")]
        assert open_report.texts(".compare-said .play-now") == starts
        number, of = open_report.step()
        assert 0 < number < of
        open_report.press(",")
        assert open_report.step() == (number - 1, of)
        assert open_report.texts(current) != document["diff"]["words"][-2:]
        open_report.page.get_by_label("To the start").click()
        assert open_report.step() == (0, of)


@pytest.mark.parametrize(
    ("other", "verdict", "words"),
    [(SEQUENCE, "equal", "the plans do the same"), ("no plan", "undecided", "undecided")],
)
def test_two_plans_without_a_difference(other: str, verdict: str, words: str, report: Open) -> None:
    document = document_of(SEQUENCE, other, diff=True)
    assert document["diff"]["verdict"] == verdict
    with report(document) as open_report:
        assert words in open_report.text(".compare-head")
        assert not open_report.page.locator(".playbar").first.is_visible()
        open_report.press(".", ",", "Space")
        drawn = open_report.page.locator(".compare-side .graph, .compare-side .source")
        assert drawn.count() == 2


def test_a_task_shows_its_grade_and_where_the_plan_leaves_it(report: Open) -> None:
    task = load_task(REPO / "docs" / "examples" / "rounds.yaml")
    text = (REPO / "corpus" / "rules" / "GP605" / "fail-no-store.xml").read_text(encoding="utf-8")
    document = document_of(text, options=replace(check_options(), task=task))
    graded = document["plans"][0]["task"]
    assert graded["play"] >= 0
    with report(document) as open_report:
        assert graded["grade"] in open_report.text(".task-head")
        assert graded["words"][0] in open_report.text(".task")
        open_report.page.locator(".task .place").click()
        open_report.drawn()
        assert "GP605" in open_report.text(".finding.selected")
        open_report.page.locator(".task .finding-play").click()
        open_report.page.get_by_label("To the end").click()
        open_report.drawn()
        play = open_report.plan["plays"][graded["play"]]
        assert open_report.sentence() == play["story"][-1]


def test_the_timeline_shows_the_step_and_goes_to_the_one_that_is_clicked(report: Open) -> None:
    with report(document_of(TOUR)) as open_report:
        page = open_report.page
        assert not page.locator(".timeline").is_visible()  # nothing is played
        open_report.open_play("GP303")
        rows = page.locator(".timeline-row")
        assert rows.first.is_visible()
        assert "running from step 1 to step 2, succeeded" in (
            rows.first.get_attribute("aria-label") or ""
        )
        before = page.locator(".timeline-now").bounding_box()
        track = rows.first.locator(".timeline-track").bounding_box()
        assert before is not None
        assert track is not None
        page.mouse.click(track["x"] + track["width"] * 0.6, track["y"] + 10)
        open_report.drawn()
        number, of = open_report.step()
        assert number == round(0.6 * (of + 1))
        after = page.locator(".timeline-now").bounding_box()
        assert after is not None
        assert abs(after["x"] - (track["x"] + track["width"] * number / (of + 1))) < 3
        page.locator(".timeline-rows").focus()
        open_report.press("ArrowRight")
        assert open_report.step()[0] == number + 1
        page.locator(".timeline-label", has_text="ImageAnalysisRunner").first.click()
        open_report.drawn()
        assert page.locator(".tree .row.selected", has_text="ImageAnalysis").count() == 1


def test_every_end_in_the_timeline_has_a_sign_and_a_word(report: Open) -> None:
    with report(document_of(TOUR)) as open_report:
        page = open_report.page
        open_report.open_play("GP303")
        ends = page.locator(".timeline-end")
        signs = [(end.inner_text(), end.get_attribute("title") or "") for end in ends.all()]
        assert {"✓", "✗", "■"} <= {sign for sign, _ in signs}
        assert any(sign == "✗" and words.endswith(", failed") for sign, words in signs)
        assert all(words.endswith("stopped") for sign, words in signs if sign == "■")
        assert "the plan gives up" in open_report.text(".timeline-title")
