"""What single fixes make of plans, to the letter."""

from __future__ import annotations

from collections import Counter

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import Capabilities, Library
from gpsfsm.checking.selection import Selection
from gpsfsm.fixing import Safety
from gpsfsm.model.capability import (
    Effects,
    Input,
    Interface,
    Parameter,
    PromptBuffer,
    Provider,
    ValueType,
)
from gpsfsm.model.report import Verdict
from tests.fixing.support import fixed, go, say

_PROMPT = "prompt_capabilities/PromptSpeechRunner"
_COMPLETION = "fabric_capabilities/FabricCompletionRunner"
_NOTE = "prompt_capabilities/PromptTextRunner"
_A, _B, _UUID, _FLUSH = 'task="a"', 'text="b"', ' uuid="prompt"', ' flush="true"'


def _runner(name: str, words: str) -> str:
    return f'<Runner interface="{name}" provider="{name}" {words}/>'


def _ask(flush: str = "") -> str:
    """A plan that prompts a model."""
    words = f'task="a" flush="{flush}"' if flush else 'task="a"'
    return f"<Plan>{_runner(_PROMPT, words)}</Plan>"


_PROMPTS = f"<Plan>{_runner(_NOTE, _B)}{_runner(_PROMPT, _A)}</Plan>"
_PROMPTS_SENT = f"<Plan>{_runner(_NOTE, _B + _UUID)}{_runner(_PROMPT, _A + _UUID + _FLUSH)}</Plan>"

_SAFE = {
    "the spelling of what is right stays": (
        "<Plan>\n  <Runner  interface='nav2_capabilities/WaypointRunner'\n"
        "     provider = \"nav2_capabilities/WaypointRunner\" x=1 y='2'  />\n</Plan>",
        "<Plan>\n  <Runner  interface='nav2_capabilities/WaypointRunner'\n"
        '     provider = "nav2_capabilities/WaypointRunner" x="1" y=\'2\'  />\n</Plan>',
    ),
    "quotes inside of single quotes": (
        f"<Plan>{say('a')}</Plan>".replace('text="a"', "text='say \"a & b\"'"),
        f"<Plan>{say('a')}</Plan>".replace('text="a"', "text='say \"a &amp; b\"'"),
    ),
    "a placeholder is text": (
        f"<Plan>{say('Hello, &visitor!')}</Plan>",
        f"<Plan>{say('Hello, &amp;visitor!')}</Plan>",
    ),
    "known characters of HTML": (
        f"<Plan>{say('2&nbsp;m &copy; &lt&bogus;')}</Plan>",
        f"<Plan>{say('2&#160;m &#169; &lt;&amp;bogus;')}</Plan>",
    ),
    "only the plan of an answer": (
        f"I will go.\n\n```xml\n  <!-- hall -->\n  <Plan>\n    {go(1, 2)}\n  </Plan>\n```\nDone.\n",
        f"<!-- hall -->\n<Plan>\n  {go(1, 2)}\n</Plan>\n",
    ),
    "comments outlive the prose around them": (
        "Sure!\n<!-- gpsfsm: ignore GP302: it may -->\nHere:\n<Plan>\n  "
        f"{go(1, 2)}\n</Plan>\nBye.\n<!-- the end -->\n```\n",
        f"<!-- gpsfsm: ignore GP302: it may -->\n<Plan>\n  {go(1, 2)}\n</Plan>\n<!-- the end -->\n",
    ),
    "comments that are spelt wrong, but not one without an end": (
        f"Sure:\n<!-- a -- b -->\nHere:\n<Plan>{go(1, 2)}</Plan>\nBye. <!-- and",
        f"<!-- a - - b -->\n<Plan>{go(1, 2)}</Plan>\n",
    ),
    "comments between prose and a declaration": (
        "<!-- a -->\nSure:\n<?xml version='1.0'?>\n<!-- b -->\n"
        f"<Plan>{go(1, 2)}</Plan>\n<p><!-- c --></p>",
        f"<?xml version='1.0'?>\n<!-- a -->\n<!-- b -->\n<Plan>{go(1, 2)}</Plan>\n<!-- c -->\n",
    ),
    "a comment before the declaration": (
        f"<!-- a -->\n<?xml version='1.0'?>\n<Plan>{go(1, 2)}</Plan>\n",
        f"<!-- a -->\n<Plan>{go(1, 2)}</Plan>\n",
    ),
    "whole lines that end with CR LF": (
        f"<Plan>\r\n  {go(1, 2)}\r\n  {_runner(_COMPLETION, '')}\r\n</Plan>\r\n",
        f"<Plan>\r\n  {go(1, 2)}\r\n</Plan>\r\n",
    ),
    "runners alone": (f"{go(1, 2)}\n{go(3, 4)}\n", f"<Plan>\n{go(1, 2)}\n{go(3, 4)}\n</Plan>\n"),
    "nothing but its own lines": (
        f"<Plan>\n  {go(1, 2)}\n\n  <!-- the end -->\n  {_runner(_COMPLETION, '')}\n</Plan>\n",
        f"<Plan>\n  {go(1, 2)}\n\n  <!-- the end -->\n</Plan>\n",
    ),
    "text that could end a comment": (
        f"<Plan>\n  go -- then --> stop\n  {go(1, 2)}\n</Plan>",
        f"<Plan>\n  <!-- text: go - - then - -> stop -->\n  {go(1, 2)}\n</Plan>",
    ),
    "numbers with signs": (
        f"<Plan>{go(1, 2)}</Plan>".replace('x="1" y="2"', 'goal="(-1.5; +2e1)"'),
        f"<Plan>{go(1, 2)}</Plan>".replace('x="1" y="2"', 'x="-1.5" y="+2e1"'),
    ),
    "Booleans": (
        _ask("True"),
        _ask("true"),
    ),
    "a typographic minus": (
        f"<Plan>{go(1, 2)}</Plan>".replace('"2"', '"\u22122.5"'),
        f"<Plan>{go(1, 2)}</Plan>".replace('"2"', '"-2.5"'),
    ),
    "the provider that there is": (
        '<Plan><Runner interface="nav2_capabilities/WaypointRunner" x="1" y="2"/></Plan>',
        f"<Plan>{go(1, 2)}</Plan>",
    ),
    "two spellings of one name": (
        f"<Plan>{go(1, 2)}</Plan>".replace(
            'provider="nav2_capabilities', 'provider="capabilities2_runner_nav2'
        ),
        f"<Plan>{go(1, 2)}</Plan>",
    ),
}

