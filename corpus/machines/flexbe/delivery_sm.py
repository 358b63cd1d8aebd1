"""A robot that delivers parcels, as FlexBE would generate it; with three mistakes."""

from flexbe_core import Autonomy, Behavior, ConcurrencyContainer, OperatableStateMachine


class DeliverySM(Behavior):
    def create(self):
        _state_machine = OperatableStateMachine(outcomes=["finished", "failed"])

        # Nothing is said of the watch that loses sight and of a drive that fails.
        _sm_drive_0 = ConcurrencyContainer(
            outcomes=["finished", "failed"],
            conditions=[
                ("finished", [("Drive", "arrived")]),
                ("failed", [("Watch", "blocked")]),
            ],
        )

        with _sm_drive_0:
            OperatableStateMachine.add(
                "Drive",
                DriveState(outcomes=["arrived", "failed"]),
                transitions={"arrived": "finished", "failed": "failed"},
                autonomy={"arrived": Autonomy.Off, "failed": Autonomy.Off},
            )
            OperatableStateMachine.add(
                "Watch",
                WatchState(outcomes=["blocked", "lost"]),
                transitions={"blocked": "failed", "lost": "failed"},
                autonomy={"blocked": Autonomy.Off, "lost": Autonomy.Off},
            )

        with _state_machine:
            OperatableStateMachine.add(
                "Go",
                _sm_drive_0,
                transitions={"finished": "Ring", "failed": "failed"},
                autonomy={"finished": Autonomy.Inherit, "failed": Autonomy.Inherit},
            )
            # Once the bell rings, nothing leads out of ringing and waiting.
            OperatableStateMachine.add(
                "Ring",
                RingState(),
                transitions={"done": "Wait"},
                autonomy={"done": Autonomy.Off},
            )
            OperatableStateMachine.add(
                "Wait",
                WaitState(wait_time=30),
                transitions={"done": "Ring"},
                autonomy={"done": Autonomy.Off},
            )
            # Nothing leads here.
            OperatableStateMachine.add(
                "Hand Over",
                HandOverState(),
                transitions={"done": "finished", "failed": "failed"},
                autonomy={"done": Autonomy.Off, "failed": Autonomy.Off},
            )

        return _state_machine
