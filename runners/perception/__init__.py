"""Perception: seeing, listening, speaking, and judging moods."""
