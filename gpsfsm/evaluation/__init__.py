"""Tables of grades: statistics of times, agreement with people, recorded experiments.

docs/experiments.md gives the formulas and the layouts of experiments that are recognised.
"""
