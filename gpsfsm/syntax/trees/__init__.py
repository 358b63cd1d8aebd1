"""Text → behaviour trees: BehaviorTree.CPP XML, versions 3 and 4."""

from __future__ import annotations

from gpsfsm.syntax.trees.frontend import ReadTrees, cut_trees, is_trees, last_root, read_trees

__all__ = ["ReadTrees", "cut_trees", "is_trees", "last_root", "read_trees"]
