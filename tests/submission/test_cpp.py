"""C++ as students write it is read, and what cannot be read is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.machine.ros import find as find_ros
from grader.recording.submission import CPP, SourceClass, SourceFile, SourceFunction
from grader.sandbox.sandbox import Sandbox
from grader.submission.intake.locate import opened
from grader.submission.read import cpp
from grader.submission.read.cpp import read_cpp, source_file
from grader.submission.read.cpp_contents import outline


def read(text: str | bytes) -> SourceFile:
    return source_file("bot.hpp", outline(text.encode() if isinstance(text, str) else text))


def classes(text: str) -> dict[str, tuple[str, ...]]:
    return {one.name: one.bases for one in read(text).classes}


def function(text: str, name: str) -> SourceFunction:
    return next(one for one in read(text).functions if one.name == name)


@pytest.mark.parametrize(
    ("text", "bases"),
    [
        ("class Bot : public rclcpp::Node {};", ("rclcpp::Node",)),
        ("class Bot\n  : public ::rclcpp::Node\n{\n};", ("rclcpp::Node",)),
        (
            "struct Bot final : rclcpp::Node, private virtual Named<int> {};",
            ("rclcpp::Node", "Named"),
        ),
        ("class ROBOT_PUBLIC Bot : public rclcpp::Node {};", ("rclcpp::Node",)),
        ("class [[nodiscard]] Bot : public rclcpp::Node {};", ("rclcpp::Node",)),
        ("class Bot /* a */ : /* b */ public rclcpp::Node {};", ("rclcpp::Node",)),
        ("template <typename T> class Bot : public Robot<Bot<T>> {};", ("Robot",)),
        ("#ifdef A\n#endif\nclass Bot : public rclcpp::Node {};", ("rclcpp::Node",)),
        (
            "#if 0\nclass Bot : Other {};\n#else\nclass Bot : public rclcpp::Node {};\n#endif",
            ("rclcpp::Node",),
        ),
        ("// class Bot : public Other {};\nclass Bot : public rclcpp::Node {};", ("rclcpp::Node",)),
        (
            'auto s = R"x(class Bot : public Other {};)x";\nclass Bot : public rclcpp::Node {};',
            ("rclcpp::Node",),
        ),
        ("class Bot;\nclass Bot : public rclcpp::Node { friend class Other; };", ("rclcpp::Node",)),
        (
            "class Bot : public rclcpp::Node {\n A_MACRO(Bot)\n B_MACRO(x)\npublic: Bot(); };",
            ("rclcpp::Node",),
        ),
        ("class Bot {};", ()),
    ],
)
def test_a_class_is_found_with_its_bases_in_any_style(text: str, bases: tuple[str, ...]) -> None:
    found = read(text)
    assert classes(text) == {"Bot": bases}
    assert found.unread is None


def test_names_have_their_namespaces_and_classes() -> None:
    text = """
