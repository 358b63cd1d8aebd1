"""Attacks: hostile cases that must not fool, crash or starve the product, one kind per module.

A module here holds a ``Pair`` with ``attack=True``: hostile cases are drawn, the product is exposed
to each as a user or an attacker would, and the judge raises AssertionError where the product was
fooled. ``make attack`` plays them for ten minutes, the test suite a few of each.
"""
