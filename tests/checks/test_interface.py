"""interface.*: the definition, its code and package.xml, each mistake explained."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.checks.interface.interface import Has
from grader.findings.finding import Finding, Status
from grader.recording.submission import BuildRecord, Definition, Dependency, PackageRecord
from tests.checks import builder
from tests.checks.builder import failing, judge, package, submission

INTERFACE = "bot_msgs/msg/BotStatus"
TEXT = """\
uint8 BURGER=1
uint8 WAFFLE=2
uint8 model
geometry_msgs/Pose2D pose
float64[2] velocities
"""
CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(bot_msgs)
find_package(ament_cmake REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME}
  "msg/BotStatus.msg"
  DEPENDENCIES geometry_msgs
)
ament_package()
"""
LOG = """\
Starting >>> bot_msgs
CMake Error at CMakeLists.txt:7: it does not work
Failed   <<< bot_msgs [1.2s, exited with code 1]
"""
DEPENDENCIES = (
    ("ament_cmake", "buildtool_depend"),
    ("rosidl_default_generators", "buildtool_depend"),
    ("geometry_msgs", "depend"),
    ("rosidl_default_runtime", "exec_depend"),
)


HANGS = "Starting >>> hangs\n\n[rosgrade: the build was ended after 300 s: it waited]\n"


def test_nothing_is_claimed_of_what_was_never_built():
    hangs = BuildRecord(
        False,
        300.0,
        timed_out=True,
        failed_packages=("bot_msgs", "hangs"),
        log=HANGS,
        waited=True,
    )
    for build, status, words in (
        (hangs, Status.FAILED, "it was not built, because `hangs` failed to build"),
        (replace(hangs, failed_packages=("hangs",), waited=None), Status.ERROR, "was ended"),
    ):
        subject = submission(interfaces(generated=()), package("hangs"), build=build)
        finding = judge("interface.generated", subject, interface=INTERFACE)
        assert finding.status is status
        assert words in finding.observed
        assert "installed no code" not in builder.text(finding)


@pytest.mark.parametrize(
    ("waited", "words"),
    [(True, "look for input(), a sleep"), (False, "endless loop"), (None, "Look for input()")],
)
def test_a_build_that_waits_is_told_from_one_that_computes(waited: bool | None, words: str):
    build = BuildRecord(
        False, 300.0, timed_out=True, failed_packages=("hangs",), log=HANGS, waited=waited
    )
    subject = submission(package("hangs"), build=build)
    assert words in failing("package.builds", subject, package="hangs")


def interfaces(text: str = TEXT, file: str = "msg/BotStatus.msg", **changes) -> PackageRecord:
    """A good interface package, as handed in and built."""
    definition = Definition(file, text)
    return package(
        "bot_msgs",
        **{
            "build_type": "ament_cmake",
            "dependencies": tuple(Dependency(n, k, 9, known=True) for n, k in DEPENDENCIES),
            "groups": ("rosidl_interface_packages",),
            "cmake": CMAKE,
            "definitions": (replace(definition, file=f"src/bot_msgs/{file}"),),
            "generated": (definition,) if file == "msg/BotStatus.msg" else (),
            **changes,
        },
    )


def handed_in(text: str = TEXT, file: str = "msg/BotStatus.msg", **changes):
    return submission(interfaces(text, file, **changes))


def unbuilt(text: str = TEXT, **changes):
    """The same, but CMake failed."""
    failed = BuildRecord(False, 1.2, failed_packages=("bot_msgs",), log=LOG)
    return submission(interfaces(text, **{"generated": (), **changes}), build=failed)


