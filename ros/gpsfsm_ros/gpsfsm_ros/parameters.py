"""Parameter files of ROS 2: which of their parameters are for the node of a script."""

import re
import sys

NODE = "gpsfsm"
"""The name that files have for the node, unless ``-r __node:=NAME`` gives it another one."""
_VALUES = "ros__parameters"


class ParameterError(Exception):
    """A parameter file that cannot be used."""


def of_file(path, arguments):
    """Pairs of a parameter and its values as texts; those that are groups are left out.

    ``arguments`` are those of the node, which may give it a name and a namespace.
    """
    import yaml  # comes with ROS 2, and with gpsfsm

    try:
        with open(path, encoding="utf-8") as file:  # noqa: PTH123 - as all files of this package
            data = yaml.safe_load(file)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ParameterError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    sections = list(_sections(path, data, ""))
    node = _name(arguments)
    pairs = [pair for name, section in sections if _matches(name, node) for pair in section.items()]
    if not pairs:
        names = ", ".join(name for name, _ in sections) or "no node"
        sys.stderr.write(f"gpsfsm_ros: {path} has parameters of {names}, and none of {node}\n")
    return [(str(name), _texts(path, name, value)) for name, value in pairs if _is_value(value)]


def _sections(path, data, name):
    """The names of nodes, and their parameters; a namespace may be a key of its own."""
    if not isinstance(data, dict):
        raise ParameterError(f"{path} is not a parameter file: NODE, and below it {_VALUES}")
    for key, value in data.items():
        if key != _VALUES:
            yield from _sections(path, value, f"{name}/{str(key).strip('/')}")
        elif name and isinstance(value, dict):
            yield name, value
        else:
            raise ParameterError(f"{path} has {_VALUES} without a node, or without parameters")


def _name(arguments):
    """The full name of the node by its arguments."""
    names = {"__ns": "", "__node": NODE, "__name": ""}
    for word in arguments:
        rule, sign, text = word.partition(":=")
        if sign and rule in names:
            names[rule] = text.strip("/")
    parts = (names["__ns"], names["__name"] or names["__node"])
    return "".join(f"/{part}" for part in parts if part)


def _matches(pattern, node):
    """As in ROS 2, ``*`` is one part of a name and ``**`` any number of them."""
    parts = {"*": r"/[^/]+", "**": r"(/[^/]+)*"}
    words = pattern.strip("/").split("/")
    return re.fullmatch("".join(parts.get(word, "/" + re.escape(word)) for word in words), node)


def _is_value(value):
    return not isinstance(value, dict)


def _texts(path, name, value):
    values = value if isinstance(value, list) else [value]
    if any(each is None or isinstance(each, dict | list) for each in values):
        raise ParameterError(f"{path}: the parameter {name} has no value that ROS 2 knows")
    return [str(each).lower() if isinstance(each, bool) else str(each) for each in values]
