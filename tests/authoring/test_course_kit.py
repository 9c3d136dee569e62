"""A course kit works alone, and holds nothing that students may not have."""

from __future__ import annotations

import gzip
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml
from hatchling.builders.wheel import WheelBuilder

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.reference import LANGUAGES, reference_of
from grader.assignment.selection import visible_part
from grader.authoring.course_kit import write_kit
from grader.authoring.starter import starter_files
from grader.authoring.visible_files import visible_files
from grader.errors import UsageError
from grader.machine import resources
from grader.machine.bootstrap import read_lock
from grader.report.concepts import concepts
from grader.report.html.handout import make_handout, render_handout
from grader.spec.document import parse_yaml, write_yaml
from tests.alone import alone
from tests.assignment.lessons import GOOD, HEAD

ROOT = Path(__file__).resolve().parents[2]
SECRET = (
    "  # A secret comment.\n"
    "  - {id: zq_secret, title: Zq secretly, uses: lesson.zq_own, points: 2.5,\n"
    "     scenarios: [zq_run], visibility: hidden, with: {text: zq parameter}}\n"
)
OWN = '''\
"""Zq own."""
from grader.checks.check import Parameters, Subject, check
from grader.findings.finding import Finding

class Own(Parameters):
    text: str

@check("lesson.zq_own", Subject.RECORDING, Own)
def own(recording, values):
    """Zq own check."""
    return Finding.passed("", "")
'''


def hidden_lesson(folder: Path, checks: str = "") -> Path:
    """An assignment with a hidden check, which has a scenario, a world and code of its own."""
    place = folder / "lesson"
    (place / "checks").mkdir(parents=True)
    (place / "checks" / "__init__.py").write_text("", encoding="utf-8")
    (place / "checks" / "zq_checks.py").write_text(OWN, encoding="utf-8")
    (place / "worlds").mkdir()
    for world in ("shown", "zq_hidden"):
        text = "start: [0, 0, 0 deg]\n"
        (place / "worlds" / f"{world}.yaml").write_text(text, encoding="utf-8")
    head = HEAD.replace("timeout: 5 s", "timeout: 5 s\n    world: worlds/shown.yaml")
    head = head.replace(
        "checks:\n",
        "  - id: zq_run\n    launch: [{executable: bot_pub}]\n    repeat: 2\n"
        "    world: worlds/zq_hidden.yaml\n    timeout: 5 s\npoints: 3.5\nchecks:\n",
    )
    alive = "  - {id: alive, uses: node.alive, points: 1, scenarios: [run]}\n"
    text = head + (checks or alive + SECRET)
    (place / "assignment.yaml").write_text(text, encoding="utf-8")
    replays = {"run": {"of": "", "replay": {}}, "zq_run_1": {"of": "", "replay": {}}}
    content = json.dumps({"schema": 1, "scenarios": replays}).encode()
    (place / "reference.json.gz").write_bytes(gzip.compress(content))
    for name in ("reference", "reference_cpp"):
        (place / name).mkdir()
        (place / name / "solution.py").write_text("zq_solution", encoding="utf-8")
    (place / "mutants.yaml").write_text("zq_mutants", encoding="utf-8")
    return place


def texts(folder: Path) -> dict[str, str]:
    """Every file by path, also what is in wheels and compressed."""
    found = {}
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        inside = file.relative_to(folder).as_posix()
        if file.suffix == ".whl":
            with zipfile.ZipFile(file) as wheel:
                found.update({f"{inside}/{one}": wheel.read(one) for one in wheel.namelist()})
        else:
            found[inside] = file.read_bytes()
    decoded = {
        name: (gzip.decompress(data) if name.endswith(".gz") else data).decode("utf-8", "replace")
        for name, data in found.items()
    }
    # A hash may spell anything.
    return {name: re.sub(r"sha256[=:]\S+", "", text) for name, text in decoded.items()}


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A kit of all of rosgrade's own assignments and one with a hidden check."""
    folder = tmp_path_factory.mktemp("kit")
    chosen = [*list_assignments(), hidden_lesson(folder)]
    out = folder / 'My "course"'
    return write_kit([load_assignment(one) for one in chosen], out, 'My "course"', "submit*")


