from __future__ import annotations

import os
from pathlib import Path

from grader.recording.submission import Definition
from grader.submission.build.installed import hash_of, inspect, match_files
from grader.submission.build.tidy import tidy
from tests.submission.samples import Tree

SITE = "lib/python3.12/site-packages"


def install(tree: Tree) -> Path:
    root = tree.write(
        {
            "lib/bot_publisher/bot_pub": "#!/usr/bin/python3\n",
            "lib/bot_publisher/data.txt": "",
            "lib/libbot.so": "",
            "bin/stray": "",
            "share/ament_index/resource_index/packages/bot_publisher": "",
            f"{SITE}/bot_publisher/node.py": "x = 1\n",
            f"{SITE}/bot_publisher/__init__.py": "",
            f"{SITE}/bot_publisher/__pycache__/node.cpython-312.pyc": "",
            f"{SITE}/bot_publisher-0.0.0-py3.12.egg-info/entry_points.txt": (
                "[console_scripts]\nbot_pub = bot_publisher.node:main\n"
            ),
        }
    )
    (root / "lib/bot_publisher/bot_pub").chmod(0o755)
    return root


def test_names_that_are_no_text_are_left_out(tree: Tree) -> None:
    root = install(tree)
    expected = inspect(root, ["bot_publisher"], {})
    odd = os.fsdecode(b"\xff.py")
    for folder in ("bin", "lib/bot_publisher", SITE, f"{SITE}/{odd}.d", "share/bot_publisher/msg"):
        (root / folder).mkdir(parents=True, exist_ok=True)
        (root / folder / odd).touch(0o755)
    assert inspect(root, ["bot_publisher"], {}) == expected


def test_what_ros2_run_and_python_find_is_listed(tree: Tree) -> None:
    sources = {"src/bot/bot_publisher/node.py": hash_of(b"x = 1\n")}
    found = inspect(install(tree), ["bot_publisher", "other"], sources)
    assert found.executables == {"bot_publisher": ("bot_pub",), "other": ()}
    assert found.in_bin == ("stray",)
    assert found.registered == {"bot_publisher"}
    (entry,) = found.entry_points["bot_publisher"]
    assert (entry.name, entry.target) == ("bot_pub", "bot_publisher.node:main")
    assert set(found.python) == {
        "bot_publisher/__init__.py",
        "bot_publisher/node.py",
        "lib/bot_publisher/bot_pub",
        "lib/bot_publisher/data.txt",
    }
    assert found.origins == {"bot_publisher/node.py": "src/bot/bot_publisher/node.py"}


def test_what_is_shared_is_told_with_the_students_launch_files(tree: Tree) -> None:
    root = install(tree)
    (root / "share/bot_publisher/launch").mkdir(parents=True)
    (root / "share/bot_publisher/launch/bot.launch.py").write_text("y = 2\n")
    (root / "share/bot_publisher/package.xml").touch()
    sources = {"src/bot/launch/bot.launch.py": hash_of(b"y = 2\n")}
    assert inspect(root, ["bot_publisher"], sources).shared == {
        "bot_publisher": (
            ("package.xml", ""),
            ("launch/bot.launch.py", "src/bot/launch/bot.launch.py"),
        )
    }


def test_links_pipes_and_giant_metadata_are_not_read(tree: Tree) -> None:
    root = install(tree)
    metadata = root / SITE / "bot_publisher-0.0.0-py3.12.egg-info/entry_points.txt"
    metadata.write_text("#" * 300_000)
    (root / "lib/bot_publisher/link").symlink_to("/bin/sh")
    os.mkfifo(root / SITE / "pipe.py")
    found = inspect(root, ["bot_publisher"], {})
    assert found.executables["bot_publisher"] == ("bot_pub",)
    assert found.entry_points == {"bot_publisher": ()}
    assert "pipe.py" not in found.python


