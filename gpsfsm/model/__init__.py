"""Frozen data that flows through gpsfsm; imports nothing else of it."""
