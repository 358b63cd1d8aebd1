"""Runs of plans: prepared, admitted, driven to their ends, and gone on with after a crash."""
