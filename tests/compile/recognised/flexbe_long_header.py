#!/usr/bin/env python
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
# licence text licence text licence text licence text licence text
from flexbe_core import Behavior, Autonomy, OperatableStateMachine
from flexbe_states.wait_state import WaitState


class WaitSM(Behavior):
    def create(self):
        _state_machine = OperatableStateMachine(outcomes=["finished"])
        with _state_machine:
            OperatableStateMachine.add(
                "Wait",
                WaitState(wait_time=1),
                transitions={"done": "finished"},
                autonomy={"done": Autonomy.Off},
            )
        return _state_machine
