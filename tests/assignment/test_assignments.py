"""What rosgrade ships: assignments that load, references, mutants that apply."""

from __future__ import annotations

import ast
from pathlib import Path
from xml.etree import ElementTree

import pytest

from grader.assignment.changed_reference import apply
from grader.assignment.load import LoadedAssignment, list_assignments, load_assignment
from grader.assignment.mutant_file import Mutants, load_mutants
from grader.assignment.reference import CPP, LANGUAGES, Language, reference_of
from grader.authoring.mutants.standard import with_standard_mutants
from grader.checks.check import Subject
from grader.machine import resources

PUBLISHERS = ("simple_publisher", "timed_publisher")


@pytest.fixture(params=list_assignments())
def loaded(request: pytest.FixtureRequest) -> LoadedAssignment:
    return load_assignment(request.param)


@pytest.fixture
def mutants(loaded: LoadedAssignment) -> Mutants:
    return load_mutants(loaded.assignment, loaded.folder)


def test_every_check_is_noticed_by_a_mutant(loaded: LoadedAssignment, mutants: Mutants) -> None:
    """A check that no mutant loses might as well always pass."""
    standard = [one.mutant for one in with_standard_mutants(loaded, mutants)]
    every = [one for one in (*mutants.mutants, *standard) if not one.skip_reason]
    lost = {check for mutant in every for check in mutant.loses}
    assert lost == {bound.spec.id for bound in loaded.checks}


def test_there_are_enough_mutants_and_variants(mutants: Mutants) -> None:
    assert len(mutants.mutants) >= 7
    assert len(mutants.variants) >= 5


@pytest.mark.parametrize("language", LANGUAGES, ids=["python", "cpp"])
def test_every_mutant_is_another_submission(
    loaded: LoadedAssignment, language: Language, tmp_path: Path
) -> None:
    mutants = load_mutants(loaded.assignment, loaded.folder, language=language)
    seen: dict[tuple[tuple[str, bytes], ...], str] = {}
    for change in (*mutants.mutants, *mutants.variants):
        folder = tmp_path / change.id
        apply(change, mutants.reference, folder)
        content = tuple(
            (str(path.relative_to(folder)), path.read_bytes())
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        )
        assert content not in seen, f"{change.id} is the same as {seen[content]}"
        seen[content] = change.id


def test_mutants_are_python_unless_the_syntax_is_the_mistake(
    mutants: Mutants, tmp_path: Path
) -> None:
    """A mutant that fails for another reason than its own would prove nothing."""
    for change in (*mutants.mutants, *mutants.variants):
        apply(change, mutants.reference, tmp_path / change.id)
        broken = []
        for file in (tmp_path / change.id).rglob("*.py"):
            try:
                ast.parse(file.read_text(encoding="utf-8"))
            except SyntaxError:
                broken.append(file.name)
        assert bool(broken) == (change.id == "syntax_error"), change.id


def test_every_check_has_a_hint_and_a_title_and_points(loaded: LoadedAssignment) -> None:
    for bound in loaded.checks:
        # How a robot moves is explained by what it did wrong, the same in every lesson.
        explains_itself = bound.check.family in ("motion", "parameter")
        assert bound.spec.hint or explains_itself, bound.spec.id
        assert bound.spec.title, bound.spec.id
        assert bound.spec.points >= 0, bound.spec.id
    assert sum(bound.spec.points for bound in loaded.checks) == pytest.approx(10.0)


def test_checks_of_a_run_wait_for_an_executable(loaded: LoadedAssignment) -> None:
    """Otherwise a package that does not build would fail every single one of them."""
    requires = {bound.spec.id: set(bound.spec.requires) for bound in loaded.checks}
    subjects = {bound.spec.id: bound.check for bound in loaded.checks}

    def above(check: str) -> set[str]:
        return requires[check].union(*(above(other) for other in requires[check]))

    for check, found in subjects.items():
        if found.subject is Subject.RECORDING:
            assert any(subjects[one].name == "package.executable" for one in above(check)), check


def test_the_handout_names_what_is_judged(loaded: LoadedAssignment) -> None:
    handout = (loaded.folder / "README.md").read_text(encoding="utf-8")
    for package in loaded.assignment.packages:
        assert package.name in handout
        assert all(executable in handout for executable in package.executables)
    for scenario in loaded.assignment.scenarios:
        assert all(recorded.topic in handout for recorded in scenario.record)


def test_the_reference_is_a_package_as_the_assignment_asks(loaded: LoadedAssignment) -> None:
    for package in loaded.assignment.packages:
        folder = reference_of(loaded.assignment.id) / package.name
        manifest = ElementTree.parse(folder / "package.xml").getroot()
        assert manifest.get("format") == "3"
        assert manifest.findtext("name") == package.name
        assert manifest.findtext("license") == "Apache-2.0"
        assert manifest.findtext("export/build_type") == package.build_type
        assert [one.text for one in manifest.findall("depend")] == list(package.depends)
        if package.build_type == "ament_python":
            assert (folder / "resource" / package.name).is_file()


def test_the_reference_in_cpp_is_the_same_package(loaded: LoadedAssignment) -> None:
    for package in loaded.assignment.packages:
        folder = reference_of(loaded.assignment.id, language=CPP) / package.name
        manifest = ElementTree.parse(folder / "package.xml").getroot()
        assert manifest.findtext("name") == package.name
        assert manifest.findtext("export/build_type") == "ament_cmake"
        for executable in package.executables:
            assert executable in (folder / "CMakeLists.txt").read_text(encoding="utf-8")


def test_there_are_enough_mutants_in_cpp(loaded: LoadedAssignment) -> None:
    mutants = load_mutants(loaded.assignment, loaded.folder, language=CPP)
    assert len(mutants.mutants) >= 6
    assert len(with_standard_mutants(loaded, mutants)) >= 12
    assert len(mutants.variants) >= 2


@pytest.mark.parametrize("name", PUBLISHERS)
def test_the_reference_has_type_hints_and_docstrings(name: str) -> None:
    file = resources.reference() / name / "bot_publisher/bot_publisher/bot_publisher.py"
    tree = ast.parse(file.read_text(encoding="utf-8"))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    assert [node.name for node in classes] == ["BotPublisher"]
    assert all(ast.get_docstring(node) for node in (tree, *classes, *functions))
    assert all(node.returns is not None for node in functions)


@pytest.mark.parametrize("name", PUBLISHERS)
def test_the_lecture_s_numbers(name: str) -> None:
    """From the lecture: Twist, linear.x = 1.0, angular.z = 0.5, on /cmd_vel, queue size 10."""
    loaded = load_assignment(name)
    found = {bound.check.name: bound.spec.with_ for bound in loaded.checks}
    assert found["messages.equal"]["value"] == {"linear": {"x": 1.0}, "angular": {"z": 0.5}}
    assert found["topic.type"] == {"topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist"}
    assert found["qos.depth"]["depth"] == 10
    assert found["node.exists"] == {"name": "bot_publisher", "publishes": "/cmd_vel"}
    executable = {"package": "bot_publisher", "executable": "bot_pub", "remap": True}
    assert found["package.executable"] == executable
    if name == "timed_publisher":
        assert found["timing.period"]["period"] == "300 ms"
