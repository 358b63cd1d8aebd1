"""Worlds, and what runners that only exist in them share (docs/worlds.md).

``load`` reads a world file, ``base`` has what changes during a run, ``makers`` gives the runners.
"""
