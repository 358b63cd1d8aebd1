"""A behaviour in which no transition takes an outcome of a state."""

from flexbe_core import OperatableStateMachine

_state_machine = OperatableStateMachine(outcomes=["finished"])

with _state_machine:
    OperatableStateMachine.add(
        "Ask",
        OperatorDecisionState(outcomes=["yes", "no"], hint="Go?", suggestion="yes"),
        transitions={"yes": "finished"},
    )
