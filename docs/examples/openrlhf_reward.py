"""The reward function that OpenRLHF loads."""

from gpsfsm import openrlhf_reward_func as reward_func  # noqa: F401
