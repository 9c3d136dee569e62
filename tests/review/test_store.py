"""Review files: whole, of one writer at a time, and never replaced when they cannot be read."""

import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.errors import RosgradeError, UsageError
from grader.review.model import (
    BankEntry,
    ClassReview,
    Comment,
    Forgiven,
    ManualScore,
    StudentReview,
)
from grader.review.store import ReviewConflict, ReviewStore, Saved
from grader.spec.document import parse_yaml, write_yaml

REVIEW = StudentReview(
    key="ana",
    manual={"readme": ManualScore(points=1.5, by="AB", note="no: launch command")},
    comments=(Comment(text="Nice.\nBut see REP-144.", by="AB", file="src/bot.py", line=3),),
    notes="answered well",
)


@pytest.fixture
def store(tmp_path: Path) -> ReviewStore:
    return ReviewStore(tmp_path)


def texts(store: ReviewStore, key: str) -> list[str]:
    return [comment.text for comment in store.student(key).content.comments]


def commented(review: StudentReview, text: str) -> StudentReview:
    comments = (*review.comments, Comment(text=text, by="AB"))
    return review.model_copy(update={"comments": comments})


def test_what_is_written_is_read(store: ReviewStore) -> None:
    of_class = ClassReview(
        bank=(BankEntry(text="1e-3", used=2),),
        forgiven=(Forgiven(check="period", cause="median …", share=0.5, by="yes"),),
    )
    assert store.student("ana") == Saved(StudentReview(key="ana"), "")
    for review, read in ((REVIEW, lambda: store.student("ana")), (of_class, store.of_class)):
        version = store.save(review, "")
        assert read() == Saved(review, version)
        assert ReviewStore(store.folder.parent).of_class().content == store.of_class().content


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_text_survives_the_yaml(text: str) -> None:
    written = write_yaml({"text": text, "list": [text]})
    assert parse_yaml(written, Path("x.yaml"))[0] == {"text": text, "list": [text]}


def test_of_two_reviewers_at_once_the_second_is_told_and_nothing_is_lost(
    store: ReviewStore,
) -> None:
    version = store.save(REVIEW, "")
    store.save(commented(REVIEW, "first"), version)
    with pytest.raises(ReviewConflict, match=r"ana\.yaml: was changed meanwhile") as caught:
        store.save(commented(REVIEW, "second"), version)
    assert "\n" not in str(caught.value)
    assert texts(store, "ana")[-1] == "first"


def test_many_writers_lose_no_comment(store: ReviewStore) -> None:
    def write(name: str) -> None:
        while True:
            saved = store.student("ana")
            try:
                store.save(commented(saved.content, name), saved.version)
            except ReviewConflict:
                continue
            return

    writers = [threading.Thread(target=write, args=(f"{number}",)) for number in range(8)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert sorted(texts(store, "ana")) == sorted(f"{number}" for number in range(8))


def test_an_undo_works_after_a_restart_down_to_the_first_write(store: ReviewStore) -> None:
    first = store.save(REVIEW, "")
    second = store.save(commented(REVIEW, "more"), first)
    again = ReviewStore(store.folder.parent)
    assert again.undo("ana", second) == first
    assert again.student("ana") == Saved(REVIEW, first)
    assert again.undo("ana", first) == ""
    assert not store.file("ana").exists()
    with pytest.raises(UsageError, match="nothing to undo"):
        again.undo("ana", "")


def test_no_one_undoes_what_another_person_wrote(store: ReviewStore) -> None:
    mine = store.save(REVIEW, "")
    store.save(commented(REVIEW, "theirs"), mine)
    with pytest.raises(ReviewConflict):
        store.undo("ana", mine)
    assert texts(store, "ana")[-1] == "theirs"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("key: ana\nmanual: [1.5]\n", "ana.yaml:2: manual: "),
        ("key: ana\nmanual:\n  readme: {points: -1, by: AB}\n", "ana.yaml:3: manual.readme.points"),
        ("key: ana\ncomments: {\n", "ana.yaml:3: not valid YAML"),
        ("key: ana\nmaunal: {}\n", "ana.yaml:2: "),
        ("", "ana.yaml:1: the file is empty"),
        ("key: ben\n", "is the file of ana, not of ben"),
    ],
)
def test_nonsense_is_one_error_with_its_line_and_is_never_overwritten(
    store: ReviewStore, text: str, message: str
) -> None:
    file = store.file("ana")
    file.parent.mkdir()
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RosgradeError) as caught:
        store.student("ana")
    assert message in str(caught.value)
    if text:
        with pytest.raises(ReviewConflict):
            store.save(REVIEW, "")
    assert file.read_text(encoding="utf-8") == text


def test_students_who_are_gone_keep_their_file_and_are_named(store: ReviewStore) -> None:
    for key in ("ana", "class", "Bö/../x"):
        store.save(StudentReview(key=key, notes="x"), "")
    store.save(ClassReview(), "")
    assert store.student("class").content.notes == "x"
    assert store.vanished({"ana"}) == tuple(
        key for key in ("Bö/../x", "class") if store.file(key).is_file()
    )
    assert {file.parent for file in map(store.file, ("ana", "class", "Bö/../x"))} == {store.folder}
