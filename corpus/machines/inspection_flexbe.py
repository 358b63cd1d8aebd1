"""An inspection round, as FlexBE would generate it. State 'Report' is never reached."""

from flexbe_core import Autonomy, Behavior, ConcurrencyContainer, OperatableStateMachine
from inspection_flexbe_states.drive_state import DriveState
from inspection_flexbe_states.look_state import LookState
from inspection_flexbe_states.report_state import ReportState


class InspectionSM(Behavior):
    def create(self):
        _state_machine = OperatableStateMachine(outcomes=["finished", "failed"])

        _sm_look_around = ConcurrencyContainer(
            outcomes=["seen", "failed"],
            conditions=[
                ("seen", [("Look left", "seen"), ("Look right", "seen")]),
                ("failed", [("Look left", "nothing")]),
                ("failed", [("Look right", "nothing")]),
            ],
        )

        with _sm_look_around:
            OperatableStateMachine.add(
                "Look left", LookState(angle=-1.0), transitions={"seen": "seen", "nothing": "failed"}
            )
            OperatableStateMachine.add(
                "Look right", LookState(angle=1.0), transitions={"seen": "seen", "nothing": "failed"}
            )

        with _state_machine:
            OperatableStateMachine.add(
                "Drive",
                DriveState(),
                transitions={"arrived": "Look around", "blocked": "Drive", "failed": "failed"},
                autonomy={"arrived": Autonomy.Off, "blocked": Autonomy.Off},
            )
            OperatableStateMachine.add(
                "Look around",
                _sm_look_around,
                transitions={"seen": "finished", "failed": "Drive"},
            )
            OperatableStateMachine.add(
                "Report", ReportState(), transitions={"done": "finished", "failed": "failed"}
            )

        return _state_machine
