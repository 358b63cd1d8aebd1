"""Fields of messages by path; the classes are made like those that ROS 2 generates."""

from __future__ import annotations

import array
import math
from typing import Any

import pytest

from gpsfsm.model.ros import RosSettings
from gpsfsm.ros import messages
from gpsfsm.ros.messages import as_value, definition, fill, has_field, map_text, value_at
from gpsfsm.ros.node import RosError, rules


class Message:
    """An object like one of a generated class: it names its fields and their types."""

    def __init__(self, **fields: tuple[str, Any]) -> None:
        self._types = {name: kind for name, (kind, _) in fields.items()}
        for name, (_, value) in fields.items():
            setattr(self, name, value)

    def get_fields_and_field_types(self) -> dict[str, str]:
        return dict(self._types)


def point() -> Any:
    return Message(x=("double", 0.0), y=("double", 0.0))


def stamped() -> Any:
    return Message(frame=("string", ""), point=("demo_msgs/Point", point()))


def new_goal() -> Any:
    return Message(
        at=("demo_msgs/Stamped", stamped()),
        all=("sequence<demo_msgs/Stamped>", []),
        count=("uint8", 0),
        offset=("int16", 0),
        ready=("boolean", False),
        weights=("sequence<double, 3>", []),
    )


def new_map(width: int = 2) -> Any:
    info = Message(
        width=("uint32", width),
        height=("uint32", 2),
        resolution=("float", 0.5),
        origin=("demo_msgs/Pose", Message(position=("demo_msgs/Point", point()))),
    )
    return Message(info=("demo_msgs/Info", info), data=("sequence<int8>", [0, 100, -1, 49]))


@pytest.fixture(autouse=True)
def _definitions(monkeypatch: pytest.MonkeyPatch) -> None:
    definitions = {"demo_msgs/msg/Point": point, "demo_msgs/msg/Stamped": stamped}
    monkeypatch.setattr(messages, "definition", definitions.__getitem__)


def filled(**values: Any) -> Any:
    goal = new_goal()
    fill(goal, {path.replace("__", "."): value for path, value in values.items()})
    return goal


def test_fields_are_set_by_path() -> None:
    goal = filled(at__point__x=2, at__frame="map", count=3, ready=True, weights=[1, 2.5])
    assert (goal.at.point.x, type(goal.at.point.x)) == (2.0, float)
    assert (goal.at.frame, goal.count, goal.ready, goal.weights) == ("map", 3, True, [1.0, 2.5])


def test_lists_make_the_items_and_other_values_go_into_each() -> None:
    goal = new_goal()
    fill(
        goal,
        {"all[].frame": "map", "all[].point.x": "1 2.5; -3", "all[].point.y": [4, 5, 6]},
    )
    assert [(each.frame, each.point.x, each.point.y) for each in goal.all] == [
        ("map", 1.0, 4.0),
        ("map", 2.5, 5.0),
        ("map", -3.0, 6.0),
    ]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"nothing": 1}, "has no field nothing (it has at, all, count"),
        ({"at.point.z": 1.0}, "has no field z"),
        ({"count": 256}, "256 does not fit the field count, which is from 0 to 255"),
        ({"offset": -40_000}, "from -32768 to 32767"),
        ({"count": 1.5}, "1.5 does not fit the field count, a uint8"),
        ({"count": True}, "true does not fit"),
        ({"ready": 1}, "1 does not fit the field ready, a boolean"),
        ({"at.point.x": "far"}, '"far" does not fit the field at.point.x, a double'),
        ({"all[].point.x": [1, 2], "all[].point.y": [1]}, "differ in length"),
        ({"count[].x": [1]}, "is not a list of messages"),
        ({"all[].frame": "map"}, "nothing says how many items the list all of Message has"),
        ({"all[].point.x": []}, "the list for all of Message is empty"),
        ({"all[].point.x": [[1], 2]}, "the list for all[].point.x are lists of different depth"),
        ({"all": [1]}, "the field all is a list of messages: fill the fields of its items"),
        ({"at": 1, "at.frame": "map"}, "is filled in two ways: at and at.frame"),
        ({"count.x": 1}, "the field count of Message is a uint8, not a message"),
        ({"weights": " "}, "the text for the list weights is empty"),
        ({"weights": "1 2 3 4"}, "4 items do not fit the field weights, a sequence<double, 3>"),
        ({"weights": "1 2 far"}, '"1 2 far" does not fit the field weights, a double'),
        ({"at.point.x": 10**400}, "is too large for the field at.point.x, a double"),
        ({"count": math.inf}, "does not fit the field count, a uint8"),
    ],
)
def test_what_does_not_fit_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(RosError) as caught:
        fill(new_goal(), values)
    assert message in str(caught.value)


