"""Finding and reading configuration files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from gpsfsm.checking.config import (
    Config,
    find_config,
    load_config,
    load_user_config,
    user_config_file,
)
from gpsfsm.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path


def put(folder: Path, name: str, text: str | bytes) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


@pytest.fixture(autouse=True)
def _repository(tmp_path: Path) -> None:
    """All of it is one project."""
    (tmp_path / ".git").mkdir()


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
            select = ["GP3", "GP1"]
            ignore = ["dangling-failure"]
            fail-on = "never"
            allow-suppressions = true
            quiet = true
            verbose = true
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
            "select": ["GP3", "GP1"],
            "ignore": ["dangling-failure"],
            "fail_on": "never",
            "allow_suppressions": True,
            "quiet": True,
            "verbose": True,
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

    @pytest.mark.parametrize("value", ["-", "report.txt", "/etc/passwd", "~/.bashrc"])
    def test_no_file_says_what_is_written_where(self, value: str, tmp_path: Path) -> None:
        file = put(tmp_path, "gpsfsm.toml", f'output-file = "{value}"')
        with pytest.raises(ConfigError) as caught:
            load_config(file)
        assert str(caught.value) == (
            f"{file}: there is no key 'output-file': a project file must not decide where "
            "output is written; give -o FILE on the command line"
        )

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
            ("zzz = 1", "there is no key 'zzz'; the keys are format, select, ignore"),
            ("[tool.gpsfsm]\njobs = 1", "in a gpsfsm.toml, keys are at the top level"),
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


class TestWhereTheSearchEnds:
    @pytest.mark.parametrize("as_file", [True, False])
    def test_at_the_root_of_the_repository(self, as_file: bool, tmp_path: Path) -> None:
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        deep = tmp_path / "inner" / "deep"
        deep.mkdir(parents=True)
        assert find_config(deep).values == {"jobs": 1}
        if as_file:
            put(tmp_path / "inner", ".git", "gitdir: elsewhere")
        else:
            (tmp_path / "inner" / ".git").mkdir()
        assert find_config(deep) == Config()
        put(tmp_path / "inner", "gpsfsm.toml", "jobs = 2")
        assert find_config(deep).values == {"jobs": 2}

    def test_at_home(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / ".git").rmdir()
        home = tmp_path / "home" / "me"
        (home / "deep").mkdir(parents=True)
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        monkeypatch.setenv("HOME", str(home))
        assert find_config(home / "deep") == Config()
        put(home, "gpsfsm.toml", "jobs = 2")
        assert find_config(home / "deep").values == {"jobs": 2}

    def test_outside_of_both_the_folder_alone_counts(self, tmp_path: Path) -> None:
        (tmp_path / ".git").rmdir()
        put(tmp_path, "gpsfsm.toml", "jobs = 1")
        (tmp_path / "deep").mkdir()
        assert find_config(tmp_path / "deep") == Config()
        assert find_config(tmp_path).values == {"jobs": 1}


root_only = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away"
)


class TestFilesOfOthers:
    @pytest.mark.parametrize("name", ["gpsfsm.toml", "pyproject.toml"])
    @pytest.mark.parametrize("mode", [0o777, 0o1777])
    def test_in_a_folder_in_which_all_can_write(self, name: str, mode: int, tmp_path: Path) -> None:
        file = put(tmp_path / "shared", name, "[tool.gpsfsm]" if name[0] == "p" else "")
        file.parent.chmod(mode)
        with pytest.raises(ConfigError) as caught:
            find_config(file.parent)
        assert str(caught.value) == (
            f"{file}: this configuration is not read, since it is in a folder that every "
            f"user can write to; to use it anyway, name it: --config {file}"
        )
        assert load_config(file).values == {}

    def test_one_that_all_can_write(self, tmp_path: Path) -> None:
        file = put(tmp_path, "gpsfsm.toml", "")
        file.chmod(0o666)
        with pytest.raises(ConfigError, match="every user can write to it"):
            find_config(tmp_path)

    def test_a_link_counts_as_what_it_leads_to(self, tmp_path: Path) -> None:
        file = put(tmp_path / "shared", "settings", "jobs = 3")
        (tmp_path / "gpsfsm.toml").symlink_to(file)
        assert find_config(tmp_path).values == {"jobs": 3}
        file.parent.chmod(0o1777)
        with pytest.raises(ConfigError, match="in a folder that every user can write to"):
            find_config(tmp_path)

    def test_a_project_without_settings_is_nobody_s_business(self, tmp_path: Path) -> None:
        put(tmp_path / "shared", "pyproject.toml", "[project]\nname = 'x'").parent.chmod(0o777)
        assert find_config(tmp_path / "shared") == Config()

    @root_only
    def test_of_another_owner(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("SUDO_UID", raising=False)
        file = put(tmp_path, "gpsfsm.toml", "")
        os.chown(file, 12345, 12345)
        with pytest.raises(ConfigError, match="it belongs to another user"):
            find_config(tmp_path)
        assert load_config(file).values == {}
        monkeypatch.setenv("SUDO_UID", "12345")
        assert find_config(tmp_path).file == str(file)
        monkeypatch.setenv("SUDO_UID", "12346")
        with pytest.raises(ConfigError):
            find_config(tmp_path)

    @root_only
    def test_a_link_of_another_owner(self, tmp_path: Path) -> None:
        link = tmp_path / "gpsfsm.toml"
        link.symlink_to(put(tmp_path, "mine", ""))
        os.lchown(link, 12345, 12345)
        with pytest.raises(ConfigError, match="it belongs to another user"):
            find_config(tmp_path)

    def test_the_system_s_files_are_everybody_s(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        file = put(tmp_path, "gpsfsm.toml", "")
        owner = file.stat().st_uid
        monkeypatch.setattr(os, "geteuid", lambda: 4711, raising=False)
        if owner == 0:
            assert find_config(tmp_path).file == str(file)
        else:
            with pytest.raises(ConfigError, match="it belongs to another user"):
                find_config(tmp_path)


class TestOfTheUser:
    KEYS = '[keys.OPENAI_API_KEY]\nhosts = ["api.openai.com", "http://gpu.example:8000"]\n'

    def test_where_it_lies(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("HOME", str(tmp_path))
        monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "xdg"))
        assert user_config_file() == tmp_path / "xdg" / "gpsfsm" / "config.toml"
        monkeypatch.setenv("XDG_CONFIG_HOME", "relative")
        assert user_config_file() == tmp_path / ".config" / "gpsfsm" / "config.toml"
        monkeypatch.delenv("XDG_CONFIG_HOME")
        assert user_config_file() == tmp_path / ".config" / "gpsfsm" / "config.toml"

    def put(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> Path:
        monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "xdg"))
        return put(tmp_path / "xdg" / "gpsfsm", "config.toml", text)

    def test_what_it_says(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        assert load_user_config() == Config(own=True)
        file = self.put(tmp_path, monkeypatch, f"jobs = 2\n{self.KEYS}")
        hosts = ("api.openai.com", "http://gpu.example:8000")
        assert load_user_config() == Config(
            str(file), {"jobs": 2}, keys={"OPENAI_API_KEY": hosts}, own=True
        )
        assert load_config(file) == load_user_config()

    def test_no_other_file_says_where_keys_go(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        own = self.put(tmp_path, monkeypatch, "")
        file = put(tmp_path, "gpsfsm.toml", self.KEYS)
        with pytest.raises(ConfigError) as caught:
            load_config(file)
        assert str(caught.value) == (
            f"{file}: a project file must not decide where keys are sent; put the table 'keys' "
            f"into your own configuration, {own}"
        )

    @pytest.mark.parametrize(
        "text",
        [
            'keys.OPENAI_API_KEY = ["api.openai.com"]',
            "[keys.OPENAI_API_KEY]\nhosts = 'api.openai.com'",
            "[keys.OPENAI_API_KEY]\nhosts = ['https://api.openai.com/v1']",
            "[keys.OPENAI_API_KEY]\nhosts = ['*']",
            "[keys.OPENAI_API_KEY]\nhosts = ['gpu.example:99999']",
            "[keys.OPENAI_API_KEY]\nhosts = ['[::::1]']",
            "[keys.OPENAI_API_KEY]\nhosts = ['']",
            "[keys.OPENAI_API_KEY]\nhosts = ['user@api.openai.com']",
            "[keys.OPENAI_API_KEY]\nhosts = ['\u0430pi.openai.com']",
            "[keys.OPENAI_API_KEY]\nhosts = ['x']\nports = [1]",
            "[keys.'sk-123']\nhosts = ['x']",
        ],
    )
    def test_what_does_not_fit(
        self, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.put(tmp_path, monkeypatch, text)
        with pytest.raises(ConfigError, match="must be a table with a list of hosts, such as"):
            load_user_config()

    def test_others_must_not_write_it(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        file = self.put(tmp_path, monkeypatch, self.KEYS)
        file.parent.chmod(0o777)
        with pytest.raises(ConfigError, match="correct the permissions of"):
            load_user_config()


def test_the_line_of_a_key_of_the_model(tmp_path: Path) -> None:
    text = 'jobs = 1\n[model]\nname = "vllm:x"\n"base-url" = "http://x"\n# name = 1\n'
    file = put(tmp_path, "gpsfsm.toml", text)
    places = load_config(file).places
    assert places == {"name": str(file), "base_url": f"{file}:4"}  # what is not sure is left out
