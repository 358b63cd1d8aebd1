"""Mutation testing of analysis/: defects are planted one at a time; do the tests notice?

``python -m tests.mutants`` draws a sample by a seed, plants each mutant in a copy of the repository
and runs the tests that concern its module. docs/reliability.md reports what came of it.
"""