def test_definitions_count_where_code_was_generated_from_them(tmp_path: Path) -> None:
    for file in ("msg/Bot.msg", "msg/Bot.json", "msg/Bot.idl", "msg/Other.msg", "srv/Add.srv"):
        path = tmp_path / "share/bot" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file)
    found = inspect(tmp_path, ["bot"], {}).definitions
    assert found == {"bot": (Definition("msg/Bot.msg", "msg/Bot.msg"),)}


def test_of_equal_files_the_one_with_the_most_similar_path_is_the_origin() -> None:
    installed = {"bot/__init__.py": "empty", "bot/nodes/__init__.py": "empty", "made.py": "?"}
    sources = dict.fromkeys(
        ("src/bot/bot/__init__.py", "src/bot/bot/nodes/__init__.py", "src/bot/test/__init__.py"),
        "empty",
    )
    assert match_files(installed, sources) == {
        "bot/__init__.py": "src/bot/bot/__init__.py",
        "bot/nodes/__init__.py": "src/bot/bot/nodes/__init__.py",
    }


def test_an_install_space_is_tidied_before_it_is_read(tmp_path: Path) -> None:
    install = tmp_path / "install"
    (install / "lib").mkdir(parents=True)
    (install / "lib/libx.so.1").touch()
    (install / "lib/libx.so").symlink_to("libx.so.1")
    assert tidy(install, tmp_path / "src", most_bytes=10**6, most_files=10) is None
    assert {path.name for path in (install / "lib").iterdir()} == {"libx.so.1", "libx.so"}
    assert tidy(install, tmp_path / "src", most_bytes=1000, most_files=1) is not None
    assert not install.exists()


def test_links_to_the_sources_or_to_nothing_go_and_cost_nothing(tmp_path: Path) -> None:
    install, sources = tmp_path / "install", tmp_path / "src"
    (install / "lib").mkdir(parents=True)
    sources.mkdir()
    (sources / "x.yaml").touch()
    (install / "lib/x.yaml").symlink_to(sources / "x.yaml")
    (install / "lib/gone.yaml").symlink_to("/home/student/ros2_ws/src/gone.yaml")
    (install / "lib/nothing.sh").symlink_to("nothing")
    (install / "lib/long.sh").symlink_to("a" * 300)
    assert tidy(install, sources, most_bytes=10**6, most_files=10) is None
    assert list((install / "lib").iterdir()) == []


def test_a_link_within_an_install_space_still_leads_there_when_it_was_moved(tmp_path: Path) -> None:
    install = tmp_path / "install"
    (install / "lib/bot").mkdir(parents=True)
    (install / "bin").mkdir()
    (install / "lib/bot/talk").write_text("hello")
    (install / "bin/talk").symlink_to(install / "lib/bot/talk")
    assert tidy(install, tmp_path / "src", most_bytes=10**6, most_files=10) is None
    moved = install.rename(tmp_path / "moved")
    assert (moved / "bin/talk").read_text() == "hello"


def test_what_leads_out_of_an_install_space_is_named_and_nothing_of_it_is_used(
    tmp_path: Path,
) -> None:
    install = tmp_path / "install"

    def refused() -> str | None:
        return tidy(install, tmp_path / "src", most_bytes=10**6, most_files=10)

    (install / "lib").mkdir(parents=True)
    (install / "lib/etc").symlink_to("/etc")
    assert refused() == "the build installed 'lib/etc', a link out to '/etc'"
    assert not install.exists()
    (install / "lib").mkdir(parents=True)
    (install / "lib/up").symlink_to("../../..")
    os.mkfifo(install / "lib/pipe")
    assert refused() == "the build installed 'lib/pipe', which is not a file, folder or link"
    assert not install.exists()


def test_a_link_in_place_of_the_install_space_is_taken_away(tmp_path: Path) -> None:
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious/link").symlink_to("/etc")
    (tmp_path / "install").symlink_to("precious")
    assert tidy(tmp_path / "install", tmp_path, most_bytes=1000, most_files=10) is not None
    assert (tmp_path / "precious/link").is_symlink()
    assert not (tmp_path / "install").exists()
