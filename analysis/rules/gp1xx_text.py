"""The rules on the text of a plan (GP1xx): documentation of what the front end reports."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule, control, go, machine, plan, say
from gpsfsm.model.finding import Severity

_LOOSE = "warning in a behaviour tree that BehaviorTree.CPP loads all the same"

RULES = (
    Rule(
        code="GP101",
        name="malformed-xml",
        severity=Severity.ERROR,
        summary="The text breaks the rules of XML.",
        why=(
            "An executor reads a plan with an XML parser, which rejects the whole text at the "
            "first error or, worse, guesses. gpsfsm reports all errors of a text at once. If an "
            'error can be repaired in one place, such as a stray "&", the check continues as if '
            "it had been; if tags do not match, the meaning of the plan is unclear, so the "
            "check stops there."
        ),
        fix=(
            'correct the text at the marked place. In attribute values, write "&" as "&amp;" and '
            '"<" as "&lt;"'
        ),
        severities=_LOOSE,
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
            "or exhaust the memory with entities that expand to each other. No plan needs one. "
            "gpsfsm never reads or expands it; an executor might."
        ),
        fix="remove the whole DOCTYPE; write the text of an entity where it is used",
        bad='<!DOCTYPE Plan [<!ENTITY dock SYSTEM "file:///etc/hostname">]>\n'
        + plan(go(2.0, -0.5), say("&dock;")),
        good=plan(go(2.0, -0.5), say("dock")),
    ),
    Rule(
        code="GP103",
        name="over-limit",
        severity=Severity.ERROR,
        summary="The text is larger or more deeply nested than gpsfsm accepts.",
        why=(
            "Limits keep broken or hostile input from using up time and memory. They allow a "
            "hundred thousand elements; a text that exceeds them is rarely a plan. gpsfsm stops "
            "reading at the limit and does not decide the plan."
        ),
        fix=(
            "make the plan smaller, or raise the limit that the hint names if the plan is meant to "
            "be like this"
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
            "A plan has only these three elements, spelled exactly like this. Language models "
            "often mix in elements of behaviour trees, such as `<Sequence>`. No executor supports "
            "them, so the plan cannot be checked further."
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
        summary="The type of a control is not one of the four types.",
        why=(
            "The type says how the children run: one after the other, as a recovery, or at the "
            "same time. With any other word the plan has no meaning, so it cannot be checked "
            "further."
        ),
        fix="use sequential, recovery, parallel_any or parallel_all, in lower case",
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
            "no implementation; the executor cannot start either. A control without a type does "
            "not say how its children run. A blank attribute counts as missing."
        ),
        fix="add the attribute that the message names",
        bad=plan('<Runner interface="nav2_capabilities/WaypointRunner" x="2.0" y="-0.5"/>'),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP108",
        name="stray-text",
        severity=Severity.ERROR,
        summary="There is text where only elements are allowed.",
        why=(
            "A plan consists of elements and comments, without text of its own. Text around it is "
            "usually a language model's introduction or closing remark; text inside it is often a "
            "remark or the remainder of a broken tag. Some executors reject the plan, others skip "
            "the text."
        ),
        fix=(
            "remove the text, or make it a comment: <!-- … -->. Check a language model's raw "
            "answer with --from-response"
        ),
        severities=_LOOSE,
        bad=plan(go(2.0, -0.5), "then announce it:", say("Hall checked.")),
        good=plan(go(2.0, -0.5), "<!-- then announce it: -->", say("Hall checked.")),
    ),
    Rule(
        code="GP109",
        name="empty-control",
        severity=Severity.WARNING,
        summary="A control, or the whole plan, is empty.",
        why=(
            "An empty control does nothing and succeeds at once; an empty recovery recovers "
            "nothing. This is rarely intended: something was forgotten or left over."
        ),
        fix="add runners to it, or remove it",
        bad=plan(go(2.0, -0.5), control("recovery")),
        good=plan(go(2.0, -0.5), control("recovery", go(0.0, 0.0))),
    ),
    Rule(
        code="GP110",
        name="duplicate-attribute",
        severity=Severity.ERROR,
        summary="An element has the same attribute twice.",
        why=(
            "XML forbids it, and if an executor reads the plan anyway, it is undefined which "
            'value it uses. A robot that is sent to x="2.0" x="20.0" may go to either.'
        ),
        fix="keep one of them. The rest of the check uses the first one",
        bad=plan(go(2.0, -0.5).replace('x="2.0"', 'x="2.0" x="20.0"')),
        good=plan(go(2.0, -0.5)),
    ),
    Rule(
        code="GP111",
        name="packed-coordinates",
        severity=Severity.WARNING,
        summary="One attribute packs two or three numbers.",
        why=(
            'Fabric types each attribute on its own, and goal="2.0,-0.5" is a string, not a '
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
        summary="An attribute is on an element that does not use it.",
        why=(
            "A plan takes a name, a control a type and a name; parameters belong to runners. "
            "Other attributes are silently ignored, although the author expected an effect."
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
            "A plan completes by itself after its last element. Naming the completion runner there "
            "is not wrong, but unnecessary; anywhere else it would complete the plan too early. "
            "The check ignores it."
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
        summary="A runner contains elements or text.",
        why=(
            "A runner is a leaf: whatever is inside it never runs. Often its tag should have ended "
            'with "/>", so that the following elements come after it and not inside. The check '
            "ignores the content."
        ),
        fix=(
            'end the tag of the runner with "/>" and move its content after it; write texts as '
            "attributes"
        ),
        bad=plan(go(2.0, -0.5).replace("/>", ">"), "    " + say("Hall checked."), "</Runner>"),
        good=plan(go(2.0, -0.5), say("Hall checked.")),
    ),
    Rule(
        code="GP115",
        name="extracted-plan",
        severity=Severity.INFO,
        summary="The plan was extracted from a language model's answer.",
        why=(
            "With --from-response gpsfsm takes the last complete plan from a model's raw answer "
            "and leaves out the rest: prose, Markdown fences, the model's reasoning, earlier "
            "plans, and the line prefixes in a log of ros2 launch. The finding shows which lines "
            "were taken, so that you can check that it is the plan you mean."
        ),
        fix=(
            "nothing if that is the plan you mean. To avoid the finding, ask the model to answer "
            "with the plan alone"
        ),
        bad=f"Sure! This plan sends the robot to the hall:\n```xml\n{plan(go(2.0, -0.5))}```\n",
        good=plan(go(2.0, -0.5)),
        options=("--from-response",),
    ),
    Rule(
        code="GP116",
        name="undecodable-text",
        severity=Severity.ERROR,
        summary="The text does not match its encoding, or contains characters that XML forbids.",
        why=(
            "Bytes that are invalid in the declared encoding mean a damaged file, a binary file, "
            "or a file saved in another encoding. Control characters such as NUL are forbidden in "
            "XML: parsers reject them, or end the text there."
        ),
        fix="save the file as UTF-8 and remove control characters",
        bad=plan(go(2.0, -0.5), say("Hall checked.\0")),
        good=plan(go(2.0, -0.5), say("Hall checked.")),
    ),
    Rule(
        code="GP117",
        name="malformed-machine",
        severity=Severity.ERROR,
        summary="A graph in JSON or GraphML is not a well-formed machine.",
        why=(
            "A machine can be any graph, but each node needs a kind, each connection needs an "
            "event that its source emits, and no event may cause itself at the same instant. A "
            "graph that is not well-formed has no meaning, so it is not decided."
        ),
        fix="correct the node that the message names; docs/machines.md describes the attributes",
        bad=machine("drive SUCCEEDED end", "drive FAILED drive", "end SUCCEEDED drive"),
        good=machine("drive SUCCEEDED end", "drive FAILED drive"),
    ),
    Rule(
        code="GP118",
        name="behaviour-tree-in-plan",
        severity=Severity.ERROR,
        summary="A `<Plan>` contains elements of a behaviour tree.",
        why=(
            "Language models that have seen many behaviour trees write one and put <Plan> around "
            "it. No plan executor supports these elements, so the plan cannot be checked further. "
            "One finding lists all of them, including an ID on <Plan>, which only trees have."
        ),
        fix=(
            'replace <Sequence> with <Control type="sequential">, <Fallback> with its first child '
            'followed by the others in <Control type="recovery">, and each action with a <Runner>. '
            "If you want a tree, put it into <root> to have it checked as one"
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
    Rule(
        code="GP119",
        name="construct-not-read",
        severity=Severity.INFO,
        summary="Something in the file was skipped, or a value that the file lacks was assumed.",
        why=(
            "gpsfsm has no use for these constructs: they belong to another tool, or do not affect "
            "what runs when. The verdict says nothing about them. If one of them was meant to have "
            "an effect, such as an attribute with a misspelt name, it has none."
        ),
        fix="nothing, unless one of them was meant to have an effect: correct its name then",
        bad=machine("drive SUCCEEDED end").replace('"kind": "start"', '"kind": "start", "hue": 3'),
        good=machine("drive SUCCEEDED end"),
        spread=True,
    ),
)
