"""package.file."""

from __future__ import annotations

from grader.findings.finding import Status
from tests.checks.builder import failing, judge, package, submission

NAME = "bot_publisher"
LAUNCH = {"package": NAME, "path": "launch/*.launch.py"}
MANIFEST = ("package.xml", "")


def test_an_installed_file_passes() -> None:
    shared = (MANIFEST, ("launch/bot.launch.py", "src/bot_publisher/launch/bot.launch.py"))
    finding = judge("package.file", submission(package(shared=shared)), **LAUNCH)
    assert finding.status is Status.PASSED
    assert "`launch/bot.launch.py`" in finding.observed


def test_a_file_that_is_handed_in_but_not_installed_is_named() -> None:
    subject = submission(package(shared=(MANIFEST,)), files=("bot/launch/bot.launch.py",))
    text = failing("package.file", subject, **LAUNCH)
    assert "`bot/launch/bot.launch.py` is handed in, but not installed" in text
    assert "data_files" in text


def test_a_missing_file_of_a_cmake_package_is_to_be_added_and_installed() -> None:
    subject = submission(package(shared=(MANIFEST,), build_type="ament_cmake"))
    text = failing("package.file", subject, **LAUNCH)
    assert "Add the file" in text
    assert "install(DIRECTORY launch DESTINATION" in text


def test_a_record_from_before_there_was_this_check_is_an_error() -> None:
    assert judge("package.file", submission(), **LAUNCH).status is Status.ERROR


def test_a_file_of_the_kind_is_used_instead_and_only_its_name_is_wrong() -> None:
    def names(path: str, *installed: str) -> list[str]:
        shared = (MANIFEST, *((one, "") for one in installed))
        subject = submission(package(shared=shared))
        asked = {"package": NAME, "path": path}
        assert not judge("package.file", subject, **asked).names
        return [one.own for one in judge("package.file", subject, **asked, remap=True).names.wrong]

    right = "launch/bot.launch.py"
    share = f"share/{NAME}"
    assert names(right, "launch/robot.launch.py", "launch/bot.launch.xml") == [
        f"{share}/launch/robot.launch.py"
    ]
    assert names(right, "bot.launch.py", "launch/robot.launch.py") == [f"{share}/bot.launch.py"]
    assert names(right, "launch/bots.launch.py", "launch/robot.launch.py") == [
        f"{share}/launch/bots.launch.py"
    ]
    assert names(right, "launch/bot.xml") == []
    assert names("launch/*.launch.py", "launch/bot.py") == []
