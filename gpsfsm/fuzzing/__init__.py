"""Fuzzing: a plan is run again and again, with everything that can go wrong going wrong.

>>> from gpsfsm.fuzzing import Act, Fate, TimedScenario, play, subject_of
>>> go = '<Runner interface="a/Go" provider="a/Go"/>'
>>> subject = subject_of(f'<Plan>{go}{go}</Plan>')
>>> run = play(subject, TimedScenario((Act(), Act(Fate.FAILED, 3000))))
>>> str(run.status), [event.line for event in run.events if event.kind == "FAILED"]
('GAVE_UP', [1])
>>> run.at_s
4.0
"""

from __future__ import annotations

from gpsfsm.fuzzing.campaign import Campaign, Failure, run_campaign
from gpsfsm.fuzzing.properties import Breach, Property
from gpsfsm.fuzzing.runs import Happened, Run, play
from gpsfsm.fuzzing.subject import Act, Fate, Subject, TimedScenario, subject_of

__all__ = [
    "Act",
    "Breach",
    "Campaign",
    "Failure",
    "Fate",
    "Happened",
    "Property",
    "Run",
    "Subject",
    "TimedScenario",
    "play",
    "run_campaign",
    "subject_of",
]
