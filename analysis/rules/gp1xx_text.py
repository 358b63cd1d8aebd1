"""The rules on the text of a plan (GP1xx): documentation of what the front end reports."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule, control, go, machine, plan, say
from gpsfsm.model.finding import Severity

RULES = (
    Rule(
        code="GP101",
        name="malformed-xml",
        severity=Severity.ERROR,
        summary="The text breaks the rules of XML.",
        why=(
            "An executor reads a plan with an XML parser, which refuses the whole text at the "
            "first error or, worse, guesses. gpsfsm reports all errors of a text at once. Where an "
            'error can be repaired in one place, such as a stray "&", the rest of the check goes '
            "on as if it were; tags that do not match leave open what the plan means, so nothing "
            "more is said about it."
        ),
        fix=(
            'correct the text at the marked place. In attribute values "&" is written "&amp;" and '
            '"<" is written "&lt;"'
        ),
        bad=plan(go(2.0, -0.5), say("Lab & office checked")),
        good=plan(go(2.0, -0.5), say("Lab &amp; office checked")),
    ),
    Rule(
        code="GP102",
        name="unsafe-xml",
        severity=Severity.ERROR,
        summary="The text has a DOCTYPE or defines entities.",
        why=(
            "A DOCTYPE can make an XML parser read files of the robot, open network connections, "
            "or fill the memory by entities that expand to each other. No plan needs one. gpsfsm "
            "never reads or expands it; an executor might."
        ),
        fix="remove the DOCTYPE and everything in it; write the text of an entity where it is used",
        bad='<!DOCTYPE Plan [<!ENTITY dock SYSTEM "file:///etc/hostname">]>\n'
        + plan(go(2.0, -0.5), say("&dock;")),
        good=plan(go(2.0, -0.5), say("dock")),
    ),
    Rule(
        code="GP103",
        name="over-limit",
        severity=Severity.ERROR,
        summary="The text is larger or more deeply nested than gpsfsm reads.",
        why=(
            "Limits keep broken or hostile input from taking all time and memory. They admit a "
            "hundred thousand elements; a text beyond them is rarely a plan. gpsfsm stops reading "
            "there and decides nothing about it."
        ),
        fix=(
            "make the plan smaller, or raise the limit that the message names if the plan is meant "
            "to be like this"
        ),
        bad=plan(control("sequential", go(2.0, -0.5), control("recovery", go(0.0, 0.0)))),
        good=plan(go(2.0, -0.5), control("recovery", go(0.0, 0.0))),
        options=("--max-depth", "3"),
    ),
    Rule(
        code="GP104",
        name="missing-plan",
        severity=Severity.ERROR,
        summary="The text has no `<Plan>` as its outermost element.",
        why=(
            "An executor runs one `<Plan>` element and nothing else. Without it there is nothing "
            "to run: the text is empty, or prose, or written in another plan language."
        ),
        fix=(
            "put the controls and runners into one <Plan>…</Plan>. Check a language model's raw "
            "answer with --from-response"
        ),
        bad=('<mission name="patrol">\n    <goto goal="dock"/>\n</mission>\n'),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP105",
        name="unknown-element",
        severity=Severity.ERROR,
        summary="An element is neither `<Plan>`, `<Control>` nor `<Runner>`.",
        why=(
            "A plan knows three elements only, written exactly so. Language models often mix in "
            "words of behaviour trees, such as `<Sequence>`. No executor knows what they mean, so "
            "nothing more can be said about the plan."
        ),
        fix="write <Control> and <Runner> elements instead; names are case-sensitive",
        bad=plan(
            "<Sequence>", "    " + go(2.0, -0.5), "    " + say("Hall checked."), "</Sequence>"
        ),
        good=plan(control("sequential", go(2.0, -0.5), say("Hall checked."))),
    ),
    Rule(
        code="GP106",
        name="unknown-control-type",
        severity=Severity.ERROR,
        summary="The type of a control is none of the four that exist.",
        why=(
            "The type says how the children run: one after the other, as a recovery, or at the "
            "same time. With another word the plan has no meaning, so nothing more can be said "
            "about it."
        ),
        fix="use sequential, recovery, parallel_any or parallel_all, in small letters",
        bad=plan(control("parallel", go(2.0, -0.5), say("On my way."))),
        good=plan(control("parallel_all", go(2.0, -0.5), say("On my way."))),
    ),
    Rule(
        code="GP107",
        name="missing-attribute",
        severity=Severity.ERROR,
        summary="A runner lacks its interface or provider, or a control its type.",
        why=(
            "A runner without an interface names no capability, and one without a provider names "
            "nobody who could do it; the executor cannot start either. A control without a type "
            "does not say how its children run. An attribute of blanks counts as missing."
        ),
        fix="add the attribute that the message names",
        bad=plan('<Runner interface="nav2_capabilities/WaypointRunner" x="2.0" y="-0.5"/>'),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP108",
        name="stray-text",
        severity=Severity.ERROR,
        summary="Text stands where only elements may be.",
        why=(
            "A plan holds elements and comments, no text of its own. Text around it is what a "
            "language model says before or after its plan, text inside it is often a remark or the "
            "rest of a broken tag. Some executors refuse the plan, others skip the text."
        ),
        fix=(
            "remove the text, or make it a comment: <!-- … -->. Check a language model's raw "
            "answer with --from-response"
        ),
        bad=plan(go(2.0, -0.5), "then announce it:", say("Hall checked.")),
        good=plan(go(2.0, -0.5), "<!-- then announce it: -->", say("Hall checked.")),
    ),
    Rule(
        code="GP109",
        name="empty-control",
        severity=Severity.WARNING,
        summary="A control, or the whole plan, holds nothing.",
        why=(
            "An empty control does nothing and succeeds at once; an empty recovery recovers "
            "nothing. That is hardly what was meant: something was forgotten, or was left over."
        ),
        fix="put runners into it, or remove it",
        bad=plan(go(2.0, -0.5), control("recovery")),
        good=plan(go(2.0, -0.5), control("recovery", go(0.0, 0.0))),
    ),
    Rule(
        code="GP110",
        name="duplicate-attribute",
        severity=Severity.ERROR,
        summary="An element has the same attribute twice.",
        why=(
            "XML forbids it, and an executor that reads the plan nevertheless takes one of the "
            'values: which one, nobody knows. A robot that is sent to x="2.0" x="20.0" may go to '
            "either."
        ),
        fix="keep one of them. The first one is used for the rest of the check",
        bad=plan(go(2.0, -0.5).replace('x="2.0"', 'x="2.0" x="20.0"')),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP111",
        name="packed-coordinates",
        severity=Severity.WARNING,
        summary="One attribute packs two or three numbers.",
        why=(
            'Fabric types each attribute on its own, and goal="2.0,-0.5" is a text, not a '
            "position. A navigation runner looks for x and y and does not find them."
        ),
        fix="write one attribute per number, with the names that the capability expects",
        bad=plan(go(2.0, -0.5).replace('x="2.0" y="-0.5"', 'goal="2.0,-0.5"')),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP112",
        name="foreign-attribute",
        severity=Severity.WARNING,
        summary="An attribute has no effect where it stands.",
        why=(
            "Plans take a name, controls a type and a name; parameters are for runners. What is "
            "written elsewhere is silently ignored, although the author counted on it."
        ),
        fix="move the attribute to the runner that needs it, or remove it",
        bad=plan(control("sequential", go(2.0, -0.5)).replace(">", ' timeout="30">', 1)),
        good=plan(control("sequential", go(2.0, -0.5).replace("/>", ' timeout="30"/>'))),
    ),
    Rule(
        code="GP113",
        name="explicit-completion",
        severity=Severity.INFO,
        summary="The plan names its completion runner as its last element.",
        why=(
            "A plan completes by itself after its last element. Naming the completion runner is "
            "not wrong, but unnecessary, and elsewhere than at the end it would complete the plan "
            "too early. The check leaves it out."
        ),
        fix="remove the completion runner",
        bad=plan(
            go(2.0, -0.5),
            '<Runner interface="fabric_capabilities/FabricCompletionRunner" '
            'provider="fabric_capabilities/FabricCompletionRunner"/>',
        ),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP114",
        name="runner-content",
        severity=Severity.ERROR,
        summary="A runner holds elements or text.",
        why=(
            "A runner is a leaf: what is inside it never runs. Often its tag should have ended "
            'with "/>", so that the following elements stand behind it and not inside. The check '
            "ignores what is inside."
        ),
        fix=(
            'end the tag of the runner with "/>" and move what is inside behind it; write texts as '
            "attributes"
        ),
        bad=plan(go(2.0, -0.5).replace("/>", ">"), "    " + say("Hall checked."), "</Runner>"),
        good=plan(go(2.0, -0.5), say("Hall checked.")),
    ),
    Rule(
        code="GP115",
        name="extracted-plan",
        severity=Severity.INFO,
        summary="The plan was taken out of a language model's answer.",
        why=(
            "With --from-response gpsfsm looks for the last complete plan in a model's raw answer "
            "and leaves out the rest: prose, Markdown fences, what the model thought, earlier "
            "plans, and the prefixes of the lines in a log of ros2 launch. This tells which lines "
            "were taken, so that you can see whether it is the plan that you mean."
        ),
        fix=(
            "nothing, if that is the plan you mean. Ask the model to answer with the plan alone to "
            "avoid it"
        ),
        bad=f"Sure! This plan sends the robot to the hall:\n```xml\n{plan(go(2.0, -0.5))}```\n",
        good=plan(go(2.0, -0.5)),
        options=("--from-response",),
    ),
    Rule(
        code="GP116",
        name="undecodable-text",
        severity=Severity.ERROR,
        summary=(
            "The text is not in the encoding it should be in, or has characters that XML forbids."
        ),
        why=(
            "Bytes that are no text in the declared encoding mean a damaged file, a binary file, "
            "or one saved in another encoding. Control characters such as NUL are forbidden in "
            "XML: parsers refuse them, or end the text there."
        ),
        fix="save the file as UTF-8 and remove control characters",
        bad=plan(go(2.0, -0.5), say("Hall checked.\0")),
        good=plan(go(2.0, -0.5), say("Hall checked.")),
    ),
    Rule(
        code="GP117",
        name="malformed-machine",
        severity=Severity.ERROR,
        summary="A graph, a JSON or a GraphML file is no well-formed machine.",
        why=(
            "A machine can be any graph, but its nodes need kinds, its connections need events "
            "that their sources emit, and no event may cause itself at one instant. What is not "
            "well-formed has no meaning, so nothing is decided about it."
        ),
        fix="correct the node that the message names; docs/machines.md describes the attributes",
        bad=machine("drive SUCCEEDED end", "drive FAILED drive", "end SUCCEEDED drive"),
        good=machine("drive SUCCEEDED end", "drive FAILED drive"),
    ),
    Rule(
        code="GP118",
        name="behaviour-tree-in-plan",
        severity=Severity.ERROR,
        summary="The elements of a behaviour tree stand inside a `<Plan>`.",
        why=(
            "Language models that have seen many behaviour trees write one and put <Plan> around "
            "it. No executor of plans knows its elements, so nothing more can be said about the "
            "plan. One finding names all of them, with an ID of <Plan>, which only trees have."
        ),
        fix=(
            'write <Control type="sequential"> for <Sequence>. For <Fallback> write its first '
            'child, and right after it the others in <Control type="recovery">. Write a <Runner> '
            "for each action. If a tree is what you want, put it into <root>: it is checked then"
        ),
        bad=plan(
            "<Sequence>",
            '    <MoveBase x="2.0" y="-0.5"/>',
            "    <Fallback>",
            '        <MoveBase x="1.0" y="0.5"/>',
            '        <MoveBase x="0.0" y="0.0"/>',
            "    </Fallback>",
            "</Sequence>",
        ),
        good=plan(
            control(
                "sequential",
                go(2.0, -0.5),
                go(1.0, 0.5),
                control("recovery", go(0.0, 0.0)),
            )
        ),
    ),
)
