"""Tests of deciding machines."""