_UNSAFE = {
    "a goal and its alternative": (
        '<Plan>\n  <Control type="recovery" name="a">\n    <!-- the goal -->\n'
        f"    {go(1, 3)}\n    {go(0, 2)}\n  </Control>\n  {go(0, 0)}\n</Plan>\n",
        f'<Plan>\n  <!-- the goal -->\n  {go(1, 3)}\n  <Control type="recovery" name="a">\n'
        f"    {go(0, 2)}\n  </Control>\n  {go(0, 0)}\n</Plan>\n",
    ),
    "a goal with a recovery of its own": (
        f'<Plan><Control type="recovery">{go(1, 3)}<Control type="recovery">{go(2, 2)}</Control>'
        f"{go(0, 2)}</Control></Plan>",
        f'<Plan>{go(1, 3)}<Control type="recovery">{go(2, 2)}</Control>'
        f'<Control type="recovery">{go(0, 2)}</Control></Plan>',
    ),
    "a goal with lines that are indented less than its first": (
        f'<Plan>\n  <Control type="recovery">\n    {go(1, 3)}\n    <Control type="recovery">\n'
        f"  {go(2, 2)}\n    </Control>\n    {go(0, 2)}\n  </Control>\n</Plan>\n",
        f'<Plan>\n  {go(1, 3)}\n    <Control type="recovery">\n  {go(2, 2)}\n    </Control>\n'
        f'  <Control type="recovery">\n    {go(0, 2)}\n  </Control>\n</Plan>\n',
    ),
    "a recovery before its goal": (
        f'<Plan>\n  <Control type="recovery">\n    {go(0, 2)}\n  </Control>\n  {go(1, 3)}\n</Plan>',
        f'<Plan>\n  {go(1, 3)}\n  <Control type="recovery">\n    {go(0, 2)}\n  </Control>\n</Plan>',
    ),
    "a recovery that is all there is": (
        f'<Plan>\n  <Control type="recovery">\n    {go(0, 2)}\n  </Control>\n</Plan>\n',
        f"<Plan>\n  {go(0, 2)}\n</Plan>\n",
    ),
    "goals side by side, one is enough": (
        f'<Plan>\n  <Control type="parallel_any">\n    {go(1, 3)}\n    {go(0, 2)}\n'
        f"    {go(0, 0)}\n  </Control>\n</Plan>\n",
        f'<Plan>\n  <Control type="sequential">\n    {go(1, 3)}\n    <Control type="recovery">\n'
        f"      {go(0, 2)}\n      {go(0, 0)}\n    </Control>\n  </Control>\n</Plan>\n",
    ),
    "goals side by side, all count": (
        f'<Plan><Control type="parallel_all">{go(1, 3)}{go(0, 2)}</Control></Plan>',
        f'<Plan><Control type="sequential">{go(1, 3)}{go(0, 2)}</Control></Plan>',
    ),
    "an empty control in another": (
        f'<Plan>\n  <Control type="sequential">\n    <Control type="sequential"/>\n  </Control>\n'
        f"  {go(1, 2)}\n</Plan>\n",
        f"<Plan>\n  {go(1, 2)}\n</Plan>\n",
    ),
    "a text that is cut off": (
        f'<Plan>\n  <Control type="sequential">\n    {go(1, 2)}\n    <Runner interface="nav2',
        f'<Plan>\n  <Control type="sequential">\n    {go(1, 2)}\n  </Control>\n</Plan>\n',
    ),
    "a step before the plan": (
        f"Sure:\n{go(0, 0)}\n<Plan>\n  {go(1, 2)}\n</Plan>\n",
        f"<Plan>\n  {go(1, 2)}\n</Plan>\n",
    ),
    "a control that is never closed": (
        f'<Plan>\n  {go(1, 2)}\n  <Control type="recovery">\n    {go(2, 2)}\n  {go(3, 2)}\n</Plan>',
        f'<Plan>\n  {go(1, 2)}\n  <Control type="recovery">\n    {go(2, 2)}\n  </Control>\n'
        f"  {go(3, 2)}\n</Plan>",
    ),
    "a value of several words without its end": (
        f"<Plan>{say('come in')}</Plan>".replace('in"', 'in" voice="alloy').replace('in"', "in"),
        f"<Plan>{say('come in')}</Plan>".replace('in"', 'in" voice="alloy"'),
    ),
    "a prompt that nobody sends": (
        _ask(),
        _ask("true"),
    ),
    "prompts that belong together": (_PROMPTS, _PROMPTS_SENT),
    "a word of behaviour trees": (
        '<Plan><Fallback name="hall"><MoveBase goal="1,3"/><MoveBase goal="0,2"/></Fallback>'
        "</Plan>",
        f'<Plan><Control type="sequential" name="hall">{go(1, 3)}'
        f'<Control type="recovery">{go(0, 2)}</Control></Control></Plan>',
    ),
}