namespace a::b { namespace { class Hidden {}; }
inline namespace v1 { class Bot { struct Inner { int z; }; void go(); }; } }
void a::b::Bot::go() { struct Local { void f(); }; }
extern "C" { class C {}; }
"""
    found = read(text)
    assert [one.name for one in found.classes] == [
        "a::b::Hidden",
        "a::b::Bot",
        "a::b::Bot::Inner",
        "<locals>::Local",
        "C",
    ]
    assert [(one.name, one.line) for one in found.functions[:2]] == [
        ("a::b::Bot::go", 3),
        ("a::b::Bot::go", 4),
    ]


METHODS = """\
class Robot : public rclcpp::Node {
public:
  explicit Robot(std::string name) : Node(name), x_{0} {}
  virtual ~Robot() = default;
  virtual void move(double x, int = 3) const = 0;
  virtual auto speed() const -> double { return 1.0; }
  [[nodiscard]] auto turn(void) noexcept -> Twist & override final;
  Twist & stop() final override;
  ROBOT_PUBLIC
  std::unique_ptr<int> own();
  template <class T> void put(T t) { (void)t; }
  bool operator==(const Robot &) const;
  Robot(const Robot &) = delete;
protected:
  rclcpp::Publisher<Twist>::SharedPtr pub_, other_;
  std::function<void(int)> callback_;
  int x_{0}, * y_ = nullptr, z_[3];
  void (*pointer_)(int);
  static constexpr int kMost = 3;
private:
  void hidden();
  struct { int inner; } both_;
};
"""


def test_methods_say_whether_they_are_virtual_pure_or_overriding() -> None:
    found = {one.short: one for one in read(METHODS).functions}
    assert set(found) == {
        *("Robot", "~Robot", "move", "speed", "turn", "stop", "own", "put", "operator==", "hidden")
    }
    assert {name for name, one in found.items() if one.virtual} == {
        *("~Robot", "move", "speed", "turn", "stop")
    }
    assert {name for name, one in found.items() if one.pure} == {"move"}
    assert {name for name, one in found.items() if one.overriding} == {"turn", "stop"}
    assert {name for name, one in found.items() if not one.public} == {"hidden"}
    assert (found["move"].parameters, found["turn"].parameters) == (2, 0)
    assert found["own"].line == 10


def test_fields_are_those_of_the_class() -> None:
    (robot,) = read(METHODS).classes
    names = [name for name, _ in robot.fields]
    assert names == ["pub_", "other_", "callback_", "x_", "y_", "z_", "pointer_", "kMost", "both_"]
    assert (robot.line, robot.end) == (1, 23)


@pytest.mark.parametrize(
    ("text", "documented"),
    [
        ("/** Moves. */\nvoid f() {}", True),
        ("/// Moves.\n///\n/// More.\nvoid f() {}", True),
        ("//! Moves.\n\ntemplate <class T>\nvoid f() {}", True),
        ("/*! Moves. */ // NOLINT\nvoid f() {}", True),
        ("/// Moves.\n[[nodiscard]] int f() {}", True),
        ("// Moves.\nvoid f() {}", False),
        ("/* Moves. */\nvoid f() {}", False),
        ("//////////\nvoid f() {}", False),
        ("int x;  ///< A number.\nvoid f() {}", False),
        ("/// A number.\nint x;\nvoid f() {}", False),
        ("void f() { /** Inside. */ }", False),
    ],
)
def test_a_comment_for_doxygen_documents_what_follows(text: str, documented: bool) -> None:
    assert function(text, "f").documented is documented


def test_a_prototype_counts_where_it_is_documented() -> None:
    assert [
        one.documented for one in read("/// Helps.\nint f();\nint g(); Foo a(b);").functions
    ] == [True]


def test_a_class_in_a_template_is_documented_by_the_comment_above() -> None:
    assert read("/// A bot.\ntemplate <class T>\nclass Bot {};").classes[0].documented


CALLS = """\
using Base = rclcpp::Node;
typedef rclcpp::Node Old;
using rclcpp::Node;
namespace rl = rclcpp_lifecycle;
using namespace std::chrono_literals;
#define LIMIT 3
#ifndef BOT_HPP
#define BOT_HPP
#endif
void Bot::start() {
  pub_ = this->create_publisher<std_msgs::msg::String>("/cmd_vel", 10);
  timer_ = create_wall_timer(500ms, [this] { msg_.linear.x = 1.0; this->pub_->publish(msg_); });
  auto s = node->create_service<std_srvs::srv::Trigger>("~/go", std::bind(&Bot::go, this, _1));
  declare_parameter<double>("speed", 0.2);
  std::this_thread::sleep_for(1s);
  std::cout << "a" << std::endl;
  printf("b"); fprintf(stderr, "c"); fprintf(file, "d"); std::println(std::cerr, "e");
  delete new int; goto end;
  Bot local(make());
}
"""


def test_calls_are_found_with_their_lines_and_names() -> None:
    found = {(one.name, one.line, one.literal) for one in read(CALLS).calls}
    assert {
        ("this.create_publisher", 11, "/cmd_vel"),
        ("create_wall_timer", 12, ""),
        ("this.pub_.publish", 12, ""),
        ("node.create_service", 13, "~/go"),
        ("declare_parameter", 14, "speed"),
        ("std::this_thread::sleep_for", 15, ""),
    } <= found


def test_what_is_named_printed_set_and_used_is_found() -> None:
    found = read(CALLS)
    assert dict(found.names) == {
        "Base": "rclcpp::Node",
        "Old": "rclcpp::Node",
        "Node": "rclcpp::Node",
        "rl": "rclcpp_lifecycle",
    }
    assert found.stars == ("std::chrono_literals",)
    assert found.sets == (("msg_.linear.x", 12),)
    assert found.prints == (16, 17)
    assert found.constructs == (
        ("using namespace std::chrono_literals", 5),
        ("#define", 6),
        ("delete", 18),
        ("new", 18),
        ("goto", 18),
    )
    assert [one.name for one in found.functions] == ["Bot::start"]


def test_what_cannot_be_read_is_said_with_its_line() -> None:
    text = (
        "class A {};\n#ifdef X\nclass B : public A {\n#else\nclass B {\n#endif\n  void f();\n};\n"
    )
    found = read(text)
    assert found.unread is not None and found.unread.line == 2
    assert "A" in {one.name for one in found.classes}


@given(
    st.one_of(st.binary(max_size=300), st.text(alphabet="{}()<>:;,*&~=0#\\\"'/\n \tclasvoiduRx"))
)
@settings(max_examples=150, deadline=None)
def test_any_bytes_give_an_outline(data: bytes | str) -> None:
    found = read(data)
    lines = [one.line for one in (*found.classes, *found.functions, *found.calls)]
    assert all(line >= 1 for line in lines)


_PARTS = [
    "class Bot : public rclcpp::Node {",
    "};",
    "void f() override;",
    "#if A",
    "#endif",
    "M(x)",
]


@given(st.lists(st.sampled_from(_PARTS), max_size=12))
@settings(max_examples=100, deadline=None)
def test_broken_classes_give_an_outline(parts: list[str]) -> None:
    found = read("\n".join(parts))
    assert {one.name.rpartition("::")[2] for one in found.classes} <= {"Bot"}


def handed_in(
    root: Path, files: dict[str, Any], sandbox: Sandbox | None = None
) -> dict[str, SourceFile]:
    for path, data in files.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_bytes(data if isinstance(data, bytes) else data.encode())
    with opened(root) as located:
        return read_cpp(located, find_ros(), sandbox)


PACKAGE = {"bot/package.xml": "<package/>", "bot/src/bot.cpp": "class Bot {};"}


@pytest.mark.parametrize("isolated", [True, False], ids=["sandbox", "none"])
def test_files_of_a_submission_are_read_in_a_process_of_their_own(
    tmp_path: Path, cache: Path, isolated: bool
) -> None:
    files = {**PACKAGE, "bot/a b.hpp": "struct ä {};", "bot/latin.hpp": b"// \xe4\nclass L {};"}
    found = handed_in(tmp_path / "in", files, Sandbox(cache) if isolated else None)
    assert {path: one.classes for path, one in found.items()} == {
        "bot/src/bot.cpp": (SourceClass("Bot", 1, end=1),),
        "bot/a b.hpp": (SourceClass("ä", 1, end=1),),
        "bot/latin.hpp": (SourceClass("L", 2, end=2),),
    }
    assert all(one.language == CPP and one.unread is None for one in found.values())


def test_a_file_that_is_too_large_or_takes_too_long_is_not_read_and_the_others_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cpp, "_FILE_S", 1)
    files = {
        **PACKAGE,
        "bot/deep.hpp": "int x = " + "(" * 200_000,
        "bot/large.hpp": "// large\n" * 1_200_000,
    }
    found = handed_in(tmp_path / "in", files)
    assert found["bot/src/bot.cpp"].classes
    deep, large = found["bot/deep.hpp"].unread, found["bot/large.hpp"].unread
    assert deep is not None and "too long" in deep.message
    assert large is not None and str(large) == "bot/large.hpp: larger than 512 KiB; not read as C++"


def test_a_submission_in_python_starts_no_process(tmp_path: Path) -> None:
    assert handed_in(tmp_path / "in", {"bot/package.xml": "<package/>"}) == {}
