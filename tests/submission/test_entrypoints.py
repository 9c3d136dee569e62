from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.submission.read.entrypoints import Setup, parse_entry_point, parse_installed, read_setup
from tests.submission.samples import SETUP_CFG, SETUP_PY


def setup(source: str, config: str = "") -> Setup:
    return read_setup(source.encode(), config.encode(), "src/bot")


def targets(source: str, config: str = "") -> list[tuple[str, str]]:
    return [(entry.name, entry.target) for entry in setup(source, config).entry_points]


def test_what_ros2_pkg_create_writes_is_read() -> None:
    found = setup(SETUP_PY, SETUP_CFG)
    assert found.name == "bot_publisher"
    assert found.package_dir == "."
    (entry,) = found.entry_points
    assert (entry.name, entry.target) == ("bot_pub", "bot_publisher.node:main")
    assert (entry.file, entry.line) == ("src/bot/setup.py", 21)


@pytest.mark.parametrize(
    "script",
    [
        "f'pub = {name}.node:main'",
        "'pub = ' + name + '.node:main'",
        "'pub = %s.node:main' % name",
        "'%s = %s.node:%s' % ('pub', name, 'main')",
        "'pub = {}.node:main'.format(name)",
        "'{1} = {0}.node:main'.format(name, 'pub')",
        "'pub = {n}.node:main'.format(n=name)",
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
from setuptools import setup
setup(name=name, entry_points={{'console_scripts': [{script}]}})
"""
    assert targets(source) == [("pub", "bot.node:main")]


@pytest.mark.parametrize(
    "arguments",
    [
        "entry_points={'console_scripts': ('pub = bot.node:main',)}",
        "entry_points={'console_scripts': ['pub = bot.node:main'] + []}",
        "entry_points={'console_scripts': 'pub = bot.node:main'}",
        "entry_points={'gui_scripts': [], **{'console_scripts': ['pub = bot.node:main']}}",
        "entry_points=dict(console_scripts=['pub = bot.node:main', unknown()])",
        "entry_points='[console_scripts]\\npub = bot.node:main\\n[other]\\nx = y:z'",
        "**ARGUMENTS",
    ],
)
def test_entry_points_in_every_container_are_read(arguments: str) -> None:
    source = f"""
import setuptools
ARGUMENTS = {{'entry_points': {{'console_scripts': ['pub = bot.node:main']}}}}
setuptools.setup({arguments})
"""
    assert targets(source) == [("pub", "bot.node:main")]


def test_setup_cfg_is_read_and_setup_py_wins() -> None:
    config = "[metadata]\nname = bot\n[options.entry_points]\nconsole_scripts =\n  Pub = b.n:main\n"
    assert targets("from setuptools import setup\nsetup()\n", config) == [("Pub", "b.n:main")]
    assert setup("setup()", config).name == "bot"
    assert targets(SETUP_PY, config) == [("bot_pub", "bot_publisher.node:main")]


def test_a_setup_cfg_with_colons_is_read() -> None:
    config = "[develop]\nscript_dir: $base\n[options.entry_points]\nconsole_scripts =\n p = b.n:m\n"
    assert targets("setup()", config) == [("p", "b.n:m")]


def test_a_setup_cfg_that_nobody_can_read_says_nothing() -> None:
    assert setup("setup(name='bot')", "[metadata]\nname\n  other\n").name == "bot"
    assert parse_installed("[console_scripts]\npub\n  bot.node:main\n", "setup.py") == []


def test_packages_below_src_are_said_to_be_there() -> None:
    assert setup("setup(package_dir={'': 'src'})").package_dir == "src"


def test_what_must_be_run_is_not_guessed() -> None:
    source = """
x = 'a'
x = 'b'
setup(name=x, version=open('v').read(), entry_points={'console_scripts': [x, name(), '%d' % 1]})
"""
    assert setup(source) == Setup()


def test_a_malformed_entry_point_is_told_with_its_line() -> None:
    found = setup("setup(entry_points={'console_scripts': [\n 'pub : bot.node:main',\n 'x']})")
    assert found.entry_points == ()
    assert [str(error) for error in found.malformed] == [
        "src/bot/setup.py:2: the entry point 'pub : bot.node:main' is not of the form "
        "'name = module:function'",
        "src/bot/setup.py:3: the entry point 'x' is not of the form 'name = module:function'",
    ]


@pytest.mark.parametrize("source", ["", "def", "x = 1", "setup(", "setup(*a, **b)", "setup(**x)"])
def test_a_setup_py_that_says_nothing_declares_nothing(source: str) -> None:
    assert setup(source) == Setup()


def test_names_that_double_at_every_level_end() -> None:
    doubling = "\n".join(f"a{n} = [a{n + 1}, a{n + 1}]" for n in range(40))
    assert setup(f"{doubling}\na40 = 'x'\nsetup(entry_points={{'console_scripts': a0}})") == Setup()


def test_a_format_that_fills_the_memory_is_not_carried_out() -> None:
    scripts = "['%999999999s' % 'a', '{:999999999}'.format('a'), f'{\"a\":>999999999}', A, A + A]"
    source = f"A = {'a' * 9000!r}\nsetup(entry_points={{'console_scripts': {scripts}}})"
    assert setup(source).entry_points == ()


def test_an_installed_file_is_read() -> None:
    text = "[console_scripts]\nPub = bot.node:main\n\n[other]\nx = y\n"
    assert [(e.name, e.target) for e in parse_installed(text, "setup.py")] == [
        ("Pub", "bot.node:main")
    ]
    assert parse_installed("no section", "setup.py") == []


@settings(deadline=None)
@given(st.text(max_size=60))
def test_no_text_of_an_entry_point_raises(text: str) -> None:
    parse_entry_point(text, "setup.py")
    parse_installed(text, "setup.py")
    setup(
        f"setup(entry_points={{'console_scripts': [{text!r}, {text!r} % 'a', {text!r}.format()]}})"
    )
