"""The rules on behaviour trees (GP8xx): documentation of what their reader reports."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.model.finding import Severity

MOVE_TO = '<Action ID="MoveTo"><input_port name="location"/></Action>'
"""The model of a node that drives somewhere."""


def tree(main: str, /, *, model: str = "", **others: str) -> str:
    """A file with the tree Main, which runs, and ``others`` by their ID."""
    named = {"Main": main, **others}
    trees = "".join(
        f'    <BehaviorTree ID="{name}">\n        {body}\n    </BehaviorTree>\n'
        for name, body in named.items()
    )
    models = f"    <TreeNodesModel>\n        {model}\n    </TreeNodesModel>\n" if model else ""
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">\n{trees}{models}</root>\n'


RULES = (
    Rule(
        code="GP801",
        name="undefined-subtree",
        severity=Severity.ERROR,
        summary="A SubTree stands for a tree that the file does not have.",
        why=(
            "BehaviorTree.CPP refuses the file when it is loaded, and a language model that "
            "names a tree often forgets to write it. What the tree would do there is not known, "
            "so nothing is decided."
        ),
        fix=("add a BehaviorTree with this ID, or correct the ID"),
        bad=tree('<SubTree ID="Dock"/>'),
        good=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>"),
    ),
    Rule(
        code="GP802",
        name="missing-main-tree",
        severity=Severity.ERROR,
        summary="Nothing says which tree runs, or the tree that is named does not exist.",
        why=(
            "A file may hold several trees. BehaviorTree.CPP runs the one that "
            "main_tree_to_execute names and refuses the file if there is none of that name. If "
            "only one tree is not used by others, it is checked all the same."
        ),
        fix=("name one of the trees of the file in main_tree_to_execute"),
        bad=tree("<DriveHome/>").replace('ID="Main"', 'ID="Patrol"'),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP803",
        name="unknown-port",
        severity=Severity.ERROR,
        summary="A node is given a port that its model does not have.",
        why=(
            "BehaviorTree.CPP refuses the file when it is loaded. A misspelt port is a value "
            "that never arrives."
        ),
        fix=("use the ports that the TreeNodesModel names"),
        bad=tree('<MoveTo goal="kitchen"/>', model=MOVE_TO),
        good=tree('<MoveTo location="kitchen"/>', model=MOVE_TO),
    ),
    Rule(
        code="GP804",
        name="reserved-name",
        severity=Severity.ERROR,
        summary="A tree or a node of one's own has a name that is taken.",
        why=(
            "The names of the built-in nodes, and 'root', have a meaning of their own. "
            "BehaviorTree.CPP refuses them or takes the built-in node instead."
        ),
        fix=("choose another ID"),
        bad=tree("<DriveHome/>").replace("Main", "root"),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP805",
        name="wrong-child-count",
        severity=Severity.ERROR,
        summary="A node has too many or too few children.",
        why=(
            "A tree and a decorator have exactly one child, a control node at least one, an "
            "action or a condition none. BehaviorTree.CPP refuses anything else when the file is "
            "loaded."
        ),
        fix=("put several children into one Sequence; remove nodes without children"),
        bad=tree("<Inverter><DoorOpen/><DoorLocked/></Inverter>"),
        good=tree("<Inverter><Fallback><DoorOpen/><DoorLocked/></Fallback></Inverter>"),
    ),
    Rule(
        code="GP806",
        name="duplicate-tree",
        severity=Severity.ERROR,
        summary="Two trees, or two descriptions of nodes, have the same ID.",
        why=(
            "Only one of them can be meant where the ID is used. The first is taken for the check."
        ),
        fix=("give one of the two another ID, or remove it"),
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
            "<Action/>, <Condition/> and <SubTree/> say with their ID which node or tree they "
            "are. Without it there is nothing to run."
        ),
        fix=("add the ID"),
        bad=tree('<Action goal="dock"/>'),
        good=tree('<Action ID="DriveTo" goal="dock"/>'),
    ),
    Rule(
        code="GP808",
        name="tree-format",
        severity=Severity.WARNING,
        summary="The file does not say which format its trees have.",
        why=(
            "Versions 3 and 4 of BehaviorTree.CPP read some nodes and ports in different ways. "
            "Without BTCPP_format both readings are accepted, and BehaviorTree.CPP 4 warns."
        ),
        fix=('write BTCPP_format="4" (or "3") in <root>'),
        bad=tree("<DriveHome/>").replace(' BTCPP_format="4"', ""),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP809",
        name="recursive-subtree",
        severity=Severity.ERROR,
        summary="A tree holds itself.",
        why=(
            "The tree would be put into itself for ever. BehaviorTree.CPP runs out of memory "
            "when it loads such a file, and also when files include each other in a circle."
        ),
        fix=("take the SubTree out; to do something again, use Repeat or RetryUntilSuccessful"),
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
        summary="A built-in node is given a port that it does not have.",
        why=(
            "BehaviorTree.CPP refuses the file when it is loaded. Often the port is that of "
            "another version, or of another node."
        ),
        fix=("use the ports that the node has"),
        bad=tree('<RetryUntilSuccessful attempts="3"><Dock/></RetryUntilSuccessful>'),
        good=tree('<RetryUntilSuccessful num_attempts="3"><Dock/></RetryUntilSuccessful>'),
    ),
    Rule(
        code="GP811",
        name="bad-number",
        severity=Severity.ERROR,
        summary="A number of rounds, successes or failures is missing, no number, or impossible.",
        why=("BehaviorTree.CPP stops with an exception when it ticks such a node."),
        fix=("write a whole number that fits"),
        bad=tree('<Repeat num_cycles="twice"><Sweep/></Repeat>'),
        good=tree('<Repeat num_cycles="2"><Sweep/></Repeat>'),
    ),
    Rule(
        code="GP812",
        name="unknown-node",
        severity=Severity.WARNING,
        summary="A node is neither built in nor in the TreeNodesModel.",
        why=(
            "BehaviorTree.CPP refuses a node that nobody has registered. Where the file has a "
            "TreeNodesModel, it should describe all nodes that are not built in; without one, "
            "only what looks like a misspelt built-in node is told, and nodes of another version."
        ),
        fix=("correct the name, or describe the node in the TreeNodesModel"),
        bad=tree('<MoveBase location="kitchen"/>', model=MOVE_TO),
        good=tree('<MoveTo location="kitchen"/>', model=MOVE_TO),
    ),
    Rule(
        code="GP813",
        name="inexpressible-node",
        severity=Severity.ERROR,
        summary="A part of the tree is not there, or not what a task can be asked of.",
        why=(
            "A verdict holds for all runs, so nothing may be left out of the tree. gpsfsm has not "
            "decided: the file includes another one that it cannot or may not read; or it is an "
            "answer to be graded, and tasks are about plans and about trees that are like plans. "
            "Only a tree that is a file itself includes files, and only files below its folder."
        ),
        fix=("correct the path, check the folder that holds all files, or put them into one"),
        bad=tree("<DriveHome/>").replace("</root>", '<include path="other.xml"/></root>'),
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP814",
        name="ignored-element",
        severity=Severity.WARNING,
        summary="An element stands where BehaviorTree.CPP does not read it.",
        why=(
            "It has no effect, though whoever wrote it meant something: a node outside of a "
            "tree, for instance, never runs."
        ),
        fix=("move it to where it belongs, or remove it"),
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
            "leave it out where the prompt does not mention it. The tree is checked all the same."
        ),
        fix=('put <root BTCPP_format="4"> around the trees'),
        bad='<BehaviorTree ID="Main">\n    <DriveHome/>\n</BehaviorTree>\n',
        good=tree("<DriveHome/>"),
    ),
    Rule(
        code="GP816",
        name="approximated-node",
        severity=Severity.INFO,
        summary="The automaton has all runs of the tree, and perhaps others.",
        why=(
            "A value on the blackboard, a clock or the number of rounds of a long loop decides "
            "what comes next, and none of them is known. The automaton leaves it open: it has a "
            "choice there. So what is said never to happen is proved, and what is said to be "
            "possible may need values that never occur together."
        ),
        fix=(
            "nothing, unless something that is reported cannot happen with the values that there "
            "are; docs/behaviour-trees.md lists the nodes"
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
            "Version 4 renamed nodes and left others out, and it refuses a file that has one of "
            "them. BTCPP_format says which version a file is for."
        ),
        fix=("use the name that the version has, or change BTCPP_format"),
        bad=tree("<SequenceStar><Open/><DriveHome/></SequenceStar>"),
        good=tree("<SequenceWithMemory><Open/><DriveHome/></SequenceWithMemory>"),
    ),
    Rule(
        code="GP818",
        name="broken-script",
        severity=Severity.ERROR,
        summary="A script cannot be read.",
        why=(
            "BehaviorTree.CPP reads all scripts when it loads a file, those of Script and of "
            "attributes such as _skipIf alike, and refuses the file if one of them is broken."
        ),
        fix=("correct the script where the column points"),
        bad=tree('<Script code="attempts := "/>'),
        good=tree('<Script code="attempts := 0"/>'),
    ),
    Rule(
        code="GP819",
        name="several-reactive-actions",
        severity=Severity.WARNING,
        summary="Several children of a reactive node act.",
        why=(
            "A reactive node ticks its children from the first one at every tick. If an earlier "
            "one has ended and runs again, the later one is halted: the two take turns, and the "
            "later one may never end. A reactive node is for conditions and one action behind them."
        ),
        fix=("put conditions before one child that acts, or use Sequence or Fallback"),
        bad=tree('<ReactiveSequence><Action ID="Drive"/><Action ID="Grasp"/></ReactiveSequence>'),
        good=tree(
            '<ReactiveSequence><Condition ID="Clear"/><Action ID="Drive"/></ReactiveSequence>'
        ),
    ),
    Rule(
        code="GP820",
        name="unwritten-key",
        severity=Severity.INFO,
        summary="A key of the blackboard is read, and nothing in the file writes it.",
        why=(
            "A port that reads such a key fails when the tree runs, unless the program sets the "
            "key. A misspelt name, or a SubTree that hands over too little, looks the same. Ports "
            "count whose models say that they are inputs, and those of built-in nodes."
        ),
        fix=("check the spelling, or hand the key over to the SubTree"),
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
        summary="The recovery of a RecoveryNode never runs, or nothing is tried again after it.",
        why=(
            "Nav2's RecoveryNode runs its second child when the first has failed, and the first "
            "one again when the second has succeeded, number_of_retries times. With 0 there is no "
            "recovery, and one that cannot succeed ends it all. A first child that cannot fail is "
            "GP301."
        ),
        fix=("write how often the recovery may be tried, and let the recovery succeed"),
        bad=tree('<RecoveryNode number_of_retries="0"><FollowPath/><ClearCostmap/></RecoveryNode>'),
        good=tree(
            '<RecoveryNode number_of_retries="1"><FollowPath/><ClearCostmap/></RecoveryNode>'
        ),
    ),
    Rule(
        code="GP822",
        name="round-robin-without-rounds",
        severity=Severity.WARNING,
        summary="A RoundRobin is not entered often enough for each child to have its turn.",
        why=(
            "Nav2's RoundRobin goes on behind the child that it ran last, each time that it is "
            "entered, and ends with the first success. Entered once, it does what a Fallback does. "
            "As the recovery of a RecoveryNode it is entered number_of_retries times, and what "
            "stands behind as many children runs only if others fail. If your program ticks a tree "
            "again that has ended, nothing is wrong. SubTrees are not looked into."
        ),
        fix=("raise number_of_retries to the number of children, or write Fallback"),
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
            "BehaviorTree.CPP 4 writes an output only to a key in braces. Without them, as version "
            "3 took it, writing fails where the node does not look at it, and nobody finds the "
            "value. Ports count whose models say that they are outputs."
        ),
        fix=("put braces around the key"),
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
        summary="An attribute looks like one of those of every node, and is ignored.",
        why=(
            "BehaviorTree.CPP 4 knows _skipIf, _failureIf, _successIf, _while, _onSuccess, "
            "_onFailure, _onHalted and _post, and _autoremap in a SubTree. It passes over every "
            "other name with an underscore without a word: a misspelt condition holds always, and "
            "__shared_blackboard of version 3 shares nothing. Names of tools, such as _uid, are no "
            "finding."
        ),
        fix=("write the name as BehaviorTree.CPP spells it, with its capitals"),
        bad=tree('<DriveHome _skipif="battery &lt; 20"/>'),
        good=tree('<DriveHome _skipIf="battery &lt; 20"/>'),
    ),
)