class TestFound:
    def found(self, subject) -> str:
        return failing("interface.found", subject, interface=INTERFACE)

    def test_passes_and_names_the_file(self):
        finding = judge("interface.found", handed_in(), interface=INTERFACE)
        assert finding.status is Status.PASSED
        assert "src/bot_msgs/msg/BotStatus.msg" in finding.observed

    def test_a_definition_that_was_not_built_counts_as_well(self):
        assert judge("interface.found", unbuilt(), interface=INTERFACE).status is Status.PASSED

    def test_a_file_anywhere_counts_if_the_build_took_it(self):
        elsewhere = (Definition("src/bot_msgs/idl/msg/BotStatus.msg", TEXT),)
        finding = judge("interface.found", handed_in(definitions=elsewhere), interface=INTERFACE)
        assert "src/bot_msgs/idl/msg/BotStatus.msg" in finding.observed

    @pytest.mark.parametrize(
        ("file", "words"),
        [
            ("msgs/BotStatus.msg", "it lies in the folder `src/bot_msgs/msgs`"),
            ("bot_msgs/msg/BotStatus.msg", "it lies in the folder `src/bot_msgs/bot_msgs/msg`"),
            ("msg/BotStatus.txt", "its suffix is not `.msg`"),
            ("msg/BotStatus", "its suffix is not `.msg`"),
            ("msg/bot_status.msg", "it is not called `BotStatus`, in CamelCase"),
            ("msg/Botstatus.msg", "it is not called `BotStatus`, in CamelCase"),
            ("msg/BotStatsu.msg", "it is not called `BotStatus`"),
        ],
    )
    def test_a_near_miss_is_named_with_the_right_path(self, file, words):
        found = self.found(handed_in(file=file))
        assert words in found
        assert "Name it `src/bot_msgs/msg/BotStatus.msg`" in found

    def test_the_definition_in_another_package(self):
        other = package("bot", definitions=(Definition("src/bot/msg/BotStatus.msg", TEXT),))
        found = self.found(submission(interfaces(definitions=(), generated=()), other))
        assert "found `src/bot/msg/BotStatus.msg`: it lies in the folder" in found


class TestFields:
    def fields(self, text: str) -> Finding:
        return judge("interface.fields", handed_in(text), interface=INTERFACE, definition=TEXT)

    @pytest.mark.parametrize(
        "text",
        [
            TEXT,
            "# a comment\n\nuint8   model  # more\ngeometry_msgs/Pose2D\tpose\n"
            "float64[2] velocities\nuint8 X=9\n",
            "char model 1\ngeometry_msgs/Pose2D pose\nfloat64[2] velocities [0.0, 0.0]\n",
        ],
    )
    def test_comments_blanks_defaults_and_constants_do_not_matter(self, text):
        assert self.fields(text).status is Status.PASSED

    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ("uint8 model\n", "", "no field `uint8 model`"),
            ("uint8 model", "uint8 modell", "`uint8 modell` instead of `uint8 model`"),
            ("uint8 model", "uint8 Model", "`uint8 Model` instead of `uint8 model`"),
            ("uint8 model", "int8 model", "`int8 model` instead of `uint8 model`"),
            ("[2]", "[]", "`float64[]` any number"),
            ("[2]", "[<=2]", "`float64[<=2] velocities` instead of `float64[2] velocities`"),
            ("[2]", "[3]", "`float64[3] velocities` instead"),
            ("[2]", "", "`float64 velocities` instead"),
            ("float64[", "float32[", "`float32[2] velocities` instead"),
            ("Pose2D", "Pose", "`geometry_msgs/Pose pose` instead of `geometry_msgs/Pose2D pose`"),
            ("geometry_msgs/", "", "A type without a package is sought in bot_msgs itself"),
            ("uint8 model", "uint8 model\nbool on", "a field `bool on` that is not asked for"),
            ("BURGER=1", "BURGER 1", "A constant has an equals sign"),
        ],
    )
    def test_each_difference_is_reported(self, old, new, words):
        found = self.fields(TEXT.replace(old, new))
        assert found.status is Status.FAILED
        assert words in f"{found.observed} | {found.hint}"
        assert found.evidence.places[0].file == "src/bot_msgs/msg/BotStatus.msg"

    def test_the_order_of_the_fields(self):
        lines = TEXT.splitlines(keepends=True)
        found = self.fields("".join([*lines[:2], lines[4], lines[2], lines[3]]))
        assert "in the order `velocities`, `model` and `pose`" in found.observed

    def test_both_definitions_stand_side_by_side(self):
        (sides,) = self.fields(TEXT.replace("[2]", "[]")).evidence.comparisons
        assert sides.expected[-1] == "float64[2] velocities"
        assert sides.observed[-1] == "float64[] velocities"

    def test_a_line_that_cannot_be_read_is_named(self):
        found = self.fields(TEXT.replace("float64[2]", "float64[2"))
        assert "src/bot_msgs/msg/BotStatus.msg:5 cannot be read" in found.observed

    def test_a_definition_in_the_assignment_that_cannot_be_read_is_refused(self):
        with pytest.raises(ValueError, match="line 1: 'model' is neither"):
            judge("interface.fields", handed_in(), interface=INTERFACE, definition="model")

    def test_the_parts_of_a_service_must_all_be_there(self):
        own = Definition("srv/Add.srv", "int64 a\nint64 sum\n")
        subject = submission(
            interfaces(definitions=(replace(own, file="src/bot_msgs/srv/Add.srv"),))
        )
        found = failing(
            "interface.fields",
            subject,
            interface="bot_msgs/srv/Add",
            definition="int64 a\n---\nint64 sum\n",
        )
        assert "has 0 lines `---`, not 1" in found
        assert "request and response" in found