def test_an_optional_field_may_be_missing_and_a_value_may_not_be_wrong() -> None:
    goal = new_goal()
    fill(goal, {"newer": 1, "count": 2}, optional=("newer", "count"))
    assert goal.count == 2
    with pytest.raises(RosError):
        fill(goal, {"count": -1}, optional=("count",))


def test_fields_that_are_lists_take_lists_and_texts() -> None:
    assert filled(weights="1 2.5; -3").weights == [1.0, 2.5, -3.0]
    assert filled(weights="[0.5, 1]").weights == [0.5, 1.0]
    assert filled(weights=2).weights == [2.0]


def test_an_item_of_a_list_is_picked_and_no_number_is_none() -> None:
    goal = new_goal()
    fill(goal, {"all[].frame": ["a", "b", "c"], "all[].point.x": "1 3 3"})
    assert value_at(goal, "all[first].frame") == "a"
    assert value_at(goal, "all[last].frame") == "c"
    assert value_at(goal, "all[best by point.x].frame") == "b"
    assert value_at(goal, "all[all].point.x") == [1.0, 3.0, 3.0]
    goal.all[1].point.x = math.nan
    assert value_at(goal, "all[best by point.x].frame") == "c"
    goal.at.point.x = math.nan
    assert value_at(goal, "at.point.x") is None
    assert value_at(goal, "at") == '{"frame":"","point":{"x":null,"y":0.0}}'
    with pytest.raises(RosError, match="not been measured cannot be handed over"):
        value_at(goal, "all[all].point.x")


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("all[first].frame", "there is none in all of Message"),
        ("all[first].nope", "has no field nope"),
        ("count[first]", "the field count of Message is not a list"),
        ("all[best by frame].frame", "asked for by a string, not by a number"),
        ("at.frame.x", "there is no field x in a str"),
    ],
)
def test_what_cannot_be_picked_is_an_error(path: str, message: str) -> None:
    with pytest.raises(RosError) as caught:
        value_at(new_goal(), path)
    assert message in str(caught.value)


def test_values_come_out_as_runners_hand_them_over() -> None:
    goal = filled(at__frame="map", weights=[1.0])
    assert value_at(goal, "at.frame") == "map"
    assert value_at(goal, "weights[]") == 1
    assert value_at(goal, "at") == '{"frame":"map","point":{"x":0.0,"y":0.0}}'
    assert as_value(array.array("d", [1.5, 2.0])) == [1.5, 2.0]
    assert as_value(b"\x01\x02") == [1, 2]
    assert has_field(goal, "at.point.x")
    assert not has_field(goal, "at.point.z")
    with pytest.raises(RosError, match="cannot be handed over"):
        as_value(object())


def test_a_map_is_the_text_that_prompts_know() -> None:
    assert as_value(new_map()) == "width=2 height=2 resolution=0.5 origin=(0, 0)\n.#\n?."
    with pytest.raises(RosError, match="the map has 4 cells, and says 3 x 2"):
        map_text(new_map(3))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("os.path", "is not a definition"),
        ("os/msg/Path", "the messages of os are not installed"),
        ("json/msg/Decoder", "json has no msg Decoder"),
        ("no_such_msgs/srv/Go", "apt install ros-<distro>-no-such-msgs"),
    ],
)
def test_only_generated_packages_are_imported(
    name: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    with pytest.raises(RosError) as caught:
        definition(name)
    assert message in str(caught.value)


def test_rules_of_the_command_line_come_last() -> None:
    settings = RosSettings(remap=(("a", "b"),), arguments=("--remap", "gpsfsm:a:=/c", "-p", "x:=1"))
    assert rules(settings) == [("a", "b"), ("a", "/c")]
