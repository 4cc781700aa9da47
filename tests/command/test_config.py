"""The user's own defaults: where they are looked for, for which commands they hold, and what wins."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from conftest import printed

from clpeel.command import config
from clpeel.command.main import main
from clpeel.command.parser import parse


@pytest.fixture
def users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The path of the user's file, which is not there yet."""
    monkeypatch.delenv(config.VARIABLE)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "clpeel").mkdir()
    return tmp_path / "clpeel" / "config.toml"


def test_tests_have_no_settings() -> None:
    assert os.environ[config.VARIABLE] == "" and config.users_file() is None


def test_it_is_looked_for_once(users: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked, stat = list[Any](), os.stat
    monkeypatch.setattr(os, "stat", lambda path, *rest, **more: (asked.append(path), stat(path, *rest, **more))[1])
    assert config.users_file() is None and asked == [str(users)]


def test_where_it_is(users: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    users.write_text("")
    assert config.users_file() == str(users)
    monkeypatch.setenv("XDG_CONFIG_HOME", "")
    monkeypatch.setenv("HOME", str(users.parent.parent))
    assert config.users_file() is None
    (users.parent.parent / ".config").mkdir()
    users.parent.rename(users.parent.parent / ".config" / "clpeel")
    assert config.users_file() == str(users.parent.parent / ".config" / "clpeel" / "config.toml")
    monkeypatch.chdir(users.parent.parent)
    monkeypatch.setenv("XDG_CONFIG_HOME", ".config")
    assert config.users_file() is None  # such a variable is to be ignored, says its specification
    monkeypatch.setenv(config.VARIABLE, "other.toml")
    assert config.users_file() == "other.toml"


def test_for_all_commands_and_for_one(users: Path) -> None:
    users.write_text('resolution = "30,20"\ngrid = true\nopacity = 0.5\n[render]\nsamples = 16\nopacity = 0.25\n')
    options = parse(["render", "a.ply"])
    assert (options.resolution, options.grid, options.samples) == ((30, 20), True, 16)
    assert options.pieces[0].options == {"opacity": 0.25}
    options = parse(["complexity", "a.ply"])  # which has no grid
    assert options.resolution == (30, 20) and options.pieces[0].options == {"opacity": 0.5}
    assert parse(["demo"]).samples == 16 and parse(["techniques"]).verbose is False


def test_what_wins(users: Path, tmp_path: Path) -> None:
    users.write_text("samples = 16\ngrid = true\nopacity = 0.5\naxis = true\n")
    (tmp_path / "s.toml").write_text('samples = 4\n[[mesh]]\npath = "a.ply"\nopacity = 0.25\n[[mesh]]\npath = "b.ply"')
    options = parse(["render", str(tmp_path / "s.toml"), "--no-axis"])
    assert (options.samples, options.grid, options.axis) == (4, True, False)
    assert [piece.options["opacity"] for piece in options.pieces] == [0.25, 0.5]
    assert options.origins["samples"].endswith("s.toml") and options.origins["grid"] == str(users)
    assert parse(["render", "a.ply", "--samples=1"]).samples == 1
    assert (parse(["render", "a.ply", "--no-config"]).samples, parse(["render", "a.ply"]).samples) == (None, 16)
    (tmp_path / "other.toml").write_text("samples = 8\n")
    options = parse(["render", "a.ply", "--config", str(tmp_path / "other.toml")])
    assert (options.samples, options.grid) == (8, False)  # it stands in the place of the user's file


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("smaples = 16\n", "unknown key 'smaples'; did you mean samples?"),
        ("[rendr]\nsamples = 16\n", "unknown key 'rendr'; did you mean render?"),
        ("[render]\njson = 'x'\n", "[render]: unknown key 'json'"),
        ("[render]\nsamples = 'x'\n", "[render]: samples: expected a whole number of 1 or more, got 'x'"),
        ("render = 3\n", "render: expected a table, [render], got 3"),
        ("technique = 'srot'\n", "technique: expected one of sort"),
        ("samples = 16\nsamples = 4\n", "not TOML: Cannot overwrite a value"),
    ],
)
def test_what_is_wrong_is_one_line(
    users: Path, text: str, error: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    users.write_text(text)
    assert main(["render", "a.ply", "-o", str(tmp_path / "x.png")]) == 2
    _, lines = printed(capfd)
    assert len(lines) == 1 and lines[0].startswith(f"clpeel: error: {users}: ") and error in lines[0], lines


def test_a_device_that_is_gone_is_found_in_the_file(users: Path, capfd: pytest.CaptureFixture[str]) -> None:
    users.write_text('device = "no such device"\n')
    assert main(["demo", "-o", str(users.parent / "x.png")]) == 3
    _, lines = printed(capfd)
    assert len(lines) == 1 and lines[0].startswith(f"clpeel: error: {users}: device: expected a number or part"), lines


def test_wrong_files_are_one_line(users: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for words, error in (
        (["--config=no.toml"], "no.toml: no such file"),
        ([f"--config={tmp_path}"], "cannot be read: Is a directory"),
        (["--config=a.toml", "--no-config"], "--config: expected no --no-config with it, got both"),
    ):
        assert main(["render", "a.ply", *words]) == 2
        _, lines = printed(capfd)
        assert len(lines) == 1 and error in lines[0], lines


def test_verbose_says_where_a_value_comes_from(users: Path, capfd: pytest.CaptureFixture[str]) -> None:
    users.write_text("samples = 16\n[render]\ngrid = true\n")
    assert main(["render", "no-such.ply", "--verbose"]) == 2
    _, lines = printed(capfd)
    assert f"clpeel: samples from {users}" in lines and f"clpeel: grid from {users}: [render]" in lines


def test_help_and_version_never_read_it(users: Path, capfd: pytest.CaptureFixture[str]) -> None:
    users.write_text("not TOML at all")
    assert main(["--help"]) == main(["render", "--help"]) == main(["--version"]) == 0
    assert printed(capfd)[1] == []