def windows(text: str, size: int) -> set[str]:
    """Every few lines that follow one another, without indentation and empty ones."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return {"\n".join(lines[at : at + size]) for at in range(len(lines) - size + 1)}


def test_no_file_of_a_kit_holds_a_hidden_check_or_what_only_it_uses(kit: Path) -> None:
    found = texts(kit)
    assert "assignments/lesson/worlds/shown.yaml" in found
    for name, text in found.items():
        assert "zq" not in name.lower() and "zq_" not in text.lower(), name
        assert "Zq " not in text and "secret comment" not in text, name


def test_no_file_of_a_kit_holds_a_solution_or_a_mutant(kit: Path) -> None:
    found = texts(kit)
    assert not [name for name in found if re.search(r"mutants(_cpp)?\.yaml$|/reference/", name)]
    # Lines of the starter package, the handout and given interfaces stand in the reference too.
    given = {
        window
        for name, text in found.items()
        if "/templates/" in name or "/interfaces/" in name or name.endswith("README.md")
        for window in windows(text, 4)
    }
    whole = {window for text in found.values() for window in windows(text, 4)} - given
    for assignment in list_assignments():
        loaded = load_assignment(assignment)
        for language in LANGUAGES:
            for file in reference_of(assignment, loaded.folder, language).rglob("*"):
                if file.suffix in (".py", ".cpp", ".hpp") and file.name != "setup.py":
                    shared = windows(file.read_text(encoding="utf-8"), 4) & whole
                    assert not shared, (file, shared)
            mutants = (loaded.folder / language.mutants).read_text(encoding="utf-8")
            shared = windows(mutants, 4) & whole
            assert not shared, (assignment, shared)


def test_a_copy_for_students_is_the_visible_part_and_counts_the_rest(tmp_path: Path) -> None:
    whole = load_assignment(hidden_lesson(tmp_path))
    for path, content in visible_files(whole).items():
        file = tmp_path / "copy" / "lesson" / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    copy, part = load_assignment(tmp_path / "copy" / "lesson"), visible_part(whole)
    assert [one.spec for one in copy.checks] == [one.spec for one in part.checks]
    assert copy.assignment.scenarios == part.assignment.scenarios
    assert (copy.withheld.checks, copy.withheld.points) == (1, 2.5)
    assert make_handout(copy).total == make_handout(whole).total


def test_without_hidden_checks_the_files_are_the_authors_own() -> None:
    loaded = load_assignment("timed_publisher")
    text = (loaded.folder / "assignment.yaml").read_bytes()
    assert visible_files(loaded)["assignment.yaml"] == text


def test_an_assignment_that_cannot_do_without_hidden_code_is_refused(tmp_path: Path) -> None:
    place = hidden_lesson(tmp_path)
    (place / "checks" / "shown.py").write_text("from .zq_checks import Own\n", encoding="utf-8")
    with pytest.raises(UsageError, match="'lesson' does not work without its hidden checks"):
        write_kit([load_assignment(place)], tmp_path / "kit", "Course")
    assert not (tmp_path / "kit").exists()


@pytest.mark.parametrize("assignment", list_assignments())
def test_yaml_that_is_written_again_means_the_same(assignment: str) -> None:
    file = resources.assignments() / assignment / "assignment.yaml"
    data, _ = parse_yaml(file.read_text(encoding="utf-8"), file)
    assert parse_yaml(write_yaml(data), file)[0] == data


def test_texts_that_look_like_numbers_of_yaml_1_2_stay_texts(tmp_path: Path) -> None:
    data = {"a": ["1e3", "0o17", "on", "12:30", "010", "null", 1e-7, True, None, "${x}"]}
    assert parse_yaml(write_yaml(data), tmp_path)[0] == data


def test_the_lock_of_a_kit_holds_what_students_need_and_no_tools_of_developers(kit: Path) -> None:
    entries = {one.name: one.text for one in read_lock((kit / "requirements.lock").read_text())}
    whole = {one.name for one in read_lock((ROOT / "requirements.lock").read_text())}
    needed = {"ros-rclpy", "ros-rmw-fastrtps-cpp", "colcon-core", "pyyaml", "ruff", "setuptools"}
    assert needed <= set(entries) <= whole
    assert not {"hypothesis", "mypy", "mkdocs", "distributed", "hatchling"} & set(entries)
    assert all("--hash=sha256:" in text for text in entries.values())


def test_the_files_for_other_programs_can_be_read_by_them(kit: Path) -> None:
    container = json.loads((kit / ".devcontainer/devcontainer.json").read_text())
    assert container["name"] == 'My "course"'
    assert (kit / ".devcontainer/Dockerfile").read_text().count("FROM ros:jazzy\n") == 1
    workflow = yaml.safe_load((kit / ".github/workflows/grade.yml").read_text())
    assert workflow[True]["push"] == {"tags": ["submit*"]}
    for step in workflow["jobs"]["grade"]["steps"]:
        if "run" in step:
            subprocess.run(["bash", "-n", "-c", step["run"]], check=True)
    subprocess.run(["sh", "-n", str(kit / "setup.sh")], check=True)
    assert os.access(kit / "setup.sh", os.X_OK)


def test_the_readme_speaks_of_this_course(kit: Path) -> None:
    text = (kit / "README.md").read_text(encoding="utf-8")
    assert text.startswith('# My "course"\n')
    assert "and 2.5 points for 1 more check at grading" in text
    assert "rosgrade start bot_controller ~/ros2_ws/src" in text
    (idea,) = re.findall(r"rosgrade explain (\w+)", text)
    assert idea in concepts()
    for path in re.findall(r"\]\((assignments/\w+)\)", text):
        assert (kit / path / "assignment.yaml").is_file()


def test_handouts_readme_and_starter_agree_on_one_workspace(kit: Path) -> None:
    texts = {"kit": (kit / "README.md").read_text(encoding="utf-8")}
    for name in list_assignments():
        loaded = load_assignment(name)
        texts[name] = (loaded.folder / "README.md").read_text(encoding="utf-8")
        texts[f"{name} page"] = render_handout(make_handout(loaded))
        texts[f"{name} starter"] = next(
            text for path, text in starter_files(loaded).items() if path.endswith("/README.md")
        )
    command = re.compile(r"rosgrade (?:start|watch|check)(?: --cpp)? \w+ ([~.\w/-]+)")
    for name, text in texts.items():
        named = {path.removesuffix("/src") for path in command.findall(text)}
        assert named == {"~/ros2_ws"}, (name, named)


def test_a_kit_is_renewed_and_other_files_beside_it_stay(kit: Path, tmp_path: Path) -> None:
    out = tmp_path / "kit"
    shutil.copytree(kit, out)
    (out / "work").mkdir()
    (out / "assignments" / "old").mkdir()
    (out / "rosgrade-0.0.1-py3-none-any.whl").touch()
    command = [sys.executable, "-m", "grader", "export", "course", "timed_publisher"]
    told = subprocess.run([*command, "--out", str(out)], cwd=ROOT, capture_output=True, check=True)
    assert told.stdout.decode().endswith(f"{out}\n")
    assert (out / "work").is_dir()
    assert [one.name for one in (out / "assignments").iterdir()] == ["timed_publisher"]
    assert len(list(out.glob("*.whl"))) == 1


def test_no_other_folder_becomes_a_kit(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(UsageError, match="neither empty nor an earlier kit"):
        write_kit([load_assignment("timed_publisher")], tmp_path, "Course")
    lesson = tmp_path / "course" / "lesson"
    lesson.mkdir(parents=True)
    (lesson / "assignment.yaml").write_text(GOOD, encoding="utf-8")
    for out in (tmp_path / "course", lesson / "kit"):
        with pytest.raises(UsageError, match="lies in the"):
            write_kit([load_assignment(lesson)], out, "Course")


def test_a_set_up_of_a_kit_installs_its_wheel(kit: Path) -> None:
    code = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "from grader.machine import bootstrap\n"
        "def create(venv, chosen):\n"
        "    (venv / 'bin').mkdir(parents=True)\n"
        "    (venv / 'bin' / 'python').touch()\n"
        "bootstrap._create = create\n"
        "bootstrap._install_lock = bootstrap._check_imports = bootstrap._add_ros2 = "
        "lambda *_: None\n"
        "bootstrap._pip = lambda venv, arguments, problem: print(*arguments)\n"
        "sys.exit(bootstrap.main('.'))\n"
    )
    (wheel,) = kit.glob("*.whl")
    environ = {k: v for k, v in os.environ.items() if k != "AMENT_PREFIX_PATH"}
    command = [sys.executable, "-I", "-S", "-c", code, wheel.name]
    done = subprocess.run(command, cwd=kit, env=environ, capture_output=True, text=True, check=True)
    assert f"--force-reinstall {wheel}" in done.stdout
    shutil.rmtree(kit / ".venv")


def names_in(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {
            name
            for name in archive.namelist()
            if not name.startswith("grader/_data/assignments/") and ".dist-info/" not in name
        }


def test_the_wheel_of_a_kit_lacks_nothing_of_rosgrade_but_other_assignments(
    kit: Path, tmp_path: Path
) -> None:
    (built,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    assert names_in(next(kit.glob("*.whl"))) == names_in(Path(built))


@pytest.mark.ros
def test_what_pip_installs_from_the_wheel_lists_explains_starts_and_checks(
    kit: Path, tmp_path: Path
) -> None:
    (wheel,) = kit.glob("*.whl")
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(site), str(wheel)], check=True)

    def rosgrade(*arguments: str) -> subprocess.CompletedProcess[str]:
        return alone(site, *arguments, cwd=tmp_path)

    assert "lesson" in rosgrade("list").stdout
    for idea in re.findall(r"rosgrade explain (\w+)", (kit / "README.md").read_text()):
        assert concepts()[idea].title in rosgrade("explain", idea).stdout
    started = rosgrade("start", "simple_publisher", "ws/src")
    assert started.returncode == 0, started.stderr
    checked = rosgrade("check", "simple_publisher", "ws", "--json", "result.json")
    assert checked.returncode == 1, checked.stdout + checked.stderr
    assert 0 < json.loads((tmp_path / "result.json").read_text())["score"] < 3
    selftest = rosgrade("selftest", "simple_publisher")
    assert selftest.returncode == 2
    assert "install rosgrade-solutions" in selftest.stderr


def test_the_solutions_that_instructors_install_beside_it_are_found(tmp_path: Path) -> None:
    site = tmp_path / "site"
    for project in (ROOT, ROOT / "reference"):
        build = WheelBuilder(str(project)).build(directory=str(tmp_path), versions=["standard"])
        with zipfile.ZipFile(next(build)) as wheel:
            assert not [name for name in wheel.namelist() if (site / name).exists()]
            wheel.extractall(site)
    code = (
        "from grader.machine import resources; from grader.assignment.load import *\n"
        "from grader.assignment.mutant_file import *\n"
        "from grader.assignment.reference import LANGUAGES\n"
        "for name in list_assignments():\n"
        "    loaded = load_assignment(name)\n"
        "    for language in LANGUAGES:\n"
        "        load_mutants(loaded.assignment, loaded.folder, language=language)\n"
        "print(resources.root())\n"
    )
    environ = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=tmp_path, env=environ, capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{site / 'grader' / '_data'}\n"


def test_a_kit_names_where_built_packages_lie_until_it_is_renewed_without(tmp_path: Path) -> None:
    chosen = [load_assignment("timed_publisher")]
    address = "https://example.org/underlays.tar.gz#sha256=" + "0" * 64
    kit = write_kit(chosen, tmp_path / "kit", "Course", underlays=address)
    assert (kit / "underlays.txt").read_text() == f"{address}\n"
    assert "also brings packages of ROS" in (kit / "README.md").read_text()
    write_kit(chosen, kit, "Course")
    assert not (kit / "underlays.txt").exists()
    assert "also brings packages of ROS" not in (kit / "README.md").read_text()
