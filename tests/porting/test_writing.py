"""How a ported plan is written: tags, labels, comments and layout as they were."""

from __future__ import annotations

import pytest

from gpsfsm.capabilities.library import EMPTY
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.porting import UnclearError, port

A, B, C, D = (f'<Runner name="r" interface="a/{n}" provider="a/{n}" k=\'1\'/>' for n in "ABCD")


def ported(text: str | bytes, engine: str = "fabric-v2") -> str:
    outcome = port(text, engine, capabilities=EMPTY)
    assert outcome.text is not None, outcome.losses
    return outcome.text


def notes(text: str) -> list[str]:
    outcome = port(text, "fabric-v2", capabilities=EMPTY)
    return [f"{note.line}:{note.column} {note.text}" for note in outcome.notes]


def test_comments_labels_and_layout_stay() -> None:
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- before -->
<Plan name="p">
  <!-- the first -->
  {A} <!-- beside -->
  <Control type="recovery" name="one">
    {B}
  </Control>

  <!-- more -->
  <Control type="recovery" name="two">
    <!-- the last -->
    {C}
  </Control>
  <Control type="sequential" name="phase">

    {D}
  </Control>
  <!-- end -->
</Plan>
<!-- after -->
"""
    assert (
        ported(text)
        == f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- before -->
<Plan name="p">
  <!-- the first -->
  {A} <!-- beside -->
  <Control type="recovery" name="one">
    {B}

    <!-- more -->
    <!-- the last -->
    {C}
  </Control>
  <Control type="sequential" name="phase">

    {D}
  </Control>
  <!-- end -->
</Plan>
<!-- after -->
"""
    )
    assert notes(text) == ["11:3 this recovery is merged with the recovery before it"]


def test_one_line_stays_one_line() -> None:
    text = f'<Plan><!-- a --><Control type="parallel_any">{A}</Control><!-- b -->{B}</Plan>'
    behind = f'<Plan>{A}<Control type="parallel_any"><!-- b -->{B}</Control></Plan>'
    assert ported(text) == text  # the engine does it
    assert ported(behind) == f"<Plan>{A}<!-- b -->{B}</Plan>"
    assert notes(behind) == [
        f"1:{behind.find('<Control') + 1} this parallel_any is removed; its content stays"
    ]


def test_tabs_and_carriage_returns() -> None:
    text = (
        f"<Plan>\r\n\t{A}\r\n\t<Control type='parallel_all'>\r\n\t\t{B}\r\n\t</Control>\r\n</Plan>"
    )
    assert ported(text) == f"<Plan>\r\n\t{A}\r\n\t{B}\r\n</Plan>"


def test_what_is_never_run_goes_with_its_comments() -> None:
    text = f"""<Plan>
    <Control type="recovery">
        <!-- nobody comes here -->
        {A}
    </Control>
    <Control type="sequential">
        <!-- later -->
    </Control>
    {B}
</Plan>
"""
    assert ported(text) == f"<Plan>\n    <!-- later -->\n    {B}\n</Plan>\n"
    assert notes(text) == [
        "2:5 this recovery is removed: nothing before it can fail, so it is never triggered",
        "6:5 this sequential is removed: it runs nothing",
    ]


def test_a_recovery_of_what_never_fails() -> None:
    text = f'<Plan>{A}<Control type="sequential"/><Control type="recovery">{B}</Control></Plan>'
    assert ported(text) == f"<Plan>{A}</Plan>"
    assert [note.split(" ", 1)[1] for note in notes(text)] == [
        "this sequential is removed: it runs nothing",
        "this recovery is removed: the step that it guards never fails, so it is never triggered",
    ]


def test_the_content_of_a_runner_is_left_out() -> None:
    text = '<Plan><Runner interface="a/A" provider="a/A" >text</Runner></Plan>'
    assert ported(text) == '<Plan><Runner interface="a/A" provider="a/A"/></Plan>'
    assert [note.split(" ", 1)[1] for note in notes(text)] == [
        "the content of this runner is removed: the engines ignore it"
    ]


def test_a_completion_runner_is_left_out() -> None:
    name = "fabric_capabilities/FabricCompletionRunner"
    text = f'<Plan>{A}<Runner interface="{name}" provider="{name}"/></Plan>'
    assert ported(text) == f"<Plan>{A}</Plan>"
    assert notes(text) == [
        f"1:{text.find('<Runner', 9) + 1} the completion runner is removed: fabric-v2 appends its "
        "own"
    ]


def test_a_completion_runner_that_becomes_the_last_step_stays_a_step() -> None:
    name = "fabric_capabilities/FabricCompletionRunner"
    runner = f'<Runner interface="{name}" provider="{name}"/>'
    text = f'<Plan>{A}<Control type="parallel_any">{runner}</Control></Plan>'
    assert ported(text) == f'<Plan>{A}<Control type="sequential">{runner}</Control></Plan>'


def test_text_around_a_plan_and_wrong_references_are_mended() -> None:
    name = 'interface="a/A" provider="a/A"'
    text = f'Here it is:\n```xml\n<Plan>\n<Runner {name} text="you & me"/>\n</Plan>\n```\nBye.\n'
    assert ported(text) == f'<Plan>\n<Runner {name} text="you &amp; me"/>\n</Plan>\n'


def test_places_are_those_of_the_text_as_given() -> None:
    completion = '<Runner interface="x/CompletionRunner" provider="x/CompletionRunner"/>'
    recoveries = f"<Control type='recovery'>{B}</Control>\n<Control type='recovery'>{C}</Control>"
    text = f"Here it is:\n\n<Plan>\n{A}\n{recoveries}\n{completion}\n</Plan>\n"
    assert notes(text)[1:] == [
        "6:1 this recovery is merged with the recovery before it",
        "7:1 completion runner removed",
    ]


def test_a_line_feed_in_a_value_is_a_blank_as_xml_says() -> None:
    name = 'interface="a/A" provider="a/A"'
    text = f"<Plan><Runner {name} text='you\nand &#10; \"me\"'/></Plan>"
    assert ported(text) == (f"<Plan><Runner {name} text='you and &#10; &quot;me&quot;'/></Plan>")


def test_the_engine_reads_utf_8_only() -> None:
    text = (
        '<?xml version="1.0" encoding="UTF-16"?><Plan><Runner interface="a/Ä" provider="b"/></Plan>'
    )
    outcome = port(text.encode("utf-16"), "fabric-v2", capabilities=EMPTY)
    assert outcome.changed
    assert outcome.text == text.replace(' encoding="UTF-16"', "")


@pytest.mark.parametrize("text", ["<Plan/>", "<Plan></Plan>", "\ufeff<Plan><!-- --></Plan>"])
def test_an_empty_plan_completes_at_once(text: str) -> None:
    outcome = port(text.encode(), "fabric-v2", capabilities=EMPTY)
    assert not outcome.changed
    assert outcome.text == text.removeprefix("\ufeff")


def test_a_text_without_a_clear_plan_is_refused() -> None:
    with pytest.raises(UnclearError, match="so the plan is ambiguous"):
        ported("<Plan><Foo/></Plan>")
    with pytest.raises(UnclearError):
        ported("no plan")


def test_a_behaviour_tree_is_no_plan() -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree><Go/></BehaviorTree></root>'
    with pytest.raises(GpsfsmError, match="behaviour tree"):
        ported(tree)


def test_an_unknown_engine() -> None:
    with pytest.raises(UsageError, match="fabric-v1, fabric-v2"):
        ported("<Plan/>", "paper")
