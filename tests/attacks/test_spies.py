"""What a submission cannot read, write or reach: at build, at import, in the node.

One source tries some forty things and says what came of each. A node is ended for some of them,
which :mod:`tests.attacks.test_hostile` tries one by one. The control runs the same source
as the ordinary process that it would be without a sandbox.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from grader.grading.grading import Grading
from grader.grading.spine import HandedIn, grade
from grader.findings.finding import Status
from tests.attacks.conftest import Targets
from tests.attacks.submissions import write_submission
from tests.submission.samples import MANIFEST

pytestmark = [pytest.mark.ros, pytest.mark.slow]

# What nothing on an ordinary machine stands in the way of.
OPEN_WITHOUT_SANDBOX = {
    "read_hidden_checks",
    "read_instructors_home",
    "read_other_submission",
    "read_reference",
    "read_assignments",
    "read_code_of_rosgrade",
    "import_rosgrade",
    "import_library_of_rosgrade",
    "read_environment_of_the_grader",
    "read_command_line_of_the_grader",
    "forge_result",
    "plant_in_cache",
    "reach_listener_on_loopback",
    "reach_abstract_socket",
    "reach_socket_file",
    "hide_memory_in_a_file",
    "hide_memory_in_a_segment",
}
OTHER_MANIFEST = MANIFEST.replace("bot_publisher", "other_package").replace(
    "ament_python", "ament_cmake"
)
CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(other_package NONE)
execute_process(COMMAND {python} ${{CMAKE_CURRENT_SOURCE_DIR}}/spy.py ERROR_VARIABLE said)
message(STATUS "${{said}}")
find_package(ament_cmake REQUIRED)
ament_package()
"""


REPLACE_RECORD = """\
import os
places = [line.split()[4] for line in open('/proc/self/mountinfo')]
beside = next(place for place in places if '.unfinished-' in place).removesuffix('/install')
try:
    os.symlink({target!r}, beside + '/build.json')
except OSError:
    pass
"""
REDIRECT = """\
import glob, os, sys
if 'install' in sys.argv:
    for path in glob.glob(os.environ['HOME'] + '/../*.cmake'):
        os.unlink(path)
        os.symlink({target!r}, path)
    # colcon then goes on with the other packages, and is started again.
    print('Exception in job execution', flush=True)
    sys.exit(1)
"""


def outcomes(text: str) -> dict[str, str]:
    """What came of each attack, by its name."""
    return {name: what for name, what in re.findall(r"ATTACK (\w+) (refused|succeeded)", text)}


def all_refused(text: str) -> None:
    found = outcomes(text)
    assert len(found) >= 38
    succeeded = [line for line in text.splitlines() if re.search(r"ATTACK \w+ succeeded", line)]
    assert not succeeded


def untouched(targets: Targets) -> None:
    assert not targets.reached
    assert (targets.folder / "results" / "result.json").read_text() == "secret\n"
    assert not list(Path(sys.prefix).glob("lib/python3*/site-packages/planted*"))
    assert not list(Path(targets.values["cache"]).glob("python/*/planted"))


def test_without_a_sandbox_the_same_attacks_succeed(targets: Targets, tmp_path: Path) -> None:
    file = tmp_path / "spy.py"
    for name in ("builds/other/build.json", "python/tree/file"):
        # The control must not damage the environment that the tests themselves run in.
        (tmp_path / "cache" / name).parent.mkdir(parents=True)
        (tmp_path / "cache" / name).touch()
    targets.values["cache"] = str(tmp_path / "cache")
    source = targets.spy().replace("    main()", f"    main(only={sorted(OPEN_WITHOUT_SANDBOX)!r})")
    file.write_text(source, encoding="utf-8")
    said = subprocess.run(
        [sys.executable, str(file)], capture_output=True, text=True, check=True
    ).stderr
    assert {name for name, what in outcomes(said).items() if what == "succeeded"} == (
        OPEN_WITHOUT_SANDBOX
    ), said
    assert len(targets.reached) == 3


def test_nothing_is_reached_by_a_node_or_at_its_import(
    grading: Grading, targets: Targets, tmp_path: Path
) -> None:
    submission = write_submission(
        tmp_path / "eve",
        at_import="from bot_publisher import spy\nspy.main(but=spy.NOTICED)",
        attack="spy.main(but=spy.NOTICED)",
        files={"bot_publisher/spy.py": targets.spy()},
    )
    graded = grade(HandedIn(submission, tmp_path / "out"), grading)
    log = "\n".join(line.text for line in graded.recordings["run"].log)
    all_refused(log)
    untouched(targets)
    assert log.count("ATTACK read_hidden_checks refused") == 2
    assert graded.grade.full_points, graded.grade


def test_nothing_is_reached_by_setup_py_or_cmake(
    grading: Grading, targets: Targets, tmp_path: Path
) -> None:
    submission = write_submission(
        tmp_path / "eve" / "bot_publisher",
        at_build="import sys; sys.path.insert(0, '.'); import spy; spy.main()",
        files={
            "spy.py": targets.spy(),
            "../other_package/package.xml": OTHER_MANIFEST,
            "../other_package/CMakeLists.txt": CMAKE.format(python=sys.executable),
            "../other_package/spy.py": targets.spy(),
        },
    )
    graded = grade(HandedIn(submission.parent, tmp_path / "out"), grading)
    assert graded.prepared.record.build is not None
    log = graded.prepared.record.build.log
    all_refused(log)
    untouched(targets)
    assert log.count("ATTACK read_hidden_checks refused") >= 2
    assert graded.grade.full_points, log


@pytest.mark.parametrize(("script", "status"), [(REPLACE_RECORD, Status.PASSED), (REDIRECT, Status.FAILED)])
def test_rosgrade_writes_nothing_through_a_link_of_a_build(
    grading: Grading, targets: Targets, tmp_path: Path, script: str, status: Status
) -> None:
    cmake = CMAKE.replace("execute_process", "# ").replace("message(", "# (")
    submission = write_submission(
        tmp_path / "eve" / "bot_publisher",
        at_build=script.format(target=targets.values["result"]),
        files={
            "../other_package/package.xml": OTHER_MANIFEST,
            "../other_package/CMakeLists.txt": cmake.format(python=sys.executable),
        },
    )
    graded = grade(HandedIn(submission.parent, tmp_path / "out"), grading)
    assert graded.grade.result("builds").status is status
    untouched(targets)