@pytest.mark.parametrize("name", _SAFE)
def test_safe_fix(name: str) -> None:
    damaged, wanted = _SAFE[name]
    result = fixed(damaged)
    assert result.text == wanted
    assert result.applied
    assert {fix.safety for fix in result.applied} == {Safety.SAFE}


@pytest.mark.parametrize("name", _UNSAFE)
def test_unsafe_fix(name: str) -> None:
    damaged, wanted = _UNSAFE[name]
    result = fixed(damaged, unsafe=True)
    assert result.text == wanted
    without = fixed(damaged)
    assert without.text != wanted
    assert all(fix.safety is Safety.SAFE for fix in without.applied)
    assert without.unsafe_left > 0


def _look(name: str, more: str) -> str:
    full = f"perception_capabilities/{name}Runner"
    return f'<Runner interface="{full}" provider="{full}"{more}/>'


_PERSON = ' prompt="Is there a person?"'


def _asking(name: str, more: str = _PERSON, label: str = "", before: str = "") -> str:
    recovery = f'<Control type="recovery"{label}>{go(3, 4)}</Control>'
    return f"<Plan>\n{before}{_look(name, more)}\n{recovery}\n</Plan>\n"


@pytest.mark.parametrize("more", [_PERSON, ' use_device="true"' + _PERSON, _PERSON + ' id="a"'])
def test_a_question_before_a_recovery_is_checked(more: str) -> None:
    result = fixed(_asking("ImageAnalysis", more), unsafe=True, selection=Selection.of(["GP312"]))
    assert result.text == _asking("Check", more.replace(' use_device="true"', ""))
    assert [(fix.rule, fix.safety) for fix in result.applied] == [("GP312", Safety.UNSAFE)]


