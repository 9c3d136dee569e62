"""Who handed in what, from what learning platforms give an instructor."""

from __future__ import annotations

import os
import subprocess
import unicodedata
import zipfile
from pathlib import Path

import pytest

from grader.batch.intake import collect, collect_roster
from grader.batch.roster import Roster, Student, parse_roster, read_roster
from grader.errors import UsageError
from grader.submission.read.manifest import MANIFEST


def folder(path: Path) -> Path:
    """A submission with a file in it."""
    (path / "pkg").mkdir(parents=True)
    (path / "pkg" / "package.xml").write_text("<package/>")
    return path


def archive(path: Path) -> Path:
    """A submission as a zip."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("pkg/package.xml", "<package/>")
    return path


@pytest.fixture
def staging(tmp_path: Path) -> Path:
    made = tmp_path / "staging"
    made.mkdir()
    return made


@pytest.fixture
def course(tmp_path: Path) -> Path:
    made = tmp_path / "class"
    made.mkdir()
    return made


def test_folders_and_archives_are_named_after_themselves(course: Path, staging: Path) -> None:
    folder(course / "ana")
    archive(course / "ben.zip")
    (course / "notes.txt").write_text("not a submission")
    (course / ".DS_Store").write_text("")
    rows = collect(course, staging)
    assert [(row.key, row.path) for row in rows] == [
        ("ana", course / "ana"),
        ("ben", course / "ben.zip"),
    ]


@pytest.mark.parametrize("suffix", [".rar", ".7z", ".RAR"])
def test_an_archive_of_a_kind_that_cannot_be_read_is_a_row_all_the_same(
    course: Path, staging: Path, suffix: str
) -> None:
    (course / f"ana{suffix}").write_bytes(b"Rar!")
    (row,) = collect(course, staging, Roster((Student(2, login="ana"),)))
    assert (row.key, row.path) == ("ana", course / f"ana{suffix}")


def test_files_that_are_taken_for_no_submission_are_named(course: Path, staging: Path) -> None:
    folder(course / "ana")
    (course / "ben.py").write_text("pass")
    (course / ".DS_Store").write_text("")
    (course / "__MACOSX").mkdir()
    left_out: list[str] = []
    collect(course, staging, None, left_out.append)
    assert left_out == ["ben.py is neither a folder nor an archive, so it is left out"]


def test_canvas_names_are_read(course: Path, staging: Path) -> None:
    archive(course / "lopezana_LATE_90211_1234567_workspace-2.zip")
    (course / "ngwei_90212_77_package.xml").write_text("<package/>")
    (course / "ngwei_90212_78_my_node.py").write_text("pass")
    roster = parse_roster('Student,ID\n"Lopez, Ana",90211\n"Ng, Wei",90212\n', "r.csv")
    ana, wei = collect(course, staging, roster)
    assert (ana.key, ana.name, ana.late, ana.problem) == ("90211", "Lopez, Ana", True, "")
    assert (wei.key, wei.late) == ("90212", False)
    assert wei.path is not None
    assert sorted(file.name for file in wei.path.iterdir()) == ["my_node.py", "package.xml"]


def test_gradescope_s_export_is_read(course: Path, staging: Path) -> None:
    folder(course / "submission_11")
    folder(course / "submission_12")
    (course / "submission_metadata.yml").write_text(
        "submission_11:\n  :submitters:\n  - :name: Ana Lopez\n    :sid: '7'\n"
        "    :email: ana@example.edu\n  :created_at: 2026-10-01 10:00:00 Z\n"
        "submission_12:\n  :submitters:\n  - :name: Wei Ng\n    :email: wei@example.edu\n"
    )
    rows = collect(course, staging)
    named = [(row.key, row.name) for row in rows]
    assert named == [("7", "Ana Lopez"), ("wei@example.edu", "Wei Ng")]


def canvas_files(course: Path, *names: str) -> None:
    """Files of one student; an archive holds a package of the same name."""
    for number, name in enumerate(names):
        file = course / f"lopezana_90211_{number}_{name}"
        if name.endswith(".zip"):
            with zipfile.ZipFile(file, "w") as made:
                made.writestr(f"{name.removesuffix('.zip')}/{MANIFEST}", "<package/>")
        else:
            file.write_text("text")


def test_a_report_beside_the_archive_in_canvas_takes_no_points(course: Path, staging: Path) -> None:
    canvas_files(course, "report.pdf", "ws-1.zip", "Comment.TXT")
    (row,) = collect(course, staging)
    assert (row.path, row.fault) == (course / "lopezana_90211_1_ws-1.zip", "")


def test_several_archives_in_canvas_are_unpacked_side_by_side(course: Path, staging: Path) -> None:
    canvas_files(course, "bot.zip", "bot_msgs.zip", "report.pdf")
    (course / "lopezana_90211_9_broken.zip").write_text("no archive")
    (row,) = collect(course, staging)
    assert row.path is not None
    files = sorted(str(f.relative_to(row.path)) for f in row.path.rglob("*") if f.is_file())
    assert files == [
        "bot.zip/bot/package.xml",
        "bot_msgs.zip/bot_msgs/package.xml",
        "broken.zip",
        "report.pdf",
    ]


def test_of_an_archive_that_canvas_has_twice_the_last_one_counts(
    course: Path, staging: Path
) -> None:
    for attachment, name in ((99, "ws.zip"), (100, "ws-1.zip")):
        archive(course / f"lopezana_90211_{attachment}_{name}")
    (row,) = collect(course, staging)
    assert row.path == course / "lopezana_90211_100_ws-1.zip"
    assert row.download == "lopezana_90211_100_ws-1.zip"


def test_two_archives_of_one_name_and_two_numbers_leave_a_note(course: Path, staging: Path) -> None:
    for attachment, name in ((99, "x-1.zip"), (100, "x-2.zip")):
        archive(course / f"lopezana_90211_{attachment}_{name}")
    (row,) = collect(course, staging)
    assert row.path == course / "lopezana_90211_100_x-2.zip"
    assert row.problem.startswith("x-1.zip and x-2.zip are taken for one archive")


def test_canvas_says_when_something_was_handed_in(course: Path, staging: Path) -> None:
    archive(course / "lopezana_LATE_90211_1_ws.zip")
    archive(course / "ngwei_90212_2_ws.zip")
    told = '[{"user_id": 90211, "submitted_at": "2026-10-12T22:20:00Z"}]'
    (course / "submissions-1.json").write_text(told)
    left_out: list[str] = []
    ana, wei = collect(course, staging, None, left_out.append)
    assert (ana.handed_in, ana.handed_in_from) == ("2026-10-12T22:20:00+00:00", "Canvas")
    assert (wei.handed_in, left_out) == ("", [])
    (course / "submissions-1.json").write_text('{"errors": []}')
    with pytest.raises(UsageError, match=r"submissions-1\.json: is no list of submissions"):
        collect(course, staging)


@pytest.mark.parametrize("content", ['{"a": 1}', "[1]", "{", '[{"submitted_at": "2026-10-12"}]'])
def test_a_foreign_file_beside_the_archive_of_a_class_refuses_nobody(
    tmp_path: Path, staging: Path, content: str
) -> None:
    (tmp_path / "submissions-index.json").write_text(content)
    (tmp_path / "submissions.json").write_text(
        '[{"user_id": 90211, "submitted_at": "2026-10-12T22:20:00Z"}]'
    )
    for name in ("lopezana_90211_1_ws", "ana"):
        with zipfile.ZipFile(tmp_path / f"{name}-class.zip", "w") as made:
            made.write(archive(tmp_path / f"{name}.zip"), f"{name}.zip")
    left_out: list[str] = []
    for one, told in (("lopezana_90211_1_ws", "Canvas"), ("ana", "")):
        (staging / one).mkdir()
        (row,) = collect(tmp_path / f"{one}-class.zip", staging / one, None, left_out.append)
        assert row.handed_in_from == told
    assert left_out == [
        "submissions-index.json is no list of submissions of Canvas, so it is left out"
    ]


def test_moodle_s_folders_and_files_are_read(course: Path, staging: Path) -> None:
    ana = course / "Ana Lopez_4711_assignsubmission_file_"
    archive(ana / "my_ws.zip")
    (ana / "report.pdf").write_text("text")
    archive(course / "Wei Ng_4712_assignsubmission_file_ws.zip")
    roster = parse_roster('login,name\nana,"Lopez, Ana"\nwei,Wei Ng\n', "r.csv")
    rows = collect(course, staging, roster)
    assert [(row.key, row.path) for row in rows] == [
        ("ana", ana / "my_ws.zip"),
        ("wei", course / "Wei Ng_4712_assignsubmission_file_ws.zip"),
    ]


@pytest.mark.parametrize("beside", [".git/HEAD", "package.xml", "src/node.py", "b.zip", None])
def test_an_archive_within_a_submission_is_not_taken_for_it(
    course: Path, staging: Path, tmp_path: Path, beside: str | None
) -> None:
    other = archive(tmp_path / "elsewhere.zip")
    if beside is None:
        (course / "ana").mkdir()
        (course / "ana" / "ws.zip").symlink_to(other)
    else:
        archive(course / "ana" / "ws.zip")
        (course / "ana" / beside).parent.mkdir(exist_ok=True)
        (course / "ana" / beside).write_text("")
    (row,) = collect(course, staging)
    assert row.path == course / "ana"


TEAM = (
    "submission_11:\n  :submitters:\n  - :name: Ana Lopez\n    :sid: '7'\n"
    "    :email: ana@example.edu\n  - :name: Bo Du\n    :email: bo@example.edu\n  - :name: Cy\n"
)


def test_everybody_of_a_team_in_gradescope_s_export_has_a_row(course: Path, staging: Path) -> None:
    folder(course / "submission_11")
    (course / "submission_metadata.yml").write_text(TEAM)
    assert [(row.key, row.name) for row in collect(course, staging)] == [
        ("7", "Ana Lopez"),
        ("Cy", "Cy"),
        ("bo@example.edu", "Bo Du"),
    ]
    roster = parse_roster("login,id,email,name\nal,7,,\nbd,8,bo@example.edu,\nc,9,,Cy\n", "r.csv")
    rows = collect(course, staging, roster)
    assert [(row.key, row.problem) for row in rows] == [("al", ""), ("bd", ""), ("c", "")]
    assert {row.path for row in rows} == {course / "submission_11"}


def test_gradescope_s_export_is_found_in_the_folder_that_it_was_unpacked_to(
    course: Path, staging: Path
) -> None:
    folder(course / "assignment_1_export" / "submission_11")
    (course / "assignment_1_export" / "submission_metadata.yml").write_text(TEAM)
    (course / ".DS_Store").write_text("")
    assert [row.key for row in collect(course, staging)] == ["7", "Cy", "bo@example.edu"]


@pytest.mark.parametrize("metadata", ["submission_11: 2026-13-41", "\tx: y"])
def test_a_broken_export_of_gradescope_is_refused(
    metadata: str, course: Path, staging: Path
) -> None:
    folder(course / "submission_11")
    (course / "submission_metadata.yml").write_text(metadata)
    with pytest.raises(UsageError, match=r"submission_metadata\.yml: cannot be read: "):
        collect(course, staging)


def test_an_export_without_submitters_is_taken_by_its_folders(course: Path, staging: Path) -> None:
    folder(course / "submission_11")
    (course / "submission_metadata.yml").write_text("submission_11:\n  :submitters: 7\n")
    assert [row.key for row in collect(course, staging)] == ["submission_11"]


def test_an_archive_of_the_class_is_opened(tmp_path: Path, staging: Path) -> None:
    inner = archive(tmp_path / "inner.zip")
    with zipfile.ZipFile(tmp_path / "submissions.zip", "w") as file:
        file.write(inner, "submissions/ana.zip")
        file.write(inner, "submissions/ben.zip")
    rows = collect(tmp_path / "submissions.zip", staging)
    assert [row.key for row in rows] == ["ana", "ben"]


def test_github_classroom_repositories_go_to_their_logins(course: Path, staging: Path) -> None:
    for login in ("ana-l", "bo", "a-wei"):
        folder(course / f"timed-publisher-{login}")
    roster = parse_roster("name,github\nAna Lopez,ana-l\nBo Ek,Bo\nWei Ng,wei\n", "r.csv")
    bo, ana, stranger, wei = collect(course, staging, roster)
    assert (ana.key, ana.name, ana.problem) == ("ana-l", "Ana Lopez", "")
    assert (bo.key, bo.name, bo.problem) == ("Bo", "Bo Ek", "")
    # a-wei is another login than wei.
    assert (stranger.key, stranger.name) == ("timed-publisher-a-wei", "")
    assert stranger.problem == "not in the roster; may be wei"
    assert wei.path is None
    assert wei.problem == "handed in nothing; timed-publisher-a-wei may be theirs"


@pytest.mark.parametrize(
    ("folders", "owner"),
    [
        # An exact name goes before every similar one.
        (["ada", "hw1-a-ada"], "ada"),
        (["hw1-ada", "hw1-a-ada"], "hw1-ada"),
        (["hw1-ada", "hw1-bob", "hw1-a-ada"], "hw1-ada"),
        # Nothing tells which part of these is a login.
        (["hw1-a-ada"], None),
        (["smith-ada"], None),
        (["hw1-a-ada", "hw1-a-zed"], None),
        # Other logins, other addresses.
        (["a-da"], None),
        (["a_da"], None),
        (["ADA"], "ADA"),
        (["ada.l"], None),
        (["ada.lovelace"], "ada.lovelace"),
        (["Lovelace, Ada"], "Lovelace, Ada"),
    ],
)
def test_no_submission_is_given_by_a_guess_to_a_student_whose_it_may_not_be(
    course: Path, staging: Path, folders: list[str], owner: str | None
) -> None:
    for name in folders:
        folder(course / name)
    students = (
        Student(2, login="ada", email="ada.l@example.org", name="Ada Lovelace"),
        Student(3, login="bob"),
    )
    rows = {row.key: row for row in collect(course, staging, Roster(students))}
    assert rows["ada"].path == (course / owner if owner else None)
    for name in folders:
        if name == owner or name.endswith(("bob", "zed")):
            continue
        # It stands on both rows.
        assert "may be ada" in rows[name].problem
        assert name in rows["ada"].problem and "may be theirs" in rows["ada"].problem


def test_a_submission_with_contradicting_names_is_given_to_no_student(
    course: Path, staging: Path
) -> None:
    archive(course / "lopezana_34_1_ws.zip")
    archive(course / "ngwei_35_2_ws.zip")
    students = (
        Student(2, id="34", name="Ng, Wei"),
        Student(3, id="12", name="Lopez, Ana"),
        Student(4, id="35", name="Ng, Wei"),
    )
    rows = {row.key: row for row in collect(course, staging, Roster(students))}
    assert rows["lopezana_34"].problem == "may be 12 or 34"
    # Of two with one name the number decides.
    assert rows["35"].path is not None and not rows["35"].problem


@pytest.mark.parametrize("others", [0, 3])
def test_a_few_names_with_the_same_beginning_are_no_repositories(
    course: Path, staging: Path, others: int
) -> None:
    for name in ("smith-ada", "smith-bob", *(f"student{number}" for number in range(others))):
        folder(course / name)
    rows = {
        row.key: row
        for row in collect(
            course, staging, Roster((Student(2, login="ada"), Student(3, login="bob")))
        )
    }
    # Half of a class and more: that is how GitHub Classroom names them.
    assert (rows["ada"].path is None) == (others == 3)


def test_a_name_is_the_same_however_its_accents_are_encoded(course: Path, staging: Path) -> None:
    folder(course / unicodedata.normalize("NFD", "Núñez, Ana"))
    folder(course / "muller")
    students = (Student(2, login="s1", name="Ana Núñez"), Student(3, login="s2", name="Müller"))
    rows = {row.key: row for row in collect(course, staging, Roster(students))}
    assert rows["s1"].path is not None and not rows["s1"].problem
    assert rows["s2"].problem == "handed in nothing; muller may be theirs"


def test_logins_that_differ_by_a_hyphen_are_two_students() -> None:
    roster = parse_roster("login\na-da\nada\n", "r.csv")
    assert [student.key for student in roster.students] == ["a-da", "ada"]
    assert not roster.problems


def test_a_student_who_is_not_in_the_roster_is_graded_and_named(
    course: Path, staging: Path
) -> None:
    folder(course / "stranger")
    (row,) = collect(course, staging, Roster(()))
    assert (row.key, row.problem) == ("stranger", "not in the roster")
    assert row.path is not None


def test_a_name_that_two_students_have_is_given_to_neither(course: Path, staging: Path) -> None:
    folder(course / "Ana Lopez")
    roster = Roster((Student(2, id="1", name="Ana Lopez"), Student(3, id="2", name="Lopez, Ana")))
    rows = {row.key: row for row in collect(course, staging, roster)}
    assert rows["Ana Lopez"].problem == "may be 1 or 2"
    for key in ("1", "2"):
        assert rows[key].path is None
        assert rows[key].problem == "handed in nothing; Ana Lopez may be theirs"


def test_a_submission_in_a_roster_belongs_to_the_student_of_its_row(
    course: Path, staging: Path
) -> None:
    folder(course / "hw1-final")
    archive(course / "team.zip")
    archive(course / "Ana Lopez.zip")
    students = (
        Student(2, id="1", name="Ana Lopez", submission="clones/hw1-final"),
        Student(3, id="2", name="Lopez, Ana", submission="Ana Lopez.zip"),
        Student(4, id="3", submission="team.zip"),
        Student(5, id="4", submission="https://example.org/them/team.git"),
        Student(6, id="5", submission="lost.zip"),
    )
    rows = {row.key: row for row in collect(course, staging, Roster(students))}
    found = {key: row.path and row.path.name for key, row in rows.items()}
    assert found == {
        "1": "hw1-final",
        "2": "Ana Lopez.zip",
        "3": "team.zip",
        "4": "team.zip",
        "5": None,
    }
    assert rows["5"].problem == "handed in nothing: lost.zip is not among the submissions"
    assert not any(row.problem for key, row in rows.items() if key != "5")


def test_two_submissions_of_one_student_are_both_rows(course: Path, staging: Path) -> None:
    folder(course / "ana")
    archive(course / "Ana.zip")
    rows = collect(course, staging, Roster((Student(2, login="ana"),)))
    assert [row.key for row in rows] == ["ana", "ana (2)"]
    assert [row.problem for row in rows] == [
        "handed in twice: ana too",
        "handed in twice: Ana.zip too",
    ]


@pytest.mark.parametrize("name", ["a\nb", "q'\"uote", "🤖", "\u202eevil", "-rf", "a b.zip.d"])
def test_any_file_name_is_a_row(course: Path, staging: Path, name: str) -> None:
    folder(course / name)
    (row,) = collect(course, staging)
    assert row.path == course / name
    assert "\n" not in row.key and "\u202e" not in row.key


@pytest.mark.parametrize("name", [b"a\nb", b"\x1b[31mred", b"latin\xe9", "\u202eevil".encode()])
def test_any_name_that_canvas_gives_is_a_row(course: Path, staging: Path, name: bytes) -> None:
    file = archive(course / os.fsdecode(name + b"_12_34_ws.zip"))
    (row,) = collect(course, staging)
    assert row.path == file
    assert row.key.isprintable() and row.key.endswith("_12")


def test_files_of_canvas_that_cannot_be_read_are_reported_on_their_row(
    course: Path, staging: Path
) -> None:
    (course / "ana_1_10_node.py").write_text("pass")
    with (course / "ana_1_11_recording.bag").open("wb") as huge:
        huge.truncate(2**40)
    (course / "ben_2_20_node.py").write_text("pass")
    (course / "ben_2_21_..").write_text("pass")
    archive(course / "cai_3_30_ws.zip")
    rows = {row.key: row for row in collect(course, staging)}
    assert rows["ana_1"].path is None
    assert rows["ana_1"].fault == "the files hold more than 256 MiB"
    assert rows["ben_2"].path is None
    assert rows["ben_2"].fault == "the files cannot be read: Is a directory"
    assert rows["cai_3"].path is not None and not rows["cai_3"].fault


def test_a_student_who_is_in_the_roster_twice_has_one_row_and_is_named(
    course: Path, staging: Path
) -> None:
    folder(course / "ana")
    roster = parse_roster("login,name\nana,Ana\nben,Ben\nana,Ana\n", "r.csv")
    assert [(row.key, row.problem) for row in collect(course, staging, roster)] == [
        ("ana", ""),
        ("ben", "handed in nothing"),
    ]
    assert roster.problems == ("row 4: ana is in row 2 already",)


def test_a_numbered_name_stays_that_of_its_entry(course: Path, staging: Path) -> None:
    folder(course / "ana")
    archive(course / "ana.zip")
    archive(course / "ana (2).zip")
    rows = collect(course, staging)
    assert {row.key: row.path for row in rows} == {
        "ana": course / "ana",
        "ana (2)": course / "ana (2).zip",
        "ana (3)": course / "ana.zip",
    }


def test_the_folder_of_the_results_is_no_submission(course: Path, staging: Path) -> None:
    folder(course / "ana")
    (course / "results").mkdir()
    (row,) = collect(course, staging, out=course / ".." / "class" / "results")
    assert row.key == "ana"


def test_two_files_of_canvas_that_differ_by_a_number_are_both_kept(
    course: Path, staging: Path
) -> None:
    (course / "ana_1_10_node-1.py").write_text("one")
    (course / "ana_1_11_node-2.py").write_text("two")
    (course / "ana_1_12_setup-3.py").write_text("three")
    (row,) = collect(course, staging)
    assert row.path is not None
    assert {file.name: file.read_text() for file in row.path.iterdir()} == {
        "node-1.py": "one",
        "node-2.py": "two",
        "setup.py": "three",
    }


def test_one_submission_is_not_taken_for_a_class(course: Path, staging: Path) -> None:
    (course / "src" / "pkg").mkdir(parents=True)
    (course / "src" / "pkg" / "package.xml").write_text("<package/>")
    with pytest.raises(
        UsageError, match=r"one submission \(src/pkg/package.xml is in it\).*rosgrade check"
    ):
        collect(course, staging)


def test_an_empty_class_is_reported(course: Path, staging: Path) -> None:
    with pytest.raises(UsageError, match="holds no submission"):
        collect(course, staging)


def repository(path: Path) -> Path:
    """A repository with one commit."""
    git = ["git", "-C", str(folder(path)), "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "first"]):
        subprocess.run([*git, *command], check=True)
    return path


def test_a_roster_may_name_paths_and_repositories(tmp_path: Path, staging: Path) -> None:
    folder(tmp_path / "here")
    origin = repository(tmp_path / "origin")
    roster = parse_roster(
        f"login,submission\nana,here\nben,file://{origin}\ncai,file://{tmp_path}/no\n"
        "dee,nowhere\neli,\n",
        "roster.csv",
    )
    taken: list[str] = []
    rows = {row.key: row for row in collect_roster(roster, tmp_path, staging, taken.append)}
    assert taken == ["ana", "ben", "cai", "dee", "eli"]
    assert rows["ana"].path == tmp_path / "here"
    assert rows["ben"].path is not None and (rows["ben"].path / "pkg" / "package.xml").is_file()
    assert rows["cai"].path is None
    assert rows["cai"].fault == (
        f"git clone failed: '{tmp_path}/no' does not appear to be a git repository"
    )
    assert rows["dee"].path is None and rows["dee"].fault == f"{tmp_path}/nowhere does not exist"
    assert rows["eli"].problem == "handed in nothing"


def test_a_team_s_repository_is_fetched_once(tmp_path: Path, staging: Path) -> None:
    url = f"file://{repository(tmp_path / 'one')}"
    roster = parse_roster(f"login,submission\nana,{url}\nben,{url}\ncai,\n", "roster.csv")
    ana, ben, cai = collect_roster(roster, tmp_path, staging)
    assert ana.path is not None and ana.path == ben.path
    assert [row.problem for row in (ana, ben, cai)] == ["", "", "handed in nothing"]


def test_a_path_that_no_file_can_have_is_reported_on_its_row(tmp_path: Path, staging: Path) -> None:
    folder(tmp_path / "here")
    named = {"ana": "here", "ben": "x" * 300, "cai": "a\0b"}
    roster = Roster(tuple(Student(2, login=who, submission=path) for who, path in named.items()))
    ana, ben, cai = collect_roster(roster, tmp_path, staging)
    assert ana.path == tmp_path / "here"
    assert ben.fault.endswith("xxx does not exist")
    assert cai.fault == f"{tmp_path}/a\\x00b does not exist"


def test_a_roster_may_have_tabs_between_its_cells() -> None:
    roster = parse_roster("id\tname\n1\tLopez, Ana\n", "r.csv")
    assert [(student.id, student.name) for student in roster.students] == [("1", "Lopez, Ana")]


ROSTER = "login;name\nana;Ana Núñez\nben;Ben Ng\n"


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (ROSTER, "utf-8"),
        (ROSTER, "utf-8-sig"),
        (ROSTER.replace("\n", "\r\n"), "utf-8"),
        (ROSTER.replace("\n", "\r"), "utf-8"),
    ],
)
def test_a_roster_is_read_as_excel_saves_it(text: str, encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "roster.csv"
    file.write_bytes(text.encode(encoding))
    roster = read_roster(file)
    assert [student.login for student in roster.students] == ["ana", "ben"]
    assert roster.students[0].name == "Ana Núñez"
    assert roster.problems == ()


def test_a_roster_in_an_unknown_encoding_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "roster.csv"
    file.write_bytes(ROSTER.encode("latin-1"))
    with pytest.raises(UsageError, match="is not UTF-8; save it as “CSV UTF-8”"):
        read_roster(file)


def test_a_quote_that_nothing_closes_swallows_no_student() -> None:
    with pytest.raises(UsageError, match=r"r\.csv:3: is not CSV: is a quote \(\"\) missing\?"):
        parse_roster('login,name\nana,Ana\nben,"Ben\ncai,Cai\ndan,Dan', "r.csv")


def test_rows_of_a_roster_that_cannot_be_used_are_named() -> None:
    roster = parse_roster("id;name\n1;Ana\n;\n1;Ana again\n;Wei Ng\n", "r.csv")
    assert [student.key for student in roster.students] == ["1", "Wei Ng"]
    assert roster.problems == ("row 4: 1 is in row 2 already",)


def test_a_roster_without_a_name_is_refused_with_what_there_is() -> None:
    with pytest.raises(UsageError, match=r"r\.csv:1: no column says who.*colour, shoe size"):
        parse_roster("colour,shoe size\nred,42\n", "r.csv")
