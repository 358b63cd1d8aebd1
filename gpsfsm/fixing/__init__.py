"""Fixing: edits of a plan's text that take a finding away, each proved by checking again."""
