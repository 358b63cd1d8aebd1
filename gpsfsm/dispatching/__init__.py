"""Plans in front of a Fabric server: gated, submitted, followed, and explained.

A server of the original stack runs the plan; here it is only watched, with the automaton that the
profile of its engine makes of the plan (docs/engines.md). ``dispatch.py`` does all of it for one
plan, ``gate_node.py`` stands between a server and all who submit plans to it.
"""
