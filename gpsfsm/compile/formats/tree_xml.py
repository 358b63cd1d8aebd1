"""Behaviour trees of BehaviorTree.CPP 4 in XML, as what other things are converted to."""

from __future__ import annotations

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.nested import write_tree

FORMAT = Format("tree", "trees of BehaviorTree.CPP", lambda _begin, _file: False, None, write_tree)