ASKED = {"place": ["geometry_msgs/msg/Pose", ["float64", "float64"]], "severity": "float64"}


class TestHas:
    def has(self, definition: str, *, others: tuple[Definition, ...] = (), **asked) -> Finding:
        subject = handed_in(
            definition,
            definitions=(Definition("src/bot_msgs/msg/BotStatus.msg", definition), *others),
            generated=(Definition("msg/BotStatus.msg", definition),),
        )
        return judge("interface.has", subject, interface=INTERFACE, fields=asked or ASKED)

    @pytest.mark.parametrize(
        "text",
        [
            "geometry_msgs/Pose where\nfloat64 how_bad\n",
            "float64 how_bad\nstring note\ngeometry_msgs/Pose where\n",
            "float64 a\nfloat64 b\nfloat64 c\n",
            "Spot spot\nfloat64 c\n",
            "float64 c 1.0  # of 1\nfloat64 LEAST=0.0\ngeometry_msgs/msg/Pose[] all\nSpot s\n",
        ],
    )
    def test_any_name_order_and_one_of_the_choices_will_do(self, text: str):
        spot = Definition("src/bot_msgs/msg/Spot.msg", "float64 x\nfloat64 y\nSpot within\n")
        assert self.has(text, others=(spot,)).status is Status.PASSED

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("geometry_msgs/Pose where\n", "no field is left for severity (place is `where`)"),
            ("float64 a\nfloat64 b\n", "no field is left for place (severity is `a`)"),
            ("float64[3] all\n", "no field is left for place and severity"),
            ("", "has no field: no field is left for place and severity"),
            ("float32 a\nfloat64 b\nfloat64 c\n", "no field is left for place"),
        ],
    )
    def test_a_field_stands_for_one_thing_only(self, text: str, words: str):
        finding = self.has(text)
        assert finding.status is Status.FAILED
        assert words in finding.observed

    def test_what_to_add_is_said_and_what_is_asked_in_words(self):
        finding = self.has("float64 a\n")
        told = builder.text(finding)
        assert "`geometry_msgs/msg/Pose` or 2 fields of `float64`" in told
        assert "Its name is your choice" in told

    def test_a_word_stands_for_several_types(self):
        assert (
            self.has("uint8 n\nwstring w\n", number="number", text="text").status is Status.PASSED
        )
        assert self.has("string n\n", number="number").status is Status.FAILED

    @pytest.mark.parametrize(
        ("fields", "words"),
        [
            ({"x": "float46"}, "'float46' is no type of a field"),
            ({str(one): ["bool", "text", "float"] for one in range(9)}, "more than 256 choices"),
            ({}, "at least 1 item"),
        ],
    )
    def test_what_cannot_be_asked_is_refused(self, fields, words: str):
        with pytest.raises(ValueError, match=words):
            Has(interface=INTERFACE, fields=fields)

    def test_a_part_of_a_service_can_be_asked(self):
        text = "string name\n---\nbool ok\n"
        subject = handed_in(text, file="srv/Ask.srv")
        for part, status in (("request", Status.PASSED), ("response", Status.FAILED)):
            given = {"interface": "bot_msgs/srv/Ask", "part": part, "fields": {"name": "text"}}
            assert judge("interface.has", subject, **given).status is status
        with pytest.raises(ValueError, match="a srv has no part 'goal'"):
            Has(interface="bot_msgs/srv/Ask", part="goal", fields={"name": "text"})


