from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.submission.read.setup_py import Setup, parse_entry_point, parse_installed, read_setup
from tests.submission.samples import SETUP_PY


def setup(source: str) -> Setup:
    return read_setup(source.encode(), "src/bot")


def test_what_ros2_pkg_create_writes_is_read() -> None:
    found = setup(SETUP_PY)
    assert found.name == "bot_publisher"
    (entry,) = found.entry_points
    assert (entry.name, entry.target) == ("bot_pub", "bot_publisher.node:main")
    assert (entry.file, entry.line) == ("src/bot/setup.py", 21)


@pytest.mark.parametrize(
    "script",
    [
        "f'pub = {name}.node:main'",
        "'pub = ' + name + '.node:main'",
        "'  pub=bot.node : main  '",
        "'pub = bot.node:main [extra]'",
        "'pub = ' 'bot.node:main'",
        "SCRIPT",
    ],
)
def test_entry_points_made_of_a_name_are_read(script: str) -> None:
    source = f"""
name = 'bot'
SCRIPT = f'pub = {{name}}.node:main'
GROUPS = {{'gui_scripts': [], 'console_scripts': ({script}, unknown())}}
import setuptools
setuptools.setup(name=name, entry_points=GROUPS)
"""
    assert [(e.name, e.target) for e in setup(source).entry_points] == [("pub", "bot.node:main")]


def test_a_malformed_entry_point_is_none() -> None:
    found = setup("setup(entry_points={'console_scripts': [\n 'pub : bot.node:main',\n 'x']})")
    assert found.entry_points == ()


@pytest.mark.parametrize(
    "source",
    [
        "def",
        "x = 1",
        "setup(",
        "setup(*a, **b)",
        f"setup(name={'+'.join(['x'] * 10_000)})",
        "a0 = ['x']\n"
        + "\n".join(f"a{n} = [a{n - 1}, a{n - 1}]" for n in range(1, 60))
        + "\nsetup(entry_points={'console_scripts': a59})",
        "a0 = 'xx'\n"
        + "\n".join(f"a{n} = a{n - 1} + a{n - 1}" for n in range(1, 60))
        + "\nsetup(entry_points={'console_scripts': [a59]})",
        "setup(entry_points={'console_scripts': [f'{\"a\":>999999999}']})",
    ],
    ids=["def", "none", "open", "stars", "deep", "lists", "texts", "format"],
)
def test_a_setup_py_that_says_nothing_or_too_much_declares_nothing(source: str) -> None:
    assert setup(source) == Setup()


def test_an_installed_file_is_read() -> None:
    text = "[a]\nx = y\n[console_scripts]\nPub = bot.node:main\nb = c:d [e]\n\n[other]\nx = y\n"
    assert [(e.name, e.target) for e in parse_installed(text, "setup.py")] == [
        ("Pub", "bot.node:main"),
        ("b", "c:d"),
    ]
    assert parse_installed("no section", "setup.py") == []


@settings(deadline=None)
@given(st.text(max_size=60))
def test_no_text_of_an_entry_point_raises(text: str) -> None:
    parse_entry_point(text, "setup.py")
    parse_installed(f"[console_scripts]\n{text}", "setup.py")
    setup(f"setup(entry_points={{'console_scripts': [{text!r}, {text!r} + 'a']}})")


def test_a_missing_comma_between_entry_points_is_found_with_its_line() -> None:
    source = """setup(
    entry_points={
        'console_scripts': [
            'talk = bot.talk:main'
            'listen = bot.listen:main',
            'bot.other:main',
        ],
    },
)
"""
    comma, form = read_setup(source.encode(), "bot").refused
    assert (comma.file, comma.line) == ("bot/setup.py", 4)
    assert comma.message.startswith("a comma is missing between two entries of console_scripts")
    assert form.line == 6


def test_an_empty_setup_py_is_called_empty() -> None:
    (error,) = read_setup(b"\n", "bot").refused
    assert str(error) == "bot/setup.py: the file is empty"


@pytest.mark.parametrize(
    "scripts",
    ["['', 'talk = bot.talk:main']", "'talk = bot.talk:main\\n# more\\nhear = bot.hear:main'"],
)
def test_what_setuptools_takes_is_not_refused(scripts: str) -> None:
    found = setup(f"setup(entry_points={{'console_scripts': {scripts}}})")
    assert not found.refused
    assert found.entry_points[0].name == "talk"
