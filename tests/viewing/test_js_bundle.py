"""Modules that are joined to one script, and those that are refused."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from gpsfsm.viewing.js_bundle import JoinError, joined

WEB = Path(__file__).parents[2] / "gpsfsm" / "viewing" / "web"


def _joined(**modules: str) -> str:
    files = {f"{name}.js": text for name, text in modules.items()}
    return joined("entry.js", files.__getitem__)


def test_what_is_imported_stands_first_and_once() -> None:
    script = _joined(
        entry='import { two } from "./b.js";\nimport {\n  one,\n} from "./a.js";\ntwo(one);\n',
        b='import { one } from "./a.js";\nexport function two(x) { return x + one; }\n',
        a="export const one = 1;\n",
    )
    places = [script.index(part) for part in ("const one", "function two", "two(one)")]
    assert places == sorted(places)
    assert script.count("const one") == 1
    assert "import" not in script
    assert "export" not in script
    assert '"use strict"' in script


def test_all_kinds_of_exports() -> None:
    script = _joined(
        entry='import { a, b, c, d } from "./x.js";\n',
        x=(
            "export class a {}\nexport async function b() {}\nexport let c = 0;\n"
            'export const d = "export const e";\n'
        ),
    )
    assert "class a {}\nasync function b() {}\nlet c = 0;" in script
    assert '"export const e"' in script


def test_comments_and_indentation_stay_behind() -> None:
    script = _joined(
        entry=(
            "// Why.\n/**\n * @param {number} a\n */\nfunction one(a) {\n  // so\n"
            '  return `${a} // no comment` + "/* nor this */";  // kept\n}\n'
        )
    )
    assert "// entry.js\nfunction one(a) {\nreturn `${a} // no comment`" in script
    assert '"/* nor this */";' in script
    assert "Why" not in script
    assert "@param" not in script


REFUSED = {
    "another name": 'import { a as b } from "./x.js";',
    "everything": 'import * as all from "./x.js";',
    "default": 'import a from "./x.js";',
    "only for what it does": 'import "./x.js";',
    "from elsewhere": 'import { a } from "x";',
    "later": 'const a = import("./x.js");',
    "about itself": "const a = import.meta.url;",
    "export of names": "const a = 1;\nexport { a };",
    "export of the default": "export default 1;",
    "export from": 'export { a } from "./x.js";',
    "names taken apart": "export const { a, b } = {};",
    "end of the script": 'const a = "</SCRIPT>";',
    "begin of a comment": 'const a = "<!--";',
    "text of two lines": "const a = `one\n// two`;",
    "missing name": 'import { missing } from "./x.js";',
    "not exported": 'import { hidden } from "./x.js";',
    "name twice": 'import { a } from "./x.js";\nfunction hidden() {}',
}


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED)
def test_what_is_refused(text: str) -> None:
    with pytest.raises(JoinError):
        _joined(entry=text + "\n", x="export const a = 1;\nconst hidden = 2;\n")


def test_a_circle_is_named() -> None:
    with pytest.raises(JoinError, match=r"a\.js → b\.js → a\.js"):
        _joined(
            entry='import { a } from "./a.js";\n',
            a='import { b } from "./b.js";\nexport const a = 1;\n',
            b='import { a } from "./a.js";\nexport const b = 1;\n',
        )


def test_the_modules_of_the_report_are_one_script(tmp_path: Path) -> None:
    script = joined("report.js", lambda name: (WEB / name).read_text(encoding="utf-8"))
    assert script == joined("report.js", lambda name: (WEB / name).read_text(encoding="utf-8"))
    node = shutil.which("node")
    if node is not None:
        (tmp_path / "report.js").write_text(script, encoding="utf-8")
        command = [node, "--check", str(tmp_path / "report.js")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
