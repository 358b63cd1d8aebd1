"""A patrol built in a loop, as programs with SMACH do. 'CHARGE' has no transition for 'aborted'."""

import smach
from smach_ros import SimpleActionState


class Charge(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=["charged", "aborted"])

    def execute(self, userdata):
        return "charged"


ROOMS = ["hall", "kitchen", "lab"]


def main():
    patrol = smach.StateMachine(outcomes=["succeeded", "preempted"])
    with patrol:
        for number, room in enumerate(ROOMS):
            following = ROOMS[number + 1] if number < 2 else "CHARGE"
            smach.StateMachine.add(
                room,
                SimpleActionState("move_base", None),
                transitions={"succeeded": following, "aborted": "CHARGE"},
            )
        smach.StateMachine.add("CHARGE", Charge(), transitions={"charged": "succeeded"})
    patrol.execute()


if __name__ == "__main__":
    main()
