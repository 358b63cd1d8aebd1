"""Prompting: what a model is told and asked."""
