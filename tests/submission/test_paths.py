from hypothesis import given, settings
from hypothesis import strategies as st

from grader.submission.intake.paths import is_within, join, parents, shown


def test_a_newline_an_escape_and_an_override_of_the_text_direction_are_spelled_out() -> None:
    assert shown("a\nb\x1b[31m\u202ecod.py") == "a\\nb\\x1b[31m\\u202ecod.py"


@settings(deadline=None)
@given(st.text(st.characters()))
def test_what_is_shown_is_always_printable_and_can_be_written_as_utf_8(path: str) -> None:
    assert shown(path).isprintable()
    shown(path).encode("utf-8")


def test_the_folders_above_a_path() -> None:
    assert parents("a/b/c.py") == ["a/b", "a"]
    assert parents("c.py") == []


def test_the_submission_itself_is_a_dot() -> None:
    assert join(".", "setup.py") == "setup.py"
    assert join("src/bot", "setup.py") == "src/bot/setup.py"
    assert is_within("setup.py", ".")
    assert is_within("src/bot/setup.py", "src/bot")
    assert not is_within("src/bot_2/setup.py", "src/bot")
