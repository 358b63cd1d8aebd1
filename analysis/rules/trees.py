"""Builds the example behaviour trees of the rules."""

from __future__ import annotations

__all__ = ["MOVE_TO", "tree"]

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
