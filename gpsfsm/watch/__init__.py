"""Watching runs: lines, a live tree, tables and timelines (docs/cli.md).

Everything here reads what a run has recorded and changes nothing. All texts from plans and runners
are made printable.
"""
