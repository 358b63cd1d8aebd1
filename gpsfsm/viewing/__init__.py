"""Seeing plans: the view document, and the page that shows it (docs/view.md).

Nothing is imported here: the service asks for single modules in its workers.
"""
