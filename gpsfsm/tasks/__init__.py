"""Tasks: what a plan was asked to do, and whether it does it (docs/tasks.md)."""
