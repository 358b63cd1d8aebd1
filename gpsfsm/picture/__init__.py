"""Pictures of automata that need no other program: a layout by structure, and SVG made of it."""

from __future__ import annotations

from gpsfsm.picture.layout import Group, Layout, layout
from gpsfsm.picture.shapes import Box
from gpsfsm.picture.svg import automaton_to_svg

__all__ = ["Box", "Group", "Layout", "automaton_to_svg", "layout"]
