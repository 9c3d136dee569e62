"""package.found, package.builds and package.executable."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.submission import BuildRecord, Dependency, SourceError
from tests.checks.builder import failing, judge, package, submission

NAME = "bot_publisher"
CULPRIT = SourceError("src/bot_publisher/setup.py", 12, "NameError: name 'x' is not defined")
LOG = """\
Starting >>> other
running egg_info
Finished <<< other [0.30s]
Starting >>> bot_publisher
Traceback (most recent call last):
  File "src/bot_publisher/setup.py", line 12, in <module>
    x
NameError: name 'x' is not defined
Failed   <<< bot_publisher [0.40s, exited with code 1]

Summary: 0 packages finished [0.50s]
  1 package failed: bot_publisher
  1 package had stderr output: bot_publisher
"""

NEEDS_NAV2 = """\
Starting >>> {}
CMake Error at CMakeLists.txt:3 (find_package):
  Could not find a package configuration file provided by "nav2_msgs" with
  any of the following names:
"""


def failed_build(*failed, log=LOG, **changes):
    defaults = {"succeeded": False, "duration_s": 0.5, "failed_packages": failed, "log": log}
    return BuildRecord(**{**defaults, **changes})


class TestFound:
    def found(self, subject, **parameters):
        return failing("package.found", subject, package=NAME, **parameters)

    def test_a_package_of_that_name_passes(self):
        finding = judge("package.found", submission(), package=NAME, build_type="ament_python")
        assert finding.status is Status.PASSED
        assert "src/bot_publisher" in finding.observed

    def test_a_submission_that_cannot_be_read_says_why(self):
        problem = "two packages are called bot_publisher: src/a and src/b"
        found = self.found(submission(problem=problem))
        assert problem in found
        assert "each of them once" in found

    def test_a_misspelt_package_is_named(self):
        found = self.found(submission(package("bot_publishr")))
        assert "found package `bot_publishr`" in found
        assert "<name>bot_publisher</name>" in found
        assert "in setup.py, setup.cfg, resource/" in found

    def test_a_misspelt_name_of_a_cmake_package(self):
        found = self.found(submission(package("bot_publishr", build_type="ament_cmake")))
        assert "in project(...) of CMakeLists.txt" in found
        assert "setup.py" not in found

    def test_broken_xml_is_named_with_its_line(self):
        error = SourceError("src/bot_publisher/package.xml", 8, "mismatched tag")
        finding = judge("package.found", submission(package(manifest_error=error)), package=NAME)
        assert finding.status is Status.FAILED
        assert "src/bot_publisher/package.xml:8: mismatched tag" in finding.observed
        assert finding.evidence.places == (error,)

    def test_broken_xml_may_hide_the_name(self):
        error = SourceError("src/p/package.xml", 8, "mismatched tag")
        found = self.found(submission(package("p", manifest_error=error)))
        assert "src/p/package.xml:8: mismatched tag" in found

    def test_a_wrong_build_type(self):
        found = self.found(submission(package(build_type="cmake")), build_type="ament_python")
        assert "its build type is cmake" in found
        assert "<build_type>ament_python</build_type>" in found

    def test_one_of_several_build_types(self):
        asked = ["ament_python", "ament_cmake"]
        compiled = submission(package(build_type="ament_cmake"))
        assert judge("package.found", compiled, package=NAME, build_type=asked).status == "passed"
        found = self.found(submission(package(build_type="cmake")), build_type=asked)
        assert "<build_type>ament_python</build_type></export> or <export>" in found

    def test_a_name_that_ros_does_not_allow_is_the_authors_mistake(self):
        with pytest.raises(ValueError, match="is not a package name"):
            judge("package.found", submission(), package="Bot Publisher")


class TestBuilds:
    def found(self, **build):
        return judge("package.builds", submission(**build), package=NAME)

    def test_a_package_that_builds_passes(self):
        assert self.found().status is Status.PASSED

    def test_the_students_line_comes_first(self):
        finding = self.found(build=failed_build(NAME, culprit=CULPRIT))
        assert finding.status is Status.FAILED
        assert str(CULPRIT) in finding.observed
        assert finding.evidence.places == (CULPRIT,)

    def test_another_packages_error_is_not_its_own(self):
        other = SourceError("src/notes/setup.py", 1, "RuntimeError: not finished")
        finding = self.found(build=failed_build("notes", NAME, culprit=other))
        assert finding.status is Status.FAILED
        assert "notes" not in finding.observed
        assert finding.evidence.log[-1] == "NameError: name 'x' is not defined"

    def test_the_error_of_a_package_that_it_waits_for_is_reported(self):
        other = SourceError("src/notes/setup.py", 1, "RuntimeError: not finished")
        log = "Starting >>> notes\nRuntimeError: not finished\nFailed   <<< notes\n"
        finding = self.found(build=failed_build("notes", NAME, culprit=other, log=log))
        assert "src/notes/setup.py:1: RuntimeError: not finished" in finding.observed

    def test_the_log_is_the_packages_own_without_chatter(self):
        finding = self.found(build=failed_build(NAME))
        assert finding.evidence.log == (
            "Traceback (most recent call last):",
            '  File "src/bot_publisher/setup.py", line 12, in <module>',
            "    x",
            "NameError: name 'x' is not defined",
        )

    def test_the_log_is_not_that_of_a_package_whose_name_begins_the_same(self):
        log = f"{LOG}Starting >>> {NAME}_msgs\nanother\nFailed   <<< {NAME}_msgs [1s]\n"
        finding = self.found(build=failed_build(NAME, log=log))
        assert finding.evidence.log[-1] == "NameError: name 'x' is not defined"

    def test_the_log_ends_at_the_first_error(self):
        noise = "subprocess.CalledProcessError: Command '...' returned non-zero exit status 1."
        log = LOG.replace("defined\nFailed", f"defined\n{noise}\nFailed")
        finding = self.found(build=failed_build(NAME, log=log, culprit=CULPRIT))
        assert finding.evidence.log[-1] == CULPRIT.message
        assert self.found(build=failed_build(NAME, log=log)).evidence.log[-1] == noise

    def test_a_log_without_a_block_of_its_own(self):
        log = "Starting >>> bot_publisher\nCMake Error: no CMakeLists.txt\nFailed   <<< x\n"
        finding = self.found(build=failed_build(NAME, log=log))
        assert finding.evidence.log == ("CMake Error: no CMakeLists.txt",)

    def test_no_more_than_the_last_lines(self):
        log = "\n".join(f"line {n}" for n in range(100))
        assert self.found(build=failed_build(NAME, log=log)).evidence.log == tuple(
            f"line {n}" for n in range(85, 100)
        )

    def test_a_build_that_was_ended_for_another_reason_says_which(self):
        log = "spam\nspam\n\n[rosgrade: the build was ended because it wrote too much output]\n"
        finding = self.found(build=failed_build(NAME, log=log))
        assert "failed: the build was ended because it wrote too much output" in finding.observed

    def test_of_two_failed_packages_the_first_is_blamed(self):
        log = "Failed   <<< other [1s]\nFailed   <<< bot_publisher [1s]\n"
        subject = submission(
            package(), package("other"), build=failed_build("bot_publisher", "other", log=log)
        )
        found = failing("package.builds", subject, package=NAME)
        assert "because" not in found

    @pytest.mark.parametrize("ended", ["Failed   <<< bot_publisher", "Aborted  <<< bot_publisher"])
    def test_what_is_not_installed_here_is_not_the_student_s_fault(self, ended):
        log = f"{NEEDS_NAV2.format('other')}Failed   <<< other [1s]\n"
        if ended.startswith("Failed"):
            log += f"{NEEDS_NAV2.format('bot_publisher')}"
        build = failed_build(
            "bot_publisher", "other", log=f"{log}{ended} [1s]\n", lacking=("nav2_msgs",)
        )
        packages = [package(name, build_type="ament_cmake") for name in (NAME, "other")]
        finding = judge("package.builds", submission(*packages, build=build), package=NAME)
        assert finding.status is Status.ERROR
        assert "`nav2_msgs`" in finding.observed

    @pytest.mark.parametrize(
        ("other", "lacking", "words"),
        [
            ("ament_cmake", "nav2_msgs", NEEDS_NAV2.format("other")),
            ("ament_cmake", "g++", "Starting >>> other\nThe CMAKE_CXX_COMPILER is not set\n"),
            (
                "ament_python",
                "generate_parameter_library_py",
                "Starting >>> other\nModuleNotFoundError: No module named "
                "'generate_parameter_library_py'\n",
            ),
        ],
    )
    def test_what_rests_on_a_package_that_lacks_something_here_is_not_judged(
        self, other, lacking, words
    ):
        log = f"{words}Failed   <<< other [1s]\n\nSummary: 0 packages finished [1s]\n"
        build = failed_build(NAME, "other", log=log, lacking=(lacking,))
        packages = [
            package(dependencies=(Dependency("other", "exec_depend"),)),
            package("other", build_type=other),
        ]
        for name in (NAME, "other"):
            finding = judge("package.builds", submission(*packages, build=build), package=name)
            assert finding.status is Status.ERROR
            assert f"`{lacking}`" in finding.observed
            assert "irst" not in finding.hint
        alone = [package(), packages[1]]
        only = replace(build, failed_packages=("other",))
        passed = judge("package.builds", submission(*alone, build=only), package=NAME)
        assert passed.status is Status.PASSED

    def test_a_failure_that_follows_from_a_mistake_names_that_mistake(self):
        log = f"{NEEDS_NAV2.format('other')}Failed   <<< other [1s]\n"
        log += "Starting >>> wrong\nFailed   <<< wrong [1s]\n"
        build = failed_build(NAME, "other", "wrong", log=log, lacking=("nav2_msgs",))
        needs = tuple(Dependency(name, "depend") for name in ("other", "wrong"))
        others = (package(name, build_type="ament_cmake") for name in ("other", "wrong"))
        subject = submission(package(dependencies=needs), *others, build=build)
        finding = judge("package.builds", subject, package=NAME)
        assert finding.status is Status.FAILED
        assert "because `wrong` failed to build" in finding.observed

    def test_a_setup_py_that_speaks_as_cmake_is_not_excused(self):
        log = f"{NEEDS_NAV2.format(NAME)}Failed   <<< bot_publisher [1s, exited with code 1]\n"
        build = failed_build(NAME, log=log, lacking=("nav2_msgs",))
        finding = judge("package.builds", submission(package(), build=build), package=NAME)
        assert finding.status is Status.FAILED

    def test_what_another_package_lacks_is_no_excuse(self):
        log = f"{NEEDS_NAV2.format('other')}Failed   <<< other [1s]\n{LOG}"
        build = failed_build("bot_publisher", "other", log=log, lacking=("nav2_msgs",))
        subject = submission(package(), package("other"), build=build)
        assert judge("package.builds", subject, package=NAME).status is Status.FAILED

    @pytest.mark.parametrize("check", ["package.builds", "package.dependencies", "source.no_print"])
    def test_syntax_of_jazzy_s_python_is_not_the_student_s_fault(self, check):
        newer = SourceError("src/bot_publisher/node.py", 3, "`type` alias statement on Python 3.11")
        finding = judge(check, submission(package(newer_syntax=(newer,))), package=NAME)
        assert finding.status is Status.ERROR
        assert "node.py:3: `type` alias" in finding.observed

    def test_the_failure_of_another_package_does_not_count(self):
        subject = submission(package(), package("other"), build=failed_build("other"))
        assert judge("package.builds", subject, package=NAME).status is Status.PASSED
        assert judge("package.builds", subject, package="other").status is Status.FAILED

    @pytest.mark.parametrize("file", ["node.py", "__init__.py"])
    def test_a_syntax_error_that_leaves_nothing_to_run(self, file):
        error = SourceError(f"src/bot_publisher/bot_publisher/{file}", 9, "SyntaxError: ':'")
        subject = submission(package(syntax_errors=(error,)))
        finding = judge("package.builds", subject, package=NAME)
        assert finding.status is Status.FAILED
        assert f"Python cannot read {error}" in finding.observed
        assert finding.evidence.places == (error,)

    def test_a_module_in_utf_16_has_no_line_to_mend(self):
        error = SourceError(
            "src/bot_publisher/bot_publisher/node.py",
            None,
            "SyntaxError: source code string cannot contain null bytes",
        )
        finding = judge("package.builds", submission(package(syntax_errors=(error,))), package=NAME)
        assert finding.hint.startswith("Save this file as plain text in UTF-8, not in UTF-16;")

    def test_the_file_in_resource_is_not_there(self):
        said = "can't copy 'resource/bot_pub': doesn't exist or not a regular file"
        error = SourceError("src/bot_publisher/setup.py", None, said)
        subject = submission(package(), build=failed_build(NAME, culprit=error))
        finding = judge("package.builds", subject, package=NAME)
        assert finding.hint.startswith(f"Create the empty file resource/{NAME}:")

    def test_a_syntax_error_in_a_file_that_is_not_needed(self):
        unused = SourceError("src/bot_publisher/bot_publisher/old.py", 9, "SyntaxError: ':'")
        subject = submission(package(syntax_errors=(unused,)))
        assert judge("package.builds", subject, package=NAME).status is Status.PASSED

    def test_a_syntax_error_in_another_executable_of_the_package(self):
        other = SourceError("src/bot_publisher/bot_publisher/next.py", 9, "SyntaxError: ':'")
        subject = submission(
            package(
                syntax_errors=(other,),
                entry_points=(
                    ("bot_pub", "bot_publisher.node:main"),
                    ("next", "bot_publisher.next:main"),
                ),
                files=(
                    ("bot_publisher/node.py", "src/bot_publisher/bot_publisher/node.py"),
                    ("bot_publisher/next.py", "src/bot_publisher/bot_publisher/next.py"),
                ),
            )
        )
        assert judge("package.builds", subject, package=NAME).status is Status.PASSED

    def test_a_build_that_did_not_run_is_reported(self):
        assert self.found(build=None).status is Status.ERROR

    def test_without_a_package_that_is_the_cause(self):
        found = failing("package.builds", submission(package("bot_publishr")), package=NAME)
        assert "found package `bot_publishr`" in found


class TestExecutable:
    WANTED = {"package": NAME, "executable": "bot_pub"}  # noqa: RUF012

    def judge(self, **changes):
        return judge("package.executable", submission(package(**changes)), **self.WANTED)

    @pytest.mark.parametrize(
        "changes",
        [
            {},
            # The missing target of another executable, and a syntax error.
            {"missing_targets": (("other", SourceError("setup.py", 22, "no module `x`")),)},
            {"syntax_errors": (SourceError("node.py", 9, "invalid syntax"),)},
        ],
    )
    def test_what_is_installed_passes(self, changes):
        finding = self.judge(**changes)
        assert finding.status is Status.PASSED
        assert finding.expected == "the executable `bot_pub`, for `ros2 run bot_publisher bot_pub`"

    @pytest.mark.parametrize(
        ("there", "rule"),
        [
            ({"executables": ("bot",)}, "lib/bot_publisher/bot:=lib/bot_publisher/bot_pub"),
            ({"misplaced_executables": ("bot_pub",)}, "bin/bot_pub:=lib/bot_publisher/bot_pub"),
            ({"executables": ("bot", "other")}, ""),
            ({"executables": ("b t",)}, ""),
            ({}, ""),
        ],
    )
    def test_the_one_program_of_a_package_is_run_in_place_of_what_is_missing(self, there, rule):
        record = submission(package(**{"executables": (), **there}))
        names = judge("package.executable", record, **self.WANTED, remap=True).names
        assert " ".join(map(str, names.wrong)) == rule
        assert not judge("package.executable", record, **self.WANTED).names

    def test_a_failed_build_is_the_deeper_cause(self):
        subject = submission(package(executables=()), build=failed_build(NAME, culprit=CULPRIT))
        assert str(CULPRIT) in failing("package.executable", subject, **self.WANTED)

    def test_without_a_build_that_is_the_cause(self):
        finding = judge("package.executable", submission(build=None), **self.WANTED)
        assert finding.status is Status.ERROR
