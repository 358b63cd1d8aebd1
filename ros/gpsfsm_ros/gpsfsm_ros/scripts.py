"""Console scripts for ``ros2 run`` and launch files: each makes a command line of gpsfsm.

Parameters of ROS become options: ``-p journal:=run.db`` is ``--journal=run.db``, and
``-p plan:=a.xml`` is the plan. So do those of a file (``--params-file``). What else is between
``--ros-args`` and ``--`` goes to the node. So gpsfsm itself reports all that can be wrong, in one
place.
"""

import sys

from gpsfsm_ros.parameters import ParameterError, of_file

_PARAMETER, _FILE = ("-p", "--param"), "--params-file"
_OF_THE_NODE = ("use_sim_time", "start_type_description_service")
"""Parameters that every node of ROS 2 has; gpsfsm knows nothing of them."""
_FAILED = 2


def run_plan():
    """Run a plan on the robot: ``gpsfsm run --real``."""
    return _main(["run", "--real"], plan=True)


def gate():
    """Decide on every plan that is meant for a Fabric: ``gpsfsm ros gate``."""
    return _main(["ros", "gate"])


def dispatch():
    """Hand a plan over to a Fabric: ``gpsfsm dispatch``."""
    return _main(["dispatch"], plan=True)


def command_line(command, arguments, *, plan=False):
    """The command line of gpsfsm for a script; with ``plan`` the parameter of that name is a path.

    What comes later counts, as in ROS 2: a parameter replaces those of files before it.

    >>> command_line(["run"], ["--ros-args", "-p", "plan:=a.xml", "-r", "a:=b"], plan=True)
    ['run', '--ros-args', '-r', 'a:=b', '--', '--', 'a.xml']
    """
    rest, section = _split(arguments)
    kept, options, of_files = [], {}, set()
    words = iter(section)
    for word in words:
        value = next(words, None) if word in (*_PARAMETER, _FILE) else None
        name, sign, text = (value or "").partition(":=")
        if word == _FILE and value is not None:
            read = {name: each for name, each in of_file(value, section) if _is_option(name)}
            options |= read
            of_files |= set(read)
        if word not in _PARAMETER or not sign or not _is_option(name):
            kept += [word] if value is None else [word, value]
            continue
        if name in of_files:
            of_files.remove(name)
            options[name] = []
        options.setdefault(name, []).append(text)
    if kept:
        kept = ["--ros-args", *kept, "--"]
    paths = options.pop("plan", []) if plan else []
    if paths and "--" not in rest:
        rest.append("--")
    flags = [_option(name, text) for name, texts in options.items() for text in texts]
    return [*command, *kept, *(word for words in flags for word in words), *rest, *paths]


def _split(arguments):
    """The words outside and inside the sections between ``--ros-args`` and ``--``."""
    rest, section = [], []
    target = rest
    for word in arguments:
        if word == "--ros-args":
            target = section
        elif word == "--" and target is section:
            target = rest
        else:
            target.append(word)
    return rest, section


def _is_option(name):
    """False for parameters of every node, of a node by its name (``a:b``), of groups (``a.b``)."""
    return name.replace("_", "a").isalnum() and name not in _OF_THE_NODE


def _option(name, text):
    flag = "--" + name.replace("_", "-")
    if text.lower() in ("true", "false"):
        return [flag] if text.lower() == "true" else []
    return [f"{flag}={text}"]


def _main(command, *, plan=False):
    try:
        from gpsfsm.cli import main
    except ImportError as error:
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        sys.stderr.write(
            f"gpsfsm_ros: gpsfsm cannot be used in {sys.executable} ({error})\n"
            "  activate the environment that has it, made with the Python of your ROS 2 "
            f"(this one is {version}): pip install 'gpsfsm[ros]'\n"
        )
        return _FAILED
    try:
        words = command_line(command, sys.argv[1:], plan=plan)
    except ParameterError as error:
        sys.stderr.write(f"gpsfsm_ros: {error}\n")
        return _FAILED
    return main(words)
