"""package.dependencies: don't forget the dependencies."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.findings.finding import Status
from grader.grade.runtime_imports import with_runtime_imports
from grader.recording.submission import Dependency, Import, SourceError, SourceFile
from tests.checks.builder import (
    INSTALLED,
    SOURCE,
    declared,
    failing,
    judge,
    package,
    recording,
    submission,
)

NAME = "bot_publisher"
RCLPY = Dependency("rclpy", "depend", 10, known=True)
GEOMETRY = Dependency("geometry_msgs", "depend", 11, known=True)


def judged(*dependencies, packages=(), **changes):
    subject = submission(package(dependencies=dependencies, **changes), *packages)
    return judge("package.dependencies", subject, package=NAME)


def test_complete_dependencies_pass():
    finding = judged(RCLPY, GEOMETRY)
    assert finding.status is Status.PASSED
    assert finding.observed == "`geometry_msgs` and `rclpy` declared"


@pytest.mark.parametrize(
    "kind", ["depend", "exec_depend", "build_depend", "build_export_depend", "run_depend"]
)
def test_every_tag_for_running_or_building_counts(kind):
    finding = judged(RCLPY, Dependency("geometry_msgs", kind, 11))
    assert finding.status is Status.PASSED


def test_a_forgotten_dependency_names_the_import_and_the_tag_to_add():
    finding = judged(RCLPY)
    assert finding.status is Status.FAILED
    assert finding.observed == f"{SOURCE}:3 imports `geometry_msgs`"
    assert "Don't forget the dependencies" in finding.hint
    assert "`<depend>geometry_msgs</depend>`" in finding.hint
    # What is to be changed is package.xml, not the import.
    (place,) = finding.evidence.places
    assert (place.file, place.line) == ("src/bot_publisher/package.xml", 10)


def test_every_forgotten_dependency_is_listed_once():
    again = Import("geometry_msgs", SOURCE, 30)
    finding = judged(ros_imports=(*package().ros_imports, again))
    assert finding.observed == (f"{SOURCE}:1 imports `rclpy`; {SOURCE}:3 imports `geometry_msgs`")
    assert "`<depend>rclpy</depend>` and `<depend>geometry_msgs</depend>`" in finding.hint


@pytest.mark.parametrize(
    "unneeded",
    [
        Import("sensor_msgs", SOURCE, 5, optional=True),
        Import("bot_publisher", SOURCE, 6),
    ],
)
def test_what_needs_no_entry(unneeded):
    imports = (*package().ros_imports, unneeded)
    # Nor does an entry matter of which this machine cannot tell, or a broken file that was read.
    rare = Dependency("python3-rare", "exec_depend", 12, known=None)
    broken = (SourceError(SOURCE, 9, "invalid syntax"),)
    finding = judged(RCLPY, GEOMETRY, rare, ros_imports=imports, syntax_errors=broken)
    assert finding.status is Status.PASSED


@pytest.mark.parametrize(
    ("dependencies", "words"),
    [
        (
            (RCLPY, Dependency("geometry_msgs", "test_depend", 11, known=True)),
            "test_depend counts for tests only",
        ),
        (
            (RCLPY, Dependency("geometry_msgs", "export/exec_depend", 16)),
            "names it inside <export>, where it does not count",
        ),
        (
            (RCLPY, GEOMETRY, Dependency("geometry_msg", "depend", 12, known=False)),
            "Did you mean `geometry_msgs` instead of `geometry_msg`?",
        ),
        (
            (RCLPY, GEOMETRY, Dependency("zzzz", "depend", 12, known=False)),
            "Remove `zzzz` from package.xml.",
        ),
    ],
)
def test_an_entry_that_does_not_help_is_reported(dependencies, words):
    finding = judged(*dependencies)
    assert finding.status is Status.FAILED
    assert words in f"{finding.observed} | {finding.hint}"


def test_both_kinds_of_fault_are_one_finding():
    finding = judged(RCLPY, Dependency("geomtry_msgs", "depend", 12, known=False))
    assert "imports `geometry_msgs`" in finding.observed
    assert "`geomtry_msgs`, which does not exist" in finding.observed
    assert len(finding.evidence.tables[0].rows) == 2


def test_a_package_of_the_same_submission_exists():
    own = Dependency("bot_interfaces", "depend", 12, known=False)
    finding = judged(RCLPY, GEOMETRY, own, packages=(package("bot_interfaces"),))
    assert finding.status is Status.PASSED


def test_a_file_that_python_cannot_read_hides_its_imports():
    error = SourceError(SOURCE, 9, "invalid syntax")
    finding = judged(RCLPY, syntax_errors=(error,), imports=(), ros_imports=())
    assert finding.status is Status.FAILED
    assert f"the imports cannot be read: {SOURCE}:9: invalid syntax" in finding.observed


def test_a_broken_package_xml_and_a_missing_package():
    error = SourceError("src/bot_publisher/package.xml", 8, "mismatched tag")
    assert "mismatched tag" in judged(manifest_error=error).observed
    other = submission(package("bot_publishr"))
    assert "`bot_publishr`" in failing("package.dependencies", other, package=NAME)


@given(
    imported=st.sets(st.sampled_from(["rclpy", "geometry_msgs", "nav_msgs", "tf2_ros"])),
    named=st.sets(st.sampled_from(["rclpy", "geometry_msgs", "nav_msgs", "tf2_ros", "std_msgs"])),
)
def test_passes_exactly_when_all_that_is_imported_is_named(imported, named):
    finding = judged(
        *(Dependency(name, "depend", 1, known=True) for name in sorted(named)),
        ros_imports=tuple(Import(name, SOURCE, 1) for name in sorted(imported)),
    )
    assert (finding.status is Status.PASSED) == (imported <= named)
    for name in imported - named:
        assert f"<depend>{name}</depend>" in finding.hint


def imported(module, file=INSTALLED, line=7):
    return recording(declarations=(declared("imported", module=module, file=file, line=line),))


def test_a_module_whose_name_is_put_together_is_known_from_a_run():
    handed_in = submission(package(dependencies=(RCLPY, GEOMETRY)))
    known = with_runtime_imports(handed_in, [imported("sensor_msgs")])
    assert f"{SOURCE}:7 imports `sensor_msgs`" in failing(
        "package.dependencies", known, package=NAME
    )


@pytest.mark.parametrize(
    "run",
    [
        # By a library; of no package of ROS; named in the code, and so judged there already.
        imported("sensor_msgs", "/opt/ros/jazzy/lib/python3.12/site-packages/tf2_ros/buffer.py"),
        imported("scipy"),
        imported("geometry_msgs", line=90),
        # The process itself wrote it.
        imported(["sensor_msgs"]),
        imported("sensor_msgs", line="7"),
    ],
)
def test_what_is_not_the_student_s_own_import_needs_no_entry(run):
    handed_in = submission(package(dependencies=(RCLPY, GEOMETRY)))
    assert with_runtime_imports(handed_in, [run]) == handed_in


@pytest.mark.parametrize(
    ("names", "stars", "passes"),
    [
        ({"Twist": "geometry_msgs.msg.Twist"}, (), True),
        ({"helper": "bot_publisher.helper"}, (), False),
        ({"drive": "bot_publisher.helper.drive"}, (), False),
        ({"bot_publisher": "bot_publisher"}, (), False),
        ({}, ("bot_publisher.helper",), False),
    ],
)
def test_only_the_modules_of_an_executable_count_if_the_author_says_so(names, stars, passes):
    helper = "src/bot_publisher/bot_publisher/helper.py"
    subject = package(
        dependencies=(RCLPY, GEOMETRY),
        ros_imports=(*package().ros_imports, Import("sensor_msgs", helper, 1)),
        sources=(
            SourceFile(SOURCE, "bot_publisher.node", names=tuple(names.items()), stars=stars),
            SourceFile(helper, "bot_publisher.helper"),
        ),
    )
    assert judged_package(subject).status is Status.FAILED
    finding = judged_package(subject, executable="bot_pub")
    assert finding.status is (Status.PASSED if passes else Status.FAILED)


def judged_package(subject, **parameters):
    return judge("package.dependencies", submission(subject), package=NAME, **parameters)
