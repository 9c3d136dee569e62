"""source.* of C++: right code passes in any style, and what cannot be read costs nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.findings.words import speaking
from grader.recording.submission import CPP, BuildRecord
from grader.submission.read.cpp import source_file, unread
from grader.submission.read.cpp_contents import outline
from tests.checks.builder import failing, judge, package, submission
from tests.checks.test_source_checks import files as of_python

PACKAGE = {"package": "bot_publisher"}
FOLDER = "src/bot_publisher"
BASE = """\
#pragma once
#include <rclcpp/rclcpp.hpp>
namespace robots {
/// A robot.
class RobotNode : public rclcpp::Node {
public:
  using rclcpp::Node::Node;
  /// Moves it.
  virtual void move(double distance) = 0;
  /// Stops it.
  void stop();
protected:
  rclcpp::Publisher<Twist>::SharedPtr publisher_;
};
}
"""
ROVER = """\
#include "robot_node.hpp"
namespace robots {
/// Has wheels.
class Rover : public RobotNode {
public:
  void move(double distance) override;
private:
  double wheel_;
};
void RobotNode::stop() {}
void Rover::move(double distance) { wheel_ += distance; }
}
"""
DRONE = """\
#include "robot_node.hpp"
/** Flies. */
struct Drone final : robots::RobotNode {
  auto move(double distance) -> void final { stop(); }
};
"""


@pytest.fixture(autouse=True)
def _in_cpp():
    with speaking(CPP):
        yield


def files(**texts: str):
    read = (
        source_file(f"{FOLDER}/{name}.hpp", outline(text.encode())) for name, text in texts.items()
    )
    sources = tuple(read)
    listed = (f"{FOLDER}/main.cpp", *(one.path for one in sources))
    made = package(sources=sources, build_type="ament_cmake")
    return submission(made, files=listed)


def robots(**changed: str):
    return files(**{"robot_node": BASE, "rover": ROVER, "drone": DRONE, **changed})


def passes(check, run, /, **parameters) -> bool:
    finding = judge(check, run, **PACKAGE, **parameters)
    assert finding.status in (Status.PASSED, Status.FAILED), finding.observed
    return finding.status is Status.PASSED


class TestClass:
    @pytest.mark.parametrize(
        "text",
        [
            "class Bot : public rclcpp::Node {};",
            "class Bot : public ::rclcpp::Node {};",
            "using rclcpp::Node; class Bot : public Node {};",
            "using namespace rclcpp; class Bot : public Node {};",
            "using Base = rclcpp::Node; class Bot : public Base {};",
            "typedef rclcpp::Node A; using B = A; struct Bot : B {};",
            "namespace rl = rclcpp_lifecycle; class Bot : public rl::LifecycleNode {};",
            "class A : public rclcpp::Node {}; class Bot : public A {};",
            "namespace n { class A : public rclcpp::Node {}; class Bot : public A {}; }",
            "namespace n { class A : public rclcpp::Node {}; } class Bot : public n::A {};",
            "namespace n { class A : public rclcpp::Node {}; }\n"
            "using namespace n; class Bot : A {};",
            "namespace a::b { class A : public rclcpp::Node {}; }\n"
            "namespace a { class Bot : public b::A {}; }",
            "template <class T> class A : public rclcpp::Node {}; class Bot : public A<Bot> {};",
            "class Other {}; class BOT_PUBLIC Bot : public Other, public rclcpp::Node {};",
        ],
    )
    def test_every_style_is_right(self, text):
        assert passes("source.class", files(bot=text), name="Bot")

    def test_a_base_class_in_another_file_and_an_alias_in_a_header(self):
        header = "namespace n { using Base = rclcpp::Node; class A : public Base {}; }"
        run = files(a=header, bot="using n::A; class Bot : public A {};")
        assert passes("source.class", run, name="Bot")

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("class Bot {};", f"`Bot` inherits nothing ({FOLDER}/bot.hpp:1"),
            ("class Node {}; class Bot : public Node {};", "`Bot` inherits `Node`"),
            ("class Bot : public rclcpp::Executor {};", "inherits `rclcpp::Executor`"),
            ("// class Bot : public rclcpp::Node {};", "no class is defined"),
            ('auto t = R"(class Bot : public rclcpp::Node {};)";', "no class is defined"),
            ("class A : public B {}; class B : public A {}; class Bot : A {};", "inherits `A`"),
        ],
    )
    def test_what_is_no_node(self, text, words):
        found = failing("source.class", files(bot=text), **PACKAGE, name="Bot")
        assert words in found and "public rclcpp::Node" in found

    def test_a_base_class_that_was_not_handed_in_is_left_to_people(self):
        for text in ("class Bot : public nav2::Base {};", "template <class T> class Bot : T {};"):
            finding = judge("source.class", files(bot=text), **PACKAGE)
            assert finding.status is Status.ERROR
            assert "which was not handed in" in finding.observed

    def test_an_abstract_base_class_and_two_robots(self):
        run = robots()
        assert passes("source.class", run, name="RobotNode", abstract=True, declares=["stop"])
        assert passes("source.class", run, inherits="RobotNode", overrides=["move"], at_least=2)
        assert passes("source.class", run, inherits="RobotNode", abstract=False, at_least=2)
        assert passes("source.class", run, name="RobotNode", shares=["stop", "publisher_"])

    @pytest.mark.parametrize(
        ("changed", "parameters", "words"),
        [
            (
                {"robot_node": BASE.replace(" = 0", "")},
                {"name": "RobotNode", "abstract": True},
                f"`robots::RobotNode` is not abstract ({FOLDER}/robot_node.hpp:5)",
            ),
            (
                {"rover": ROVER.replace("void move(double distance) override;", "")},
                {"name": "Rover", "inherits": "RobotNode", "overrides": ["move"]},
                "`robots::Rover` does not define `move()` itself",
            ),
            (
                {"rover": ROVER.replace("void move(double distance) override;", "")},
                {"name": "Rover", "inherits": "RobotNode", "abstract": False},
                "`robots::Rover` is abstract",
            ),
            (
                {"rover": ROVER.replace("move(double distance) override", "move(int a, int b)")},
                {"name": "Rover", "inherits": "RobotNode", "overrides": ["move"]},
                "not virtual with these parameters",
            ),
            (
                {"rover": ROVER.replace("double wheel_;", "void stop();")},
                {"name": "RobotNode", "shares": ["stop"]},
                f"declares `stop` again ({FOLDER}/rover.hpp:8)",
            ),
            (
                {"drone": ""},
                {"inherits": "RobotNode", "at_least": 2},
                "only `robots::Rover`: 1 of 2",
            ),
            ({}, {"name": "RobotNode", "declares": ["publisher"]}, "it has `publisher_`"),
        ],
    )
    def test_what_is_missed_is_told_with_its_line(self, changed, parameters, words):
        assert words in failing("source.class", robots(**changed), **PACKAGE, **parameters)

    def test_a_virtual_method_is_overridden_without_the_word_too(self):
        run = robots(rover=ROVER.replace(" override", ""))
        assert passes("source.class", run, name="Rover", inherits="RobotNode", overrides=["move"])

    def test_what_could_not_be_read_costs_nothing(self):
        broken = "#ifdef X\nclass Bot : public rclcpp::Node {\n#else\nclass Bo {\n#endif\n};\n"
        finding = judge("source.class", files(bot=broken), **PACKAGE, name="Bot")
        assert finding.status is Status.ERROR
        assert "bot.hpp:1: C++ cannot be read from here on" in finding.observed

    def test_what_could_not_be_read_is_told_where_the_compiler_cannot_either(self):
        broken = files(bot="class Bo } {{{ ( ;")
        build = BuildRecord(False, 1.0, failed_packages=("bot_publisher",))
        found = failing("source.class", replace(broken, build=build), **PACKAGE, name="Bot")
        assert "cannot be read" in found

    def test_what_could_not_be_read_does_not_matter_where_the_class_is_there(self):
        run = robots(more="void f() { @@@ }")
        assert passes("source.class", run, name="RobotNode", abstract=True)

    def test_a_record_of_before_is_read_again(self):
        made = package(build_type="ament_cmake", imports=())
        run = submission(made, files=(f"{FOLDER}/main.cpp",))
        finding = judge("source.class", run, **PACKAGE)
        assert finding.status is Status.ERROR and "older rosgrade" in finding.observed


PYTHON_BASE = """\
from abc import ABC, abstractmethod
from rclpy.node import Node
class RobotNode(Node, ABC):
    def __init__(self):
        self.publisher = None
    @abstractmethod
    def move(self): pass
    def stop(self): pass