@pytest.mark.parametrize(
    "text",
    [
        _asking("ImageAnalysis", label=' name="if_person"'),  # it is for yes
        _asking("ImageAnalysis", ' prompt="Is it open or shut?"'),
        _asking("ImageAnalysis", ' prompt="Look. Is it open?"'),
        _asking("ImageAnalysis", before=_look("Transcribe", "")),  # what is heard would be judged
        _asking("ImageAnalysis", before="<Runner interface='a/B' provider='a/B'/>"),
    ],
)
def test_a_question_that_a_check_would_answer_otherwise_is_left(text: str) -> None:
    result = fixed(text, unsafe=True, selection=Selection.of(["GP312"]))
    assert (result.text, result.applied) == (text, ())
    assert [each.rule for each in result.report.findings] == ["GP312"]


def test_an_answer_that_is_read_is_not_lost() -> None:
    block = f'<Control type="sequential">{_look("ImageAnalysis", _PERSON)}{_look("Speech", "")}'
    rest = f'</Control><Control type="recovery" name="if_not">{go(3, 4)}</Control>'
    text = f"<Plan>{block}{rest}</Plan>"
    result = fixed(text, unsafe=True, selection=Selection.of(["GP312"]))
    assert (result.text, len(result.report.findings)) == (text, 1)


def test_what_a_packed_value_hides_is_found_and_fixed_too() -> None:
    packed = go(1, 3).replace('x="1" y="3"', 'position="1, 3"')
    opened = '<Control type="recovery" name="to_1_3">'
    text = f"<Plan>{go(2, 0)}{opened}{packed}{go(0, 2)}</Control></Plan>"
    result = fixed(text, unsafe=True)
    assert [(fix.rule, fix.safety.value) for fix in result.applied] == [
        ("GP111", "safe"),
        ("GP310", "unsafe"),
    ]
    assert result.text == f"<Plan>{go(2, 0)}{go(1, 3)}{opened}{go(0, 2)}</Control></Plan>"


def test_comments_of_another_plan_go_with_it() -> None:
    other = f"<Plan>\n<!-- old -->\n{go(9, 9)}\n</Plan>"
    plan = f"<Plan>\n{go(1, 2)}\n</Plan>\n"
    result = fixed(f"First:\n{other}\n<!-- kept -->\nBetter:\n{plan}", from_response=True)
    assert result.text == f"<!-- kept -->\n{plan}"


def test_what_is_lost_is_named() -> None:
    text = f"<Plan ID='a' timeout='9'>{go(1, 2)}</Plan>"
    result = fixed(text)
    assert result.text == f"<Plan name='a'>{go(1, 2)}</Plan>"
    (fix,) = result.applied
    assert fix.title == "'ID' changed to 'name', ineffective 'timeout' removed"


def test_no_fix_hides_a_failure_behind_a_step_that_only_logs() -> None:
    text = f"<Plan>\n  {go(1, 2)}\n</Plan>\n"
    for selection in (Selection(), Selection.of(["ALL"]), Selection.of(["GP302"])):
        result = fixed(text, unsafe=True, selection=selection)
        assert (result.text, result.applied) == (text, ())


def test_a_second_try_is_removed_only_where_it_is_sure_to_fail() -> None:
    text = f'<Plan>\n  {go(1, 2)}\n  <Control type="recovery">{go(1, 2)}</Control>\n</Plan>\n'
    assert fixed(text, unsafe=True).applied == ()
    result = fixed(text, unsafe=True, analysis=AnalysisOptions(consistent=True))
    assert result.text == f"<Plan>\n  {go(1, 2)}\n</Plan>\n"


def test_units_that_have_to_run_side_by_side_stay_so() -> None:
    """Drive until somebody is heard, then go home: only the drive is in the way of that."""
    name = "perception_capabilities/TranscribeRunner"
    hear = _runner(name, 'audio_request_window="60"')
    text = f'<Plan><Control type="parallel_any">{go(1, 3)}{hear}</Control>{go(0, 0)}</Plan>'
    result = fixed(text, unsafe=True)
    assert "GP501" in {finding.rule for finding in result.report.findings}
    assert result.text == text


