"""Campaigns: independent answers to the same question, compared on many random cases.

``python -m tests.campaigns`` runs them; docs/reliability.md reports a long one. A module in
``pairs`` holds one comparison. Cases are drawn by Hypothesis from a seed and the number of a batch,
so a case comes back on every machine, and one that fails is made small before it is shown.
"""