"""


class TestPythonClass:
    def run(self, base=PYTHON_BASE, rover="    def move(self): pass"):
        return of_python(
            base=base, rover=f"from .base import RobotNode\nclass Rover(RobotNode):\n{rover}"
        )

    def test_the_same_is_asked_of_python(self):
        run = self.run()
        shared = {"name": "RobotNode", "shares": ["stop", "publisher"], "declares": ["move"]}
        assert passes("source.class", run, **shared, abstract=True)
        derived = {"name": "Rover", "inherits": "RobotNode", "overrides": ["move"]}
        assert passes("source.class", run, **derived, abstract=False)

    @pytest.mark.parametrize(
        ("base", "rover", "parameters"),
        [
            (PYTHON_BASE.replace(", ABC)", ")"), "    pass", {"abstract": True}),
            (PYTHON_BASE.replace("    @abstractmethod\n", ""), "    pass", {"abstract": True}),
            (PYTHON_BASE, "    def stop(self): pass", {"shares": ["stop"]}),
            (PYTHON_BASE, "    def go(self): self.publisher = 1", {"shares": ["publisher"]}),
        ],
    )
    def test_what_is_missed(self, base, rover, parameters):
        assert not passes("source.class", self.run(base, rover), name="RobotNode", **parameters)

    def test_a_metaclass_makes_it_abstract_too(self):
        base = PYTHON_BASE.replace("(Node, ABC)", "(Node, metaclass=ABCMeta)")
        base = base.replace("import ABC,", "import ABCMeta,")
        assert passes("source.class", self.run(base), name="RobotNode", abstract=True)


class TestDocstrings:
    def test_a_comment_at_the_declaration_or_the_definition_will_do(self):
        assert passes("source.docstrings", robots())
        there = robots(
            robot_node=BASE.replace("  /// Stops it.\n", ""),
            rover=ROVER.replace("void RobotNode::stop", "/// Stops it.\nvoid RobotNode::stop"),
        )
        assert passes("source.docstrings", there)

    def test_the_first_without_is_named(self):
        run = robots(robot_node=BASE.replace("/// Stops", "// Stops"))
        found = failing("source.docstrings", run, **PACKAGE)
        assert (
            f"4 of 5 have a comment for Doxygen; the first without is {FOLDER}/robot_node" in found
        )
        assert "RobotNode::stop()" in found and "/// Publish" in found


class TestNames:
    def test_names_in_the_style_of_ros(self):
        assert passes("source.names", robots(), fields=["snake_case_"])

    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ("class Rover", "class my_rover", "my_rover is not CamelCase"),
            ("void RobotNode::stop", "void RobotNode::Stop", "Stop is not snake_case"),
            ("double wheel_", "double m_Wheel", "m_Wheel is not snake_case_"),
        ],
    )
    def test_a_name_in_another_style(self, old, new, words):
        run = robots(rover=ROVER.replace(old, new))
        assert words in failing("source.names", run, **PACKAGE, fields=["snake_case_"])

    def test_names_in_python(self):
        run = of_python(
            node="class Bot:\n    def __init__(self): self._x = 1\n    def go_on(self): 1"
        )
        assert passes("source.names", run, fields=["snake_case"])
        assert not passes("source.names", of_python(node="def goOn(): pass"))


class TestAvoids:
    @pytest.mark.parametrize(
        ("text", "construct"),
        [
            ("using namespace std;", "using namespace std"),
            ("using namespace std::chrono;", "using namespace"),
            ("void f() { std::this_thread::sleep_for(1s); }", "std::this_thread::sleep_for"),
            (
                "using namespace std::this_thread; void f() { sleep_for(1s); }",
                "std::this_thread::sleep_for",
            ),
            ("void f() { goto a; }", "goto"),
            ("auto f() { return new int; }", "new"),
            ("void f() { node->create_rate(1); }", "create_rate"),
            ("#define LIMIT 3", "#define"),
        ],
    )
    def test_what_is_there_is_found(self, text, construct):
        assert not passes("source.avoids", files(bot=text), constructs=[construct])

    @pytest.mark.parametrize(
        ("text", "construct"),
        [
            ("using namespace std::chrono_literals;", "using namespace std"),
            ('// using namespace std;\nauto s = "using namespace std;";', "using namespace std"),
            ("void f() { renew(); new_one(); }", "new"),
            ("void f() { my_sleep_for(); }", "sleep_for"),
            ("#ifndef BOT_HPP\n#define BOT_HPP\n#endif", "#define"),
        ],
    )
    def test_what_only_looks_like_it_is_not(self, text, construct):
        assert passes("source.avoids", files(bot=text), constructs=[construct])

    def test_python(self):
        text = "from time import sleep\nfrom math import *\nsleep(1)\ndef f():\n    global x"
        for construct in ("time.sleep", "import *", "global", "sleep"):
            assert not passes("source.avoids", of_python(node=text), constructs=[construct])
        assert passes("source.avoids", of_python(node=text), constructs=["os.system", "goto"])


def test_what_prints_is_found_in_cpp():
    run = files(bot='void f() {\n  std::cout << "a" << 1;\n  printf("b");\n}')
    found = failing("source.no_print", run, **PACKAGE)
    assert "2 places" in found and "RCLCPP_INFO" in found
    assert passes("source.no_print", files(bot='void f() { RCLCPP_INFO(l, "a"); stream << 1; }'))


def test_a_large_header_that_was_not_read_does_not_keep_the_rest_from_being_judged():
    large = unread(f"{FOLDER}/json.hpp", "larger than 512 KiB; not read as C++")
    run = robots()
    made = replace(run.packages[0], sources=(*run.packages[0].sources, large))
    assert passes("source.docstrings", replace(run, packages=(made,)))
