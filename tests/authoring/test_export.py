"""What a course uploads: complete, the same every time, and without anything hidden."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest
import yaml

from grader.assignment.load import load_assignment
from grader.authoring import export
from grader.authoring.starter import rendered
from grader.errors import UsageError
from grader.report.concepts import concepts
from tests.alone import alone
from tests.assignment.lessons import GOOD, HEAD

ROOT = Path(__file__).resolve().parents[2]
HIDDEN = HEAD + (
    "  - {id: alive, uses: node.alive, points: 1}\n"
    "  - {id: secret, uses: node.starts, points: 1, visibility: hidden}\n"
)


@pytest.fixture(scope="module")
def loaded():
    return load_assignment("timed_publisher")


def lesson(folder, text=GOOD):
    place = folder / "lesson"
    place.mkdir()
    (place / "assignment.yaml").write_text(text, encoding="utf-8")
    return load_assignment(place)


def test_the_gradescope_zip_has_what_gradescope_needs_at_its_top(loaded, tmp_path):
    file = export.gradescope(loaded, tmp_path)
    with zipfile.ZipFile(file) as archive:
        modes = {info.filename: info.external_attr >> 16 for info in archive.infolist()}
        assert archive.testzip() is None
        scripts = {name: archive.read(name).decode() for name in ("setup.sh", "run_autograder")}
    assert all(modes[name] & 0o111 for name in scripts)
    assert all(text.startswith("#!/usr/bin/env bash\n") for text in scripts.values())
    assert all("@" not in text.replace('"$@"', "") for text in scripts.values())
    assert "check timed_publisher" in scripts["run_autograder"]
    for needed in (
        *(
            "rosgrade/requirements.lock",
            "rosgrade/pyproject.toml",
            "rosgrade/grader/machine/bootstrap.py",
        ),
        *("rosgrade/assignments/timed_publisher/assignment.yaml", "rosgrade/sim/node.py"),
        *("rosgrade/templates/report.html.j2", "rosgrade/grader/run/fast_discovery.xml"),
    ):
        assert needed in modes
    assert not [name for name in modes if "reference" in name.split("/")[1:2] or "/." in name]
    assert not [name for name in modes if "__pycache__" in name]
    others = {name.split("/")[2] for name in modes if name.startswith("rosgrade/assignments/")}
    assert others == {"timed_publisher"}


def test_the_same_files_give_the_same_zip(loaded, tmp_path):
    first = export.gradescope(loaded, tmp_path / "a").read_bytes()
    assert export.gradescope(loaded, tmp_path / "b").read_bytes() == first


ADDRESS = "https://example.org/underlays.tar.gz#sha256=" + "0" * 64


def test_built_packages_lie_where_the_set_up_looks_for_them(loaded, tmp_path, monkeypatch):
    archive = tmp_path / "rclcpp.tar.gz"
    archive.write_bytes(b"packages")
    monkeypatch.setattr(export, "check_archive", lambda _: None)
    for place, name, content in (
        (str(archive), "underlays.tar.gz", b"packages"),
        (ADDRESS, "underlays.txt", f"{ADDRESS}\n".encode()),
    ):
        with zipfile.ZipFile(export.gradescope(loaded, tmp_path, place)) as written:
            assert written.read(f"rosgrade/{name}") == content
        assert (export.classroom50(loaded, tmp_path, place) / "rosgrade" / name).read_bytes() == (
            content
        )


def test_what_holds_no_built_packages_is_not_given_along(loaded, tmp_path):
    archive = tmp_path / "notes.tar.gz"
    archive.write_text("notes")
    for place, told in (
        (str(archive), r"notes\.tar\.gz: is neither"),
        (str(tmp_path / "none.tar.gz"), "there is no such file"),
        ("https://example.org/underlays.tar.gz", "#sha256=HASH"),
    ):
        with pytest.raises(UsageError, match=told):
            export.gradescope(loaded, tmp_path, place)


@pytest.mark.parametrize("name", ["setup.sh", "run_autograder"])
def test_the_scripts_are_bash(loaded, tmp_path, name):
    with zipfile.ZipFile(export.gradescope(loaded, tmp_path)) as archive:
        archive.extract(name, tmp_path)
    subprocess.run(["bash", "-n", str(tmp_path / name)], check=True)


@pytest.fixture
def root():
    """What is /autograder there; not below /tmp, of which a sandbox has its own."""
    with tempfile.TemporaryDirectory(dir="/var/tmp") as name:
        yield Path(name)


@pytest.mark.ros
@pytest.mark.parametrize(("submission", "score"), [("reference", 10.0), ("nothing", 0.0)])
def test_the_autograder_runs_as_gradescope_runs_it(root, submission, score):
    with zipfile.ZipFile(export.gradescope(load_assignment("simple_publisher"), root)) as archive:
        archive.extractall(root / "source")
    # The environment that setup.sh would make is the one that runs this test.
    bin_folder = root / "source" / "rosgrade" / ".venv" / "bin"
    bin_folder.mkdir(parents=True)
    command = bin_folder / "rosgrade"
    command.write_text(
        f'#!/bin/sh\nPYTHONPATH={root}/source/rosgrade exec {sys.executable} -m grader "$@"\n'
    )
    command.chmod(0o755)
    run = root / "run_autograder"
    shutil.copy(root / "source" / "run_autograder", run)
    run.chmod(0o755)
    if submission == "reference":
        shutil.copytree(ROOT / "reference" / "simple_publisher", root / "submission")
    else:
        (root / "submission").mkdir()
    (root / "submission_metadata.json").write_text(
        '{"created_at": "2026-03-05T09:00:00Z", "assignment": {"due_date": "2026-03-05T08:00:00Z"}}'
    )
    ended = subprocess.run(
        [str(run)],
        env={**os.environ, "AUTOGRADER_ROOT": str(root)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    data = json.loads((root / "results" / "results.json").read_text(encoding="utf-8"))
    assert data["score"] == score, ended.stdout + ended.stderr
    assert data["extra_data"]["late_s"] == 3600.0


def test_the_workflow_gives_the_action_only_inputs_that_it_has(loaded, tmp_path):
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    file = export.github(loaded, tmp_path, "my-course/rosgrade@v1")
    steps = yaml.safe_load(file.read_text())["jobs"]["grade"]["steps"]
    given = next(step["with"] for step in steps if step.get("id") == "grade")
    assert set(given) <= set(action["inputs"])
    required = {name for name, one in action["inputs"].items() if one.get("required")}
    assert required <= set(given)


def test_every_action_runs_on_a_node_that_github_still_has():
    # The first versions on Node 24; GitHub took Node 20 from its runners in September 2026.
    first = {"checkout": 5, "setup-python": 6, "cache": 5, "upload-artifact": 6}
    files = (
        *("action.yml", ".github/workflows/test.yml", "templates/export/github-workflow.yml.j2"),
        "templates/course/workflow.yml.j2",
    )
    # By its commit: a tag can be moved to other code.
    form = re.compile(r"uses: actions/([\w-]+)(?:/\w+)?@[0-9a-f]{40}  # v(\d+)\.\d+\.\d+\n")
    plain = re.compile(r"uses: actions/")
    used = [found for file in files for found in form.findall((ROOT / file).read_text())]
    assert {name for name, _ in used} == set(first)
    assert [(name, number) for name, number in used if int(number) < first[name]] == []
    assert len(used) == sum(len(plain.findall((ROOT / file).read_text())) for file in files)


def test_no_workflow_leaves_a_token_in_the_checkout_or_runs_twice_for_one_push(loaded, tmp_path):
    exported = export.github(loaded, tmp_path, "my-course/rosgrade@v1").read_text()
    ours = (ROOT / ".github/workflows/test.yml").read_text()
    for text in (WORKFLOWS["course kit"], exported, ours):
        data = yaml.safe_load(text)
        assert "github.ref" in data["concurrency"]["group"]
        (job,) = data["jobs"].values()
        (checkout,) = (one for one in job["steps"] if "/checkout@" in one.get("uses", ""))
        assert checkout["with"] == {"persist-credentials": False}


def test_the_workflow_of_a_kit_is_not_green_where_nothing_was_graded(tmp_path):
    steps = yaml.safe_load(WORKFLOWS["course kit"])["jobs"]["grade"]["steps"]
    script = next(one["run"] for one in steps if one.get("name") == "Grade")
    (tmp_path / "work").mkdir()

    def ended():
        shell = ["bash", "-e", "-c", script]
        return subprocess.run(shell, cwd=tmp_path, capture_output=True, check=False).returncode

    assert ended() == 2
    rosgrade = tmp_path / ".venv" / "bin" / "rosgrade"
    rosgrade.parent.mkdir(parents=True)
    for code in (0, 1, 3):
        rosgrade.write_text(f"#!/bin/sh\nexit {code}\n")
        rosgrade.chmod(0o755)
        (tmp_path / "work" / "timed_publisher").mkdir(exist_ok=True)
        assert ended() == code


def test_the_action_declares_every_output_that_grading_sets():
    declared = yaml.safe_load((ROOT / "action.yml").read_text())["outputs"]
    source = (ROOT / "grader/report/formats/github.py").read_text(encoding="utf-8")
    keys = source.partition("values = {")[2].partition("}")[0]
    assert set(re.findall(r'"([\w-]+)":', keys)) <= set(declared)


def step(name):
    steps = yaml.safe_load((ROOT / "action.yml").read_text())["runs"]["steps"]
    return next(one["run"] for one in steps if one.get("id") == name)


@pytest.mark.parametrize(
    ("tag", "ref", "event", "graded"),
    [
        ("", "refs/heads/main", "push", True),
        ("submit*", "refs/tags/submit-2", "push", True),
        ("submit*", "refs/tags/draft", "push", False),
        ("submit*", "refs/heads/submit", "push", False),
        ("submit*", "refs/heads/main", "workflow_dispatch", True),
    ],
)
def test_the_action_grades_only_the_tags_that_are_wanted(tmp_path, tag, ref, event, graded):
    outputs = tmp_path / "outputs"
    given = {"TAG": tag, "GITHUB_REF": ref, "GITHUB_EVENT_NAME": event}
    given["GITHUB_OUTPUT"] = str(outputs)
    subprocess.run(["bash", "-e", "-c", step("begin")], env={**os.environ, **given}, check=True)
    assert ("grade=true" in outputs.read_text()) is graded


WORKFLOWS = {
    "action": (ROOT / "action.yml").read_text(encoding="utf-8"),
    "course kit": rendered("course/workflow.yml", tag="submit*"),
}


@pytest.mark.parametrize("text", WORKFLOWS.values(), ids=WORKFLOWS)
def test_what_took_long_is_kept_also_when_points_are_lost(text):
    # actions/cache keeps something only "if the job completes successfully":
    # https://docs.github.com/en/actions/reference/workflows-and-actions/dependency-caching
    data = yaml.safe_load(text)
    steps = data["runs"]["steps"] if "runs" in data else data["jobs"]["grade"]["steps"]
    used = [one.get("uses", "").partition("@")[0] for one in steps]
    assert "actions/cache" not in used
    restored, saved = (
        [one["with"]["path"] for one in steps if f"actions/cache/{do}@" in one.get("uses", "")]
        for do in ("restore", "save")
    )
    assert restored == saved and len(saved) == 2
    (grading,) = (index for index, one in enumerate(steps) if "check " in one.get("run", ""))
    environment, builds = (index for index, one in enumerate(used) if one == "actions/cache/save")
    assert environment < grading < builds and "always()" in steps[builds]["if"]
    # GitHub gives the cache of a tag to no other run.
    for index in (environment, builds):
        assert "github.ref_type != 'tag'" in steps[index]["if"]


def test_the_action_says_how_long_it_took(tmp_path):
    given = {"BEGAN": "0", "GITHUB_OUTPUT": str(tmp_path / "outputs")}
    # 90 s after BEGAN.
    script = f"date() {{ echo 90; }}\n{step('end')}"
    subprocess.run(["bash", "-e", "-c", script], env={**os.environ, **given}, check=True)
    assert (tmp_path / "outputs").read_text() == "minutes=1.5\n"


def test_a_workflow_can_wait_for_a_tag(loaded, tmp_path):
    file = export.github(loaded, tmp_path, "my-course/rosgrade@v1", "submit*")
    assert yaml.safe_load(file.read_text())[True]["push"] == {"tags": ["submit*"]}


def test_no_input_of_the_action_reaches_a_shell_as_text():
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    scripts = [step["run"] for step in action["runs"]["steps"] if "run" in step]
    assert scripts and not any("${{" in script for script in scripts)
    for script in scripts:
        subprocess.run(["bash", "-n", "-c", script], check=True)


def test_an_assignment_of_the_course_is_copied_into_the_repository(tmp_path):
    file = export.github(lesson(tmp_path), tmp_path / "repo", "c/r@v1")
    assert "assignment: .github/rosgrade/lesson\n" in file.read_text()
    copy = tmp_path / "repo" / ".github" / "rosgrade" / "lesson"
    assert load_assignment(copy).sha256 == load_assignment(tmp_path / "lesson").sha256


@pytest.mark.parametrize("kind", ["github", "classroom50", "gradescope"])
def test_the_solution_does_not_go_where_submissions_are_graded(tmp_path, kind):
    loaded = lesson(tmp_path)
    (loaded.folder / "reference" / "bot").mkdir(parents=True)
    for name in ("reference/bot/bot.py", "mutants.yaml"):
        (loaded.folder / name).write_text("solution = 'zq'", encoding="utf-8")
    out = tmp_path / "out"
    if kind == "github":
        export.github(loaded, out, "c/r@v1")
    elif kind == "classroom50":
        export.classroom50(loaded, out)
    else:
        zipfile.ZipFile(export.gradescope(loaded, out)).extractall(out)
    files = [path for path in out.rglob("*") if path.is_file() and path.suffix != ".zip"]
    assert [path for path in files if path.name == "assignment.yaml"]
    assert not [path for path in files if b"'zq'" in path.read_bytes()]


@pytest.mark.parametrize("kind", ["classroom50", "gradescope"])
def test_what_a_report_of_an_export_names_can_be_read_there(loaded, tmp_path, kind):
    if kind == "gradescope":
        zipfile.ZipFile(export.gradescope(loaded, tmp_path)).extractall(tmp_path / "out")
    else:
        export.classroom50(loaded, tmp_path / "out")
    (site,) = (path.parent for path in tmp_path.rglob("grader/__main__.py"))
    told = alone(site.parent, "explain", "executors", cwd=tmp_path)
    assert concepts()["executors"].title in told.stdout, told.stderr


@pytest.mark.parametrize("kind", ["github", "classroom50"])
def test_hidden_checks_do_not_go_where_students_can_read_them(tmp_path, kind):
    hidden = lesson(tmp_path, HIDDEN)
    out = tmp_path / "out"
    export.github(hidden, out, "c/r@v1") if kind == "github" else export.classroom50(hidden, out)
    files = [path for path in out.rglob("lesson/*") if path.is_file()]
    assert [path.name for path in files] == ["assignment.yaml"]
    assert "secret" not in files[0].read_text(encoding="utf-8")
    assert load_assignment(files[0]).withheld.checks == 1


@pytest.mark.parametrize("action", ["rosgrade", "a/b", "a/b@v1\n  evil: 1", ""])
def test_an_action_that_is_none_is_refused(loaded, tmp_path, action):
    with pytest.raises(UsageError, match="is no action: write OWNER/REPOSITORY@REF"):
        export.github(loaded, tmp_path, action)


def test_the_classroom50_folder_can_be_written_again(loaded, tmp_path):
    folder = export.classroom50(loaded, tmp_path)
    (folder / "old").write_text("")
    assert export.classroom50(loaded, tmp_path) == folder
    assert not (folder / "old").exists()
    script = (folder / "autograder.py").read_text(encoding="utf-8")
    compile(script, "autograder.py", "exec")
    assert '"check", "timed_publisher", "."' in script
    assert (folder / "rosgrade" / "grader" / "machine" / "bootstrap.py").is_file()
    assert not [path for path in tmp_path.iterdir() if path != folder]