def test_fields_in_another_order_pass_where_any_order_will_do():
    text = "float64 b\nuint8 a\n"
    for order, status in (("any", Status.PASSED), ("same", Status.FAILED)):
        wanted = {"definition": "uint8 a\nfloat64 b\n", "order": order}
        finding = judge("interface.fields", handed_in(text), interface=INTERFACE, **wanted)
        assert finding.status is status


class TestConstants:
    def constants(self, text: str) -> Finding:
        return judge("interface.constants", handed_in(text), interface=INTERFACE, definition=TEXT)

    @pytest.mark.parametrize(
        "text",
        [
            TEXT,
            "uint8 WAFFLE = 2\nuint8 MORE=7\nuint8 BURGER= 1\n",
            "uint8 BURGER=0x1\nuint8 WAFFLE=2",
        ],
    )
    def test_order_blanks_and_further_ones_do_not_matter(self, text):
        assert self.constants(text).status is Status.PASSED

    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ("uint8 BURGER=1\n", "", "no constant `uint8 BURGER=1`"),
            ("BURGER=1", "BURGER=0", "`uint8 BURGER=0` instead of `uint8 BURGER=1`"),
            ("BURGER=1", "burger=1", "`uint8 burger=1` instead of `uint8 BURGER=1`"),
            ("uint8 BURGER", "int32 BURGER", "`int32 BURGER=1` instead of `uint8 BURGER=1`"),
            ("BURGER=1", "BURGER 1", "no constant `uint8 BURGER=1`"),
        ],
    )
    def test_each_difference_is_reported(self, old, new, words):
        found = self.constants(TEXT.replace(old, new))
        assert found.status is Status.FAILED
        assert words in found.observed


