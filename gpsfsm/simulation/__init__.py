"""Worlds, and what runners that only exist in them share (docs/worlds.md).

``load`` reads a world file, ``state`` is what changes during a run, ``makers`` gives the runners.
"""
