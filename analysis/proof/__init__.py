"""Proofs of what the structural pass proposes: replayed runs, and one refutation by z3."""