class TestGenerated:
    def generated(self, subject) -> str:
        return failing("interface.generated", subject, interface=INTERFACE)

    def test_what_was_installed_passes_however_cmake_is_written(self):
        subject = handed_in(cmake="include(mine.cmake)\n")
        assert judge("interface.generated", subject, interface=INTERFACE).status is Status.PASSED

    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ("rosidl_generate_interfaces(", "rosidl_generate_interface(", "which does not exist"),
            (CMAKE[CMAKE.index("rosidl_gen") :], "ament_package()\n", "never calls rosidl_gen"),
            (
                "find_package(rosidl_default_generators REQUIRED)\n",
                "",
                "no find_package() for `rosidl_",
            ),
            ('"msg/BotStatus.msg"', '"BotStatus.msg"', "BotStatus.msg`, but `BotS"),
            ('"msg/BotStatus.msg"', '"msg/Wheel.srv"', "does not list `msg/BotStatus.msg`, but"),
            ('  "msg/BotStatus.msg"\n', "", "does not list `msg/BotStatus.msg` in"),
            ("  DEPENDENCIES geometry_msgs\n", "", "does not name `geometry_msgs` under DEPEND"),
            ("find_package(geometry_msgs REQUIRED)\n", "", "no find_package() for `geometry_msgs`"),
        ],
    )
    def test_what_cmake_lacks_is_reported(self, old, new, words):
        assert old in CMAKE
        finding = judge(
            "interface.generated", unbuilt(cmake=CMAKE.replace(old, new)), interface=INTERFACE
        )
        assert words in finding.observed
        assert finding.evidence.places[0].file == "src/bot_msgs/CMakeLists.txt"
        assert "it does not work" in "\n".join(finding.evidence.log)

    def test_ament_package_comes_last(self):
        lines = CMAKE.splitlines(keepends=True)
        cmake = "".join([*lines[:2], lines[-1], *lines[2:-1]])
        assert "ament_package() before rosidl" in self.generated(unbuilt(cmake=cmake))

    def test_variables_and_other_ways_to_find_packages_are_not_blamed(self):
        cmake = CMAKE.replace('"msg/BotStatus.msg"', "${files}").replace(
            "find_package(geometry_msgs REQUIRED)",
            "foreach(p a b)\nfind_package(${p})\nendforeach()",
        )
        assert "`colcon build` failed" in self.generated(unbuilt(cmake=cmake))

    def test_a_python_package_generates_nothing(self):
        found = self.generated(handed_in(build_type="ament_python", generated=()))
        assert "the build type of `bot_msgs` is ament_python" in found


class TestManifest:
    def without(self, *names: str, **changes):
        kept = tuple(d for d in interfaces().dependencies if d.name not in names)
        return handed_in(dependencies=kept, **changes)

    def test_a_complete_manifest_passes(self):
        assert judge("interface.manifest", handed_in(), interface=INTERFACE).status is Status.PASSED

    @pytest.mark.parametrize(
        ("name", "tag"),
        [
            ("rosidl_default_generators", "buildtool_depend"),
            ("rosidl_default_runtime", "exec_depend"),
            ("geometry_msgs", "depend"),
        ],
    )
    def test_each_missing_entry_is_given(self, name, tag):
        found = failing("interface.manifest", self.without(name), interface=INTERFACE)
        assert f"add to package.xml: `<{tag}>{name}</{tag}>`" in found.lower()
        assert found.count("<") == 2 * 2

    def test_a_package_that_ros_does_not_find(self):
        found = failing("interface.manifest", handed_in(registered=False), interface=INTERFACE)
        assert "installed, but not registered" in found
        assert "End `src/bot_msgs/CMakeLists.txt` with ament_package()" in found

    def test_one_tag_for_the_build_and_one_for_the_run_will_do(self):
        kept = tuple(d for d in interfaces().dependencies if d.name != "geometry_msgs")
        both = (
            Dependency("geometry_msgs", "build_depend", 3, known=True),
            Dependency("geometry_msgs", "exec_depend", 4, known=True),
        )
        subject = handed_in(dependencies=(*kept, *both))
        assert judge("interface.manifest", subject, interface=INTERFACE).status is Status.PASSED
        found = failing(
            "interface.manifest", handed_in(dependencies=(*kept, both[0])), interface=INTERFACE
        )
        assert "<exec_depend>geometry_msgs</exec_depend>" in found

    def test_a_plain_depend_serves_for_all(self):
        subject = handed_in(
            dependencies=tuple(replace(d, kind="depend") for d in interfaces().dependencies)
        )
        assert judge("interface.manifest", subject, interface=INTERFACE).status is Status.PASSED

    def test_a_definition_of_plain_types_needs_no_other_package(self):
        subject = handed_in(
            "uint8 model\n",
            dependencies=tuple(d for d in interfaces().dependencies if d.name != "geometry_msgs"),
        )
        assert judge("interface.manifest", subject, interface=INTERFACE).status is Status.PASSED
