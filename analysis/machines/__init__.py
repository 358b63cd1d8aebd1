"""Deciding machines: configurations, their exploration, and z3's fixed points (semantics, 9)."""
