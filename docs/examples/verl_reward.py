"""The reward function that verl loads."""

from gpsfsm import verl_compute_score as compute_score  # noqa: F401
