"""Finding and reading configuration files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.config import Config, find_config, load_config
from gpsfsm.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path


def put(folder: Path, name: str, text: str | bytes) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


class TestFinding:
    def test_nothing(self, tmp_path: Path) -> None:
        assert find_config(tmp_path) == Config()

    def test_the_nearest_folder_wins(self, tmp_path: Path) -> None:
        deep = tmp_path / "a" / "b"
        deep.mkdir(parents=True)
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        assert find_config(deep).values == {"jobs": 1}
        put(tmp_path / "a", "pyproject.toml", "[tool.gpsfsm]\njobs = 2")
        assert find_config(deep).values == {"jobs": 2}
        file = put(deep, "gpsfsm.toml", "jobs = 3")
        assert find_config(deep) == Config(str(file), {"jobs": 3})

    def test_the_own_file_wins_in_one_folder(self, tmp_path: Path) -> None:
        put(tmp_path, "pyproject.toml", "[tool.gpsfsm]\njobs = 2")
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        assert find_config(tmp_path).values == {"jobs": 1}

    @pytest.mark.parametrize(
        "text",
        ["", "[project]\nname = 'x'", "tool = 3", "[tool.other]\ngpsfsm = 1", "tool = broken"],
    )
    def test_a_project_without_settings_is_passed_over(self, text: str, tmp_path: Path) -> None:
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        put(tmp_path / "a", "pyproject.toml", text)
        assert find_config(tmp_path / "a").values == {"jobs": 1}

    @pytest.mark.parametrize(
        ("name", "text"), [("gpsfsm.toml", ""), ("pyproject.toml", "[tool.gpsfsm]")]
    )
    def test_empty_settings_end_the_search(self, name: str, text: str, tmp_path: Path) -> None:
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        file = put(tmp_path / "a", name, text)
        assert find_config(tmp_path / "a") == Config(str(file), {})

    def test_folders_of_that_name_are_passed_over(self, tmp_path: Path) -> None:
        (tmp_path / "gpsfsm.toml").mkdir()
        assert find_config(tmp_path) == Config()

    def test_the_current_folder_is_the_start(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        monkeypatch.chdir(tmp_path)
        assert find_config().values == {"jobs": 1}

    def test_a_current_folder_that_is_gone(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        gone = tmp_path / "gone"
        gone.mkdir()
        monkeypatch.chdir(gone)
        gone.rmdir()
        assert find_config() == Config()


class TestReading:
    def test_all_keys(self, tmp_path: Path) -> None:
        text = """
            format = "sarif"
            output-file = "out/r.sarif"
            select = ["GP3", "GP1"]
            ignore = ["dangling-failure"]
            fail-on = "never"
            quiet = true
            statistics = false
            jobs = 0
            assume = ["never fails: SpeechRunner"]
            consistent = true
            faults = ["no-start", "hang"]
            solver = "z3"
            rlimit = 1000
            total-rlimit = 2000
            max-scenarios = 0
            from-response = false
            baseline = "/known.json"
            max-bytes = 1
            max-depth = 2
            max-elements = 3
            max-attributes = 4
            max-attribute-length = 5
            color = "always"
        """
        values = load_config(put(tmp_path, "gpsfsm.toml", text)).values
        assert values == {
            "format": "sarif",
            "output_file": str(tmp_path / "out" / "r.sarif"),
            "select": ["GP3", "GP1"],
            "ignore": ["dangling-failure"],
            "fail_on": "never",
            "quiet": True,
            "statistics": False,
            "jobs": 0,
            "assume": ["never fails: SpeechRunner"],
            "consistent": True,
            "faults": ["no-start", "hang"],
            "solver": "z3",
            "rlimit": 1000,
            "total_rlimit": 2000,
            "max_scenarios": 0,
            "from_response": False,
            "baseline": "/known.json",
            "max_bytes": 1,
            "max_depth": 2,
            "max_elements": 3,
            "max_attributes": 4,
            "max_attribute_length": 5,
            "color": "always",
        }

    def test_standard_output_is_not_a_path(self, tmp_path: Path) -> None:
        file = put(tmp_path, "gpsfsm.toml", 'output-file = "-"')
        assert load_config(file).values == {"output_file": "-"}

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("fail-on = 'eror'", "'fail-on' must be 'error', 'warning' or 'never', not 'eror'"),
            ("quiet = 1", "'quiet' must be a valid boolean, not 1"),
            ("jobs = 1.5", "'jobs' must be a valid integer, not 1.5"),
            ("jobs = true", "'jobs' must be a valid integer, not True"),
            ("jobs = -1", "'jobs' must be greater than or equal to 0, not -1"),
            ("max-depth = 0", "'max-depth' must be greater than or equal to 1, not 0"),
            ("select = 'GP3'", "'select' must be a valid list, not 'GP3'"),
            ("select = [3]", "'select[0]' must be a valid string, not 3"),
            ("faults = ['hang', 'x']", "'faults[1]' must be 'failed', 'no-start' or 'hang'"),
            ("fail_on = 'error'", "there is no key 'fail_on'; did you mean 'fail-on'?"),
            ("zzz = 1", "there is no key 'zzz'; known are format, output-file, select"),
            ("[tool.gpsfsm]\njobs = 1", "keys stand at the top of a gpsfsm.toml"),
            ("select = ['GP0']", "'select': no rule matches 'GP0'"),
            ("ignore = ['x']", "'ignore': no rule matches 'x'"),
            ("format = 'x'", "'format': there is no format 'x'"),
            ("assume = ['never']", "'assume': "),
            ("jobs =", "is not TOML: "),
            (f"jobs = {'9' * 5000}", "is not TOML: "),
            ("select = " + "[" * 100_000, "is nested too deeply"),
            (b"format = '\xff'", "is not UTF-8 text (byte 11)"),
            ("#" * (1 << 20) + "#", "is larger than 1048576 bytes"),
            (f"color = '{'x' * 1000}'", "…"),
        ],
    )
    def test_what_does_not_fit_is_explained(
        self, text: str | bytes, message: str, tmp_path: Path
    ) -> None:
        file = put(tmp_path, "gpsfsm.toml", text)
        with pytest.raises(ConfigError) as caught:
            load_config(file)
        explained = str(caught.value)
        assert explained.startswith(f"{file}: ")
        assert message in explained
        assert len(explained) < len(str(file)) + 1000

    def test_every_problem_is_told(self, tmp_path: Path) -> None:
        file = put(tmp_path, "gpsfsm.toml", "jobs = 'many'\ncolor = 'red'\nzzz = 1")
        with pytest.raises(ConfigError) as caught:
            load_config(file)
        assert len(str(caught.value).splitlines()) == 3

    def test_pyproject(self, tmp_path: Path) -> None:
        file = put(tmp_path, "pyproject.toml", "[project]\nname='gpsfsm'")
        with pytest.raises(ConfigError, match=r"no \[tool\.gpsfsm\] in it"):
            load_config(file)
        put(tmp_path, "pyproject.toml", "[tool]\ngpsfsm = 3")
        with pytest.raises(ConfigError, match="must be a table"):
            load_config(file)
        put(tmp_path, "pyproject.toml", "[tool.gpsfsm\n")
        with pytest.raises(ConfigError, match="is not TOML"):
            find_config(tmp_path)

    @pytest.mark.parametrize("name", ["missing.toml", "."])
    def test_unreadable(self, name: str, tmp_path: Path) -> None:
        with pytest.raises(ConfigError, match="cannot be read"):
            load_config(tmp_path / name)
