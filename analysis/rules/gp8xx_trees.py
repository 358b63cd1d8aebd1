"""The rules on behaviour trees (GP8xx): documentation of what their reader reports."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.model.finding import Severity

MOVE_TO = '<Action ID="MoveTo"><input_port name="location"/></Action>'
"""The model of a node that drives somewhere."""
_ACTIONS = '<Action ID="Drive"/><Action ID="Grasp"/><Condition ID="Clear"/>'


def tree(main: str, /, *, model: str = "", **others: str) -> str:
    """A file with the tree Main, which runs, and ``others`` by their ID."""
    named = {"Main": main, **others}
    trees = "".join(
        f'    <BehaviorTree ID="{name}">\n        {body}\n    </BehaviorTree>\n'
        for name, body in named.items()
    )
    models = f"    <TreeNodesModel>\n        {model}\n    </TreeNodesModel>\n" if model else ""
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">\n{trees}{models}</root>\n'


def _of_3(text: str) -> str:
    return text.replace('BTCPP_format="4"', 'BTCPP_format="3"')


RULES = (
    Rule(
        code="GP801",
        name="undefined-subtree",
        severity=Severity.ERROR,
        summary="A SubTree refers to a tree that the file does not contain.",
        why=(
            "BehaviorTree.CPP refuses to load the file. Language models often name a tree and "
            "forget to write it. The behaviour of the missing tree is unknown, so nothing is "
            "decided."
        ),
        fix="add a BehaviorTree with this ID, or correct the ID",
        bad=tree('<SubTree ID="Dock"/>'),
        good=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>"),
    ),
    Rule(
        code="GP802",
        name="missing-main-tree",
        severity=Severity.ERROR,
        summary="No main tree is named, or the named one does not exist.",
        why=(
            "A file may contain several trees. BehaviorTree.CPP runs the one that "
            "main_tree_to_execute names and refuses the file if no tree has that name. If exactly "
            "one tree is not used by others, gpsfsm checks that one anyway."
        ),
        fix="name one of the file's trees in main_tree_to_execute",
        bad=tree("<DriveHome/>").replace('ID="Main"', 'ID="Patrol"'),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP803",
        name="unknown-port",
        severity=Severity.ERROR,
        summary="A node has a port that its model does not declare.",
        why=(
            "BehaviorTree.CPP refuses to load the file. The value of a misspelt port never arrives."
        ),
        fix="use the ports that the TreeNodesModel declares",
        bad=tree('<MoveTo goal="kitchen"/>', model=MOVE_TO),
        good=tree('<MoveTo location="kitchen"/>', model=MOVE_TO),
    ),
    Rule(
        code="GP804",
        name="reserved-name",
        severity=Severity.ERROR,
        summary="A user-defined tree or node has a reserved name.",
        why=(
            "The names of the built-in nodes, and 'root', have a meaning of their own. "
            "BehaviorTree.CPP refuses them or uses the built-in node instead."
        ),
        fix="choose another ID",
        bad=tree("<DriveHome/>").replace("Main", "root"),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP805",
        name="wrong-child-count",
        severity=Severity.ERROR,
        summary="A node has too many or too few children.",
        why=(
            "A tree or a decorator has exactly one child, a control node at least one, and an "
            "action or a condition none. BehaviorTree.CPP refuses to load any other file."
        ),
        fix="wrap several children in one Sequence; remove nodes that lack children",
        bad=tree("<Inverter><DoorOpen/><DoorLocked/></Inverter>"),
        good=tree("<Inverter><Fallback><DoorOpen/><DoorLocked/></Fallback></Inverter>"),
    ),
    Rule(
        code="GP806",
        name="duplicate-tree",
        severity=Severity.ERROR,
        summary="Two trees, or two descriptions of nodes, have the same ID.",
        why=(
            "Only one of them can be meant where the ID is used. The check uses the last of two "
            "trees, as BehaviorTree.CPP does, and the first of two descriptions."
        ),
        fix="give one of the two another ID, or remove it",
        bad=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>").replace(
            "</root>", '<BehaviorTree ID="Dock"><Beep/></BehaviorTree></root>'
        ),
        good=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>"),
    ),
    Rule(
        code="GP807",
        name="missing-id",
        severity=Severity.ERROR,
        summary="A node, a tree or a port that needs a name has none.",
        why=(
            "The ID of <Action/>, <Condition/> and <SubTree/> names the node or the tree. Without "
            "it there is nothing to run."
        ),
        fix="add the ID",
        bad=tree('<Action goal="dock"/>'),
        good=tree('<Action ID="DriveTo" goal="dock"/>'),
    ),
    Rule(
        code="GP808",
        name="tree-format",
        severity=Severity.WARNING,
        summary="The file does not declare the format of its trees.",
        why=(
            "Versions 3 and 4 of BehaviorTree.CPP interpret some nodes and ports differently. "
            "Without BTCPP_format gpsfsm accepts both, and BehaviorTree.CPP 4 prints a warning."
        ),
        fix=('write BTCPP_format="4" (or "3") in <root>'),
        bad=tree("<DriveHome/>").replace(' BTCPP_format="4"', ""),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP809",
        name="recursive-subtree",
        severity=Severity.ERROR,
        summary="A tree contains itself.",
        why=(
            "The tree would be expanded into itself for ever. BehaviorTree.CPP runs out of memory "
            "when it loads such a file, and also when files include each other in a circle."
        ),
        fix="remove the SubTree; to repeat something, use Repeat or RetryUntilSuccessful",
        bad=tree(
            '<SubTree ID="Dock"/>', Dock='<Fallback><DriveToDock/><SubTree ID="Dock"/></Fallback>'
        ),
        good=tree(
            '<SubTree ID="Dock"/>',
            Dock='<RetryUntilSuccessful num_attempts="2"><DriveToDock/></RetryUntilSuccessful>',
        ),
    ),
    Rule(
        code="GP810",
        name="unknown-builtin-port",
        severity=Severity.ERROR,
        summary="A built-in node has a port that does not exist.",
        why=(
            "BehaviorTree.CPP refuses to load the file. Often the port belongs to another version "
            "or to another node."
        ),
        fix="use the ports that the node has",
        bad=tree('<RetryUntilSuccessful attempts="3"><Dock/></RetryUntilSuccessful>'),
        good=tree('<RetryUntilSuccessful num_attempts="3"><Dock/></RetryUntilSuccessful>'),
    ),
    Rule(
        code="GP811",
        name="bad-number",
        severity=Severity.ERROR,
        summary="A number of rounds, successes or failures is missing or invalid.",
        why="BehaviorTree.CPP throws an exception when it ticks such a node.",
        fix="write a valid whole number",
        bad=tree('<Repeat num_cycles="twice"><Sweep/></Repeat>'),
        good=tree('<Repeat num_cycles="2"><Sweep/></Repeat>'),
    ),
    Rule(
        code="GP812",
        name="unknown-node",
        severity=Severity.WARNING,
        summary="A node is neither built in nor in the TreeNodesModel.",
        why=(
            "BehaviorTree.CPP rejects a node that is not registered. A TreeNodesModel in the file "
            "should describe all nodes that are not built in; without one, gpsfsm reports only "
            "nodes of another version and those that look like misspelt built-in nodes."
        ),
        fix="correct the name, or describe the node in the TreeNodesModel",
        bad=tree('<MoveBase location="kitchen"/>', model=MOVE_TO),
        good=tree('<MoveTo location="kitchen"/>', model=MOVE_TO),
    ),
    Rule(
        code="GP813",
        name="inexpressible-node",
        severity=Severity.ERROR,
        summary="A part of the tree is missing, or of a kind that tasks cannot describe.",
        why=(
            "A verdict holds for all runs, so no part of the tree may be missing. gpsfsm has not "
            "decided the tree, either because it includes a file that cannot or may not be read, "
            "or because it is an answer to be graded: tasks apply only to plans, and to trees that "
            "can be expressed as plans. Only a tree that is itself a file can include files, and "
            "only files below its folder."
        ),
        fix="correct the path, check the folder that contains all files, or merge them into one",
        bad=tree("<DriveHome/>").replace("</root>", '<include path="other.xml"/></root>'),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP814",
        name="ignored-element",
        severity=Severity.WARNING,
        summary="An element is in a place where BehaviorTree.CPP does not read it.",
        why=(
            "It has no effect, although its author expected one: a node outside a tree, for "
            "example, never runs."
        ),
        fix="move it to where it belongs, or remove it",
        bad=tree("<DriveHome/>").replace("</root>", "<Beep/></root>"),
        good=tree("<Sequence><DriveHome/><Beep/></Sequence>"),
    ),
    Rule(
        code="GP815",
        name="missing-root",
        severity=Severity.ERROR,
        summary="There is no <root> around the trees.",
        why=(
            "BehaviorTree.CPP reads files whose outermost element is <root>. Language models "
            "leave it out if the prompt does not mention it. The tree is checked anyway."
        ),
        fix=('put <root BTCPP_format="4"> around the trees'),
        bad='<BehaviorTree ID="Main">\n    <DriveHome/>\n</BehaviorTree>\n',
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP816",
        name="approximated-node",
        severity=Severity.INFO,
        summary="The automaton has all runs of the tree or machine, and perhaps others.",
        why=(
            "The next step depends on something that gpsfsm does not know, such as a blackboard "
            "value, a clock, the code of a state or the number of rounds of a long loop. The "
            "automaton allows every choice there. So what is reported as impossible is proved to "
            "be so. What happens in a run without these constructs is proved, too; anything else "
            "that is reported may need values that never occur together, so it is at most a "
            "warning, with the confidence `may`, and leaves the gate undecided."
        ),
        fix=(
            "nothing, unless a reported scenario cannot happen with the actual values; "
            "docs/reliability.md lists the constructs"
        ),
        bad=tree('<Timeout msec="5000"><DriveHome/></Timeout>'),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP817",
        name="node-of-another-version",
        severity=Severity.ERROR,
        summary="A node belongs to another version of BehaviorTree.CPP than the file.",
        why=(
            "Version 4 renamed some nodes and removed others, and it refuses a file that has one "
            "of them. BTCPP_format declares which version a file is for."
        ),
        fix="use the name that the version has, or change BTCPP_format",
        bad=tree("<SequenceStar><Open/><DriveHome/></SequenceStar>"),
        good=tree("<SequenceWithMemory><Open/><DriveHome/></SequenceWithMemory>"),
    ),
    Rule(
        code="GP818",
        name="broken-script",
        severity=Severity.ERROR,
        summary="A script cannot be parsed.",
        why=(
            "BehaviorTree.CPP parses all scripts when it loads a file, both those of Script nodes "
            "and those in attributes such as _skipIf, and refuses the file if one is broken."
        ),
        fix="correct the script at the marked column",
        bad=tree('<Script code="attempts := "/>'),
        good=tree('<Script code="attempts := 0"/>'),
    ),
    Rule(
        code="GP819",
        name="several-reactive-actions",
        severity=Severity.WARNING,
        summary="Several children of a reactive node are actions.",
        why=(
            "At every tick a reactive node starts again at its first child. If an earlier child "
            "has ended and runs again, the later one is halted: the two take turns, and the later "
            "one may never end. A reactive node is meant for conditions followed by one action."
        ),
        fix="put conditions before one child that acts, or use Sequence or Fallback",
        bad=tree("<ReactiveSequence><Drive/><Grasp/></ReactiveSequence>", model=_ACTIONS),
        good=tree("<ReactiveSequence><Clear/><Drive/></ReactiveSequence>", model=_ACTIONS),
    ),
    Rule(
        code="GP820",
        name="unwritten-key",
        severity=Severity.INFO,
        summary="A key of the blackboard is read, but nothing in the file writes it.",
        why=(
            "A port that reads such a key fails when the tree runs, unless the program sets the "
            "key. Typical causes are a misspelt name and a SubTree that does not receive the key. "
            "The rule looks at ports that a model declares as inputs, and at those of built-in "
            "nodes."
        ),
        fix="check the spelling, or pass the key to the SubTree",
        bad=tree(
            '<Drive to="{gaol}"/>',
            model='<Action ID="Drive"><input_port name="to"/></Action>',
        ),
        good=tree(
            '<Sequence><Find goal="{goal}"/><Drive to="{goal}"/></Sequence>',
            model='<Action ID="Find"><output_port name="goal"/></Action>'
            '<Action ID="Drive"><input_port name="to"/></Action>',
        ),
    ),
    Rule(
        code="GP821",
        name="idle-recovery",
        severity=Severity.WARNING,
        summary="The recovery of a RecoveryNode never runs, or nothing is retried after it.",
        why=(
            "Nav2's RecoveryNode runs its second child after the first has failed, and the first "
            "one again after the second has succeeded, up to number_of_retries times. With 0 there "
            "is no recovery, and after a recovery that cannot succeed there is no retry. GP301 "
            "reports a first child that cannot fail."
        ),
        fix="set number_of_retries to at least 1, and let the recovery succeed",
        bad=tree('<RecoveryNode number_of_retries="0"><FollowPath/><ClearCostmap/></RecoveryNode>'),
        good=tree(
            '<RecoveryNode number_of_retries="1"><FollowPath/><ClearCostmap/></RecoveryNode>'
        ),
    ),
    Rule(
        code="GP822",
        name="round-robin-without-rounds",
        severity=Severity.WARNING,
        summary="A RoundRobin is not entered often enough for each child to get its turn.",
        why=(
            "Each time a RoundRobin of Nav2 is entered, it continues after the child that it ran "
            "last, and it ends with the first success. If it is entered only once, it behaves like "
            "a Fallback. As the recovery of a RecoveryNode it is entered number_of_retries times; "
            "children beyond that number run only if others fail. Nothing is wrong if your program "
            "ticks the tree again after it has ended. The rule does not look into SubTrees."
        ),
        fix="raise number_of_retries to the number of children, or use Fallback",
        bad=tree(
            '<RecoveryNode number_of_retries="1"><FollowPath/>'
            "<RoundRobin><ClearCostmap/><Spin/></RoundRobin></RecoveryNode>"
        ),
        good=tree(
            '<RecoveryNode number_of_retries="2"><FollowPath/>'
            "<RoundRobin><ClearCostmap/><Spin/></RoundRobin></RecoveryNode>"
        ),
    ),
    Rule(
        code="GP823",
        name="output-without-key",
        severity=Severity.WARNING,
        summary="An output of a node is not written to a key of the blackboard.",
        why=(
            "BehaviorTree.CPP 4 writes an output only to a key in braces. Without braces, which "
            "version 3 accepted, the write fails, the node usually ignores that, and the value is "
            "lost. The rule looks at ports that a model declares as outputs."
        ),
        fix="put braces around the key",
        bad=tree(
            '<Sequence><Find goal="spot"/><Drive/></Sequence>',
            model='<Action ID="Find"><output_port name="goal"/></Action><Action ID="Drive"/>',
        ),
        good=tree(
            '<Sequence><Find goal="{spot}"/><Drive/></Sequence>',
            model='<Action ID="Find"><output_port name="goal"/></Action><Action ID="Drive"/>',
        ),
    ),
    Rule(
        code="GP824",
        name="ignored-attribute",
        severity=Severity.WARNING,
        summary="An attribute looks like one that every node can have, but is ignored.",
        why=(
            "BehaviorTree.CPP 4 knows _skipIf, _failureIf, _successIf, _while, _onSuccess, "
            "_onFailure, _onHalted and _post, and _autoremap in a SubTree. It silently ignores "
            "every other name that begins with an underscore: a misspelt condition has no effect, "
            "and __shared_blackboard of version 3 shares nothing. The rule does not report names "
            "that tools use, such as _uid."
        ),
        fix="write the name as BehaviorTree.CPP spells it, with its capitals",
        bad=tree('<DriveHome _skipif="battery &lt; 20"/>'),
        good=tree('<DriveHome _skipIf="battery &lt; 20"/>'),
    ),
    Rule(
        code="GP825",
        name="explicit-reactive-child",
        severity=Severity.ERROR,
        summary="A child of a ReactiveSequence is written in the explicit form.",
        why=(
            "From version 4.7.0 on, BehaviorTree.CPP looks up the tag of each child of a "
            "ReactiveSequence among its nodes. Action, Condition, Decorator and Control are none, "
            "so it refuses the file. Deeper nodes, and those in other nodes, may have that form. "
            "Leaves under the full names of runners are not reported: only gpsfsm runs them."
        ),
        fix="write the name of the node as its tag",
        bad=tree('<ReactiveSequence><Condition ID="Clear"/><Drive/></ReactiveSequence>'),
        good=tree("<ReactiveSequence><Clear/><Drive/></ReactiveSequence>"),
    ),
    Rule(
        code="GP826",
        name="duplicate-subtree-name",
        severity=Severity.ERROR,
        summary="Two SubTree nodes of a tree have the same name.",
        why=(
            "The name of a SubTree node is its path in the whole tree. From version 4.8.4 on, "
            "BehaviorTree.CPP refuses a tree in which a path occurs twice."
        ),
        fix="give each SubTree a name of its own, or no name",
        bad=tree(
            '<Sequence><SubTree ID="Dock" name="dock"/><SubTree ID="Dock" name="dock"/></Sequence>',
            Dock="<DriveToDock/>",
        ),
        good=tree(
            '<Sequence><SubTree ID="Dock" name="dock"/><SubTree ID="Dock"/></Sequence>',
            Dock="<DriveToDock/>",
        ),
    ),
    Rule(
        code="GP827",
        name="braces-in-key",
        severity=Severity.WARNING,
        summary="A port of a SubTree in format 3 has the name of a key in braces.",
        why=(
            "In BehaviorTree.CPP 3 a SubTree takes the whole value of a port for the name of a "
            "key, so that {goal} is a key called '{goal}', which nothing else can write. What "
            "reads the port inside the SubTree fails."
        ),
        fix="write the key without braces, or use SubTreePlus",
        bad=_of_3(
            tree(
                '<Sequence><Find goal="{spot}"/><SubTree ID="Go" to="{spot}"/></Sequence>',
                Go='<Drive goal="{to}"/>',
            )
        ),
        good=_of_3(
            tree(
                '<Sequence><Find goal="{spot}"/><SubTree ID="Go" to="spot"/></Sequence>',
                Go='<Drive goal="{to}"/>',
            )
        ),
    ),
)