def test_what_is_ambiguous_stays() -> None:
    for text in (
        f'<Plan><Control type="parallel">{go(1, 2)}{say("a")}</Control></Plan>',  # any or all
        f"<Plan>{go(1, 2)}</Plan>".replace('y="2"', "speed"),  # a value is missing
        f"<Plan>{say('a')}</Plan>".replace("text=", "words="),  # no parameter is like it
        f"<Plan>{go(1, 2)}<Wait seconds='3'/></Plan>",
    ):
        assert fixed(text, unsafe=True).text == text


@pytest.mark.parametrize(
    ("interface", "unsafe", "mended"),
    [
        ("nav2_cap\u0430bilities/WaypointRunner", False, True),  # a letter of another alphabet
        ("robot_of_ours/WaypointRunner", False, True),
        ("lift_bot/Hoist", False, False),
        ("lift_bot/Hoist", True, True),
        ("lift_bot/SpeechRunner", True, False),  # the provider may be what is wrong
    ],
)
def test_the_interface_of_the_provider_is_written_if_it_is_like_it(
    interface: str, unsafe: bool, mended: bool
) -> None:
    right = 'interface="nav2_capabilities/WaypointRunner"'
    wrong = f'interface="{interface}"'
    text = f"<Plan>{go(1, 2).replace(right, wrong)}</Plan>"
    assert interface in text
    result = fixed(text, unsafe=unsafe)
    assert (right in result.text) is mended
    assert (result.report.verdict is Verdict.ACCEPTED) is mended


PROMPTS = "prompt_capabilities/Prompt"
LOOK = _runner("perception_capabilities/ImageAnalysisRunner", 'prompt="Is there a person?"')
NOTE = _runner(PROMPTS + "TextRunner", 'uuid="person" flush="false"')
ASK = _runner(PROMPTS + "PlanRunner", 'task="If there is a person, go home."')
SET = _runner("fabric_capabilities/FabricSetPlanRunner", "")


def test_what_waits_in_a_buffer_goes_to_the_prompt_whose_answer_is_used() -> None:
    """As robot run 7a had it: the model that plans has to get what the camera saw."""
    result = fixed(f"<Plan>{LOOK}{NOTE}{ASK}{SET}</Plan>", unsafe=True)
    assert result.text.replace(' uuid="person" flush="true"/>', "/>") == (
        f"<Plan>{LOOK}{NOTE}{ASK}{SET}</Plan>"
    )
    (fix,) = result.applied
    assert (fix.rule, fix.also) == ("GP411", ("GP414",))
    assert result.before - len(result.report.findings) == 2


def test_an_edit_that_trades_one_finding_for_another_is_refused() -> None:
    """Flushed, each of the two buffers would be sent too early (GP412) instead of never."""
    other = NOTE.replace('uuid="person"', 'uuid="other" text="Hello."')
    text = f"<Plan>{LOOK}{NOTE}{other}</Plan>"
    result = fixed(text, unsafe=True)
    rules = Counter(finding.rule for finding in result.report.findings)
    assert rules["GP412"] == 0


def test_the_number_of_findings_before_and_after_is_that_of_two_checks() -> None:
    text = f"<Plan>{go(1, 2)}{say('a & b')}</Plan>"
    result = fixed(text)
    assert [fix.title for fix in result.applied] == ["'&' changed to '&amp;' in <Runner>"]
    assert (result.before, len(result.report.findings)) == (2, 1)


def test_prompts_whose_buffer_another_parameter_names_do_not_share_a_new_one() -> None:
    ask = Provider(
        "d/Ask",
        "d/Ask",
        described=True,
        configuration=tuple(
            Parameter(name, ValueType.STRING) for name in ("task", "u", "uuid", "flush")
        ),
        inputs=(Input("uuid", ValueType.STRING, fallback="u"),),
        effects=Effects(PromptBuffer("uuid", "flush")),
    )
    capabilities = Capabilities(Library((Interface("d/Ask"),), (ask,)))
    first, second = (_runner("d/Ask", f'{_A} u="{name}"') for name in "12")
    text = f"<Plan>{first}{second}</Plan>"
    done = fixed(text, unsafe=True, capabilities=capabilities)
    assert 'flush="true"' in done.text
    assert " uuid=" not in done.text
