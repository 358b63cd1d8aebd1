"""Durations, energies and what is active when (semantics, 8.4 to 8.6)."""
