"""The files that a behaviour tree includes: ``<include path="arm.xml"/>``.

Whoever wrote the tree may not be trusted. So only a tree that is itself a file includes others, and
nothing is read but regular files below a folder that the user has named, directly or by a file in
it: also links must end there. Of a file that holds no trees nobody is shown anything. For those who
keep one text, ``joined_text`` makes one of all files.

An included file has a path that is opened, and a name that is shown, which begins as the user has
written the first one:

    gpsfsm check trees/main.xml     <include path="arm/grip.xml"/> in it
    trees/arm/grip.xml              is the name in reports; paths in it begin at trees/arm
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from gpsfsm.errors import InputError
from gpsfsm.files import read
from gpsfsm.late import pattern
from gpsfsm.model.printable import clip
from gpsfsm.syntax.source import DEFAULT_LIMITS, Limits, read_source
from gpsfsm.syntax.text import WHITE

if TYPE_CHECKING:
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.trees import Includes, Target

MOST_INCLUDED: Final = 100
"""So many files may a behaviour tree include."""

MOST_INCLUDES: Final = 1_000
"""So many include elements are looked at in all files together."""

_LONGEST_PATH = 4096
_DECLARATION = pattern(rf"[{WHITE}]*+<\?xml(?:[^?]++|\?(?!>))*+\?>")
_NOT_LINE_ENDS = pattern(r"[^\r\n]")
_PACKAGE = pattern(r"[A-Za-z0-9_-]{1,200}")
_NO_FILES = ("/dev/", "/proc/")
"""The folders of names that stand for pipes, for standard input, for the files of processes."""


class Named(Protocol):
    """An input, as ``checking/inputs.py`` has it."""

    @property
    def path(self) -> str:
        """The path of its file."""

    @property
    def root(self) -> str:
        """The folder that was named, if it was one."""

    @property
    def stdin(self) -> bool:
        """True for standard input."""

    @property
    def answers(self) -> str:
        """The file of an answer that is a line of it."""


def includes_of(item: Named, text: bytes, limits: Limits) -> Includes | None:
    """The files that the behaviour tree in an input includes; None if it may include none.

    Only a regular file may: standard input and answers of models are texts of anybody.
    """
    if item.stdin or item.answers or not item.path:
        return None
    if b"include" not in (text.replace(b"\0", b"") if b"\0" in text else text):
        return None
    from gpsfsm.syntax.trees import include_elements  # (loads what reads trees)

    decoded = read_source(text, limits).text
    if decoded is None or not include_elements(decoded, limits) or not _is_file(item.path):
        return None
    reading = _IncludeReading(
        Path(item.root or Path(item.path).parent), limits, limits.max_bytes - len(text)
    )
    return reading.includes(Path(item.path), decoded)


def _is_file(path: str) -> bool:
    try:
        return Path(path).is_file() and not str(Path(path).absolute()).startswith(_NO_FILES)
    except (OSError, ValueError):
        return False


class _IncludeReading:
    """The reading of all files that one includes, directly or through others, each once.

    ``left`` are the bytes that they may have together. A file has a path that is opened, and one
    that is shown: that begins as the user has written it.
    """

    def __init__(self, root: Path, limits: Limits, left: int) -> None:
        self._root, self._real_root = root, _real(root)
        self._limits, self._left = limits, left
        self._names: dict[Path, str] = {}  # by the real path
        self._around: dict[Path, str] = {}  # the same, of the files that are being read
        self._texts: dict[str, str] = {}
        self._targets: dict[tuple[str, int], Target] = {}
        self._notes: list[str] = []
        self._elements = 0

    def includes(self, path: Path, text: str) -> Includes:
        """The files that the file at a path includes."""
        from gpsfsm.syntax.trees import Includes

        self._file("", path, path, text)
        return Includes(self._texts, self._targets, tuple(self._notes))

    def _file(self, name: str, shown: Path, path: Path, text: str) -> None:
        """Read the files that one includes."""
        from gpsfsm.syntax.trees import Target, include_elements

        real, folder = _real(path), _real(path.parent)
        self._around[real] = str(shown)
        for node in include_elements(text, self._limits):
            self._elements += 1
            if self._elements <= MOST_INCLUDES:
                target = self._target(node, shown.parent, folder)
            else:
                why = f"there are more than {MOST_INCLUDES:,} includes; this one is not read"
                target = Target(why=why, hint="put the trees into fewer files")
            self._targets[name, node.start] = target
        del self._around[real]

    def _target(self, node: TreeNode, shown: Path, folder: Path) -> Target:
        """The file that an element in a folder includes; it is read if it has not been yet."""
        from gpsfsm.syntax.trees import Target, begins_as_trees

        written, package = node.text("path"), node.text("ros_pkg")
        if not written.strip():
            return Target(why="this include names no file", hint='add path="…" with its path')
        if package and not Path(written).is_absolute():
            of_package = self._folder_of(package, folder)
            if of_package is None:
                why = f"the ROS package '{clip(package, 80)}' is not a folder in {self._shown_root}"
                hint = "write the path without ros_pkg, from the folder of this file"
                return Target(why=why, hint=hint)
            shown = folder = of_package
        quoted = f"'{clip(written, 80)}'"
        inner = folder / written[: _LONGEST_PATH + 1]
        try:
            real = _real(inner)
        except (OSError, ValueError):  # a NUL character
            return Target(why=f"the included file {quoted} has no path that leads to a file")
        if not real.is_relative_to(self._real_root):
            why = f"the included file {quoted} is outside of the folder {self._shown_root}"
            hint = "move it into this folder, or check a folder that holds both files"
            return Target(why=f"{why}, so it is not read", hint=hint)
        if real in self._around:
            return self._circle(real)
        if real in self._names:
            return Target(self._names[real])
        if len(self._texts) >= MOST_INCLUDED:
            why = f"more than {MOST_INCLUDED} files are included; this one is not read"
            return Target(why=why, hint="put the trees into fewer files")
        text, why = self._text(real)
        if not why and not begins_as_trees(text):
            why = "holds no behaviour trees: they stand in <root>"
        if why:
            hint = "correct the path, or put the trees into this file"
            return Target(why=f"the included file {quoted} {why}", hint=hint)
        name = os.path.normpath(shown / written)
        if os.path.realpath(name) != str(real):  # a folder before ``..`` is a link
            name = str(real)
        self._names[real], self._texts[name] = name, text
        if package:
            self._notes.append(f"took {name} for {quoted} of the ROS package {package}")
        self._file(name, Path(name), inner, text)
        return Target(name)

    @property
    def _shown_root(self) -> str:
        return clip(str(self._root if self._root != Path() else self._real_root), 200)

    def _text(self, path: Path) -> tuple[str, str]:
        """The text of a file, and why it cannot be read."""
        try:
            data = read(path, self._left, pipes=False)
        except InputError as error:
            return "", str(error)
        if len(data) > self._left:
            return "", f"is too long: all files together may have {self._limits.max_bytes:,} bytes"
        self._left -= len(data)
        source = read_source(data, self._limits)
        if source.text is None:
            return "", f"cannot be read: {source.fault.message if source.fault else 'no text'}"
        return source.text, ""

    def _circle(self, real: Path) -> Target:
        """The target of an include element that leads to a file around it."""
        from gpsfsm.syntax.trees import Target

        reals = list(self._around)
        chain = [*(self._around[each] for each in reals[reals.index(real) :]), self._around[real]]
        what = "this file includes itself" if len(chain) == 2 else "these files include each other"
        why = f"{what}: {' → '.join(clip(each, 80) for each in chain)}"
        return Target(
            why=f"{why}; BehaviorTree.CPP would never end to load them",
            hint="remove one of the includes; a tree may be used where its file is not included",
            rule="GP809",
        )

    def _folder_of(self, package: str, folder: Path) -> Path | None:
        """The folder of a ROS package: one around the file, or one in the root; None if none is."""
        if not _PACKAGE.fullmatch(package):
            return None
        real = _real(folder)
        for around in (real, *real.parents):
            if around.is_relative_to(self._real_root) and around.name == package:
                return around
        beside = self._root / package
        return beside if beside.is_dir() else None


def _real(path: Path) -> Path:
    """The path without links. Raises OSError, ValueError for what cannot be one.

    Where links form a circle, one of them stays, and reading it tells. Path.resolve refuses it up
    to Python 3.12.
    """
    return Path(os.path.realpath(path))


def joined_text(item: Named, text: bytes, limits: Limits) -> bytes:
    """The text of an input, with the trees that it includes written into it.

    A text that includes nothing stays as it is. Raises InputError where a file cannot be read.
    """
    includes = includes_of(item, text, limits)
    decoded = None if includes is None else read_source(text, limits).text
    if includes is None or decoded is None:
        return text
    for (file, _), target in includes.targets.items():
        if target.why:
            where = f"in {file}: " if file else ""
            raise InputError(f"{where}{target.why}. {target.hint}" if target.hint else target.why)
    whole = joined(decoded, includes, limits)
    if whole is None:
        raise InputError("a file that it includes has errors; 'gpsfsm check' lists them")
    return whole.encode("utf-8")


def joined(text: str, includes: Includes, limits: Limits = DEFAULT_LIMITS) -> str | None:
    r"""One text with the trees of a file and of those that it includes; None if one has errors.

    The lines of the first file stay where they are, unless two files have a tree of the same ID:
    then they come last, since the last one counts.

    >>> from gpsfsm.syntax.trees import Includes, Target
    >>> arm = Includes({"a.xml": "<root><BehaviorTree/></root>"}, {("", 6): Target("a.xml")})
    >>> joined('<root><include path="a.xml"/></root>', arm)
    '<root>                       \n<!-- a.xml -->\n<BehaviorTree/></root>'
    """
    from gpsfsm.syntax.text import Lines
    from gpsfsm.syntax.token_reader import Collector
    from gpsfsm.syntax.trees import Reading

    reading = Reading(limits, Collector(Lines(text), 1), includes)
    reading.read(text)
    roots = [reading.nodes[root] for root in reading.in_order()]
    if reading.broken or any(root.tag != "root" for root in roots):
        return None
    children = [reading.nodes[child] for root in roots for child in root.children]
    names = {(each.text("ID"), each.file) for each in children if each.tag == "BehaviorTree"}
    replaced = len({name for name, _ in names}) < len(names)
    if not replaced:  # the leaves are counted as in the files
        roots = [*sorted(roots[:-1], key=lambda root: root.index), roots[-1]]
    begin, end, whole = _without_includes(text, limits)
    others = ""
    for root in roots[:-1]:
        first, last, other = _without_includes(includes.texts[root.file], limits)
        others += f"\n<!-- {clip(root.file, 200).replace('--', '- -')} -->\n{other[first:last]}"
    place = begin if replaced else end
    return f"{whole[:place]}{others}{whole[place:]}"


def _without_includes(text: str, limits: Limits) -> tuple[int, int, str]:
    """The text with blanks for its include elements and the declaration of its encoding.

    First, where the content of its outermost element begins and ends.
    """
    from gpsfsm.syntax.scan import scan
    from gpsfsm.syntax.tokens import EndTag, StartTag

    declaration = _DECLARATION.match(text)
    cuts = [(0, declaration.end())] if declaration else []
    begin = end = depth = 0
    cut = -1
    for token in scan(text, limits):
        if isinstance(token, StartTag):
            begin = begin or token.end
            end = end or token.end
            if depth == 1 and token.name == "include":
                cut = token.start
            depth += not token.empty
        elif isinstance(token, EndTag):
            depth -= 1
            end = token.start
        else:
            continue
        if cut >= 0 and depth == 1:
            cuts.append((cut, token.end))
            cut = -1
    for start, stop in cuts:
        text = f"{text[:start]}{_NOT_LINE_ENDS.sub(' ', text[start:stop])}{text[stop:]}"
    return begin, end, text
