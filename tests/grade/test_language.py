"""Students of C++ read no words of Python, and students of Python read what they always read."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from grader import resources
from grader.assignment.load import list_assignments, load_assignment
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import NoParameters, Subject
from grader.diagnosis.explanation import explanations
from grader.findings.finding import Status
from grader.findings.words import speaking
from grader.grade import grade
from grader.grade.language import in_cpp
from grader.submission.record import CPP, PYTHON, PackageRecord, SourceFile
from tests.checks.builder import package, submission
from tests.grade.sample import FAIL, Told, make_loaded, make_recording, make_submission

_OF_PYTHON = re.compile(
    r"rclpy|\bself\b|setup\.(py|cfg)|\bresource/|console_scripts|Python|\.py\b|\bimport(s|ed)?\b"
    r"|__init__|super\(\)|\bNone\b|KeyboardInterrupt|traceback|\bexcept\b|print\(|\binput\(\)"
    r"|time\.sleep|while True|\bmath\.|numpy|get_logger\(\)\.|async def|await|\bos\._|sys\.exit"
    r"|\w_async\(|=(True|False)\b|\w+_sec=|(seconds|depth|once|group|threads)=|\w=\w+Policy"
    r"|QoSProfile|TransitionCallbackReturn|spin_once|\w+CallbackGroup\b|daemon|entry point"
    r"|\bmodules?\b|lambda|\bf'|create_timer|goal_handle\.|(goal|execute|cancel)_callback"
)
# They look themselves at which language it is: what they say of Python is said of Python only.
_READS_PYTHON = {
    *("newer_name", "why_too_new", "why_nothing_to_run"),
    *("_why_unknown_imports", "tests"),
}
SOURCE = SourceFile("src/look/bin/look", "look")
_FOLDERS = ("checks", "diagnosis", "findings", "measure", "grade")


def _declared() -> set[tuple[str, str]]:
    """Functions of checks and explanations that are declared to be of Python."""
    entries = [one for found in explanations().values() for one in found if one.only == PYTHON]
    return {(one.module, one.name) for one in entries} | {
        (check.judge.__module__, check.judge.__name__)
        for check in CATALOGUE.values()
        if check.parameters.only == PYTHON
    }


def _names(statement: ast.stmt) -> list[str]:
    if isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
        return [statement.name]
    targets = statement.targets if isinstance(statement, ast.Assign) else []
    return [target.id for target in targets if isinstance(target, ast.Name)]


def _spoken(tree: ast.Module, of_python: set[str]) -> Iterator[ast.stmt]:
    """Statements at the top that not only functions of Python use."""
    uses = {
        name: {node.id for node in ast.walk(one) if isinstance(node, ast.Name)}
        for one in tree.body
        for name in _names(one)
    }
    known = of_python & uses.keys() | (_READS_PYTHON & uses.keys())
    while True:
        users = {name: {one for one in uses if name in uses[one] and one != name} for name in uses}
        more = {name for name, by in users.items() if by and by <= known} - known
        if not more:
            break
        known |= more
    return (one for one in tree.body if not set(_names(one)) & known)


def _texts(statement: ast.stmt) -> Iterator[str]:
    """What a statement may say to students: no documentation, no pattern."""
    hidden: set[int] = set()
    for node in ast.walk(statement):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            hidden.add(id(node.value))
        if isinstance(node, ast.JoinedStr):
            hidden |= {id(part) for part in node.values}
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("Field", "re.compile"):
            hidden |= {id(part) for part in ast.walk(node)}
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("Words", "worded"):
            of_python = [*node.args, *(one.value for one in node.keywords)][0]
            hidden |= {id(part) for part in ast.walk(of_python)}
    for node in ast.walk(statement):
        if id(node) in hidden:
            continue
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        text = "".join(
            str(part.value) if isinstance(part, ast.Constant) else "info" for part in parts
        )
        if isinstance(node, (ast.JoinedStr, ast.Constant)) and " " in text:
            yield re.sub(r"(?<!\$)\{[^{}]*\}", "info", text)


def _all_texts() -> Iterator[tuple[str, str]]:
    root, declared = resources.root(), _declared()
    folders = [root / "grader" / name for name in _FOLDERS]
    for folder in (*folders, *resources.assignments().glob("*/checks")):
        for file in sorted(folder.rglob("*.py")):
            module = ".".join(file.relative_to(root).with_suffix("").parts)
            own = {name for where, name in declared if where == module}
            for statement in _spoken(ast.parse(file.read_text(encoding="utf-8")), own):
                yield from ((f"{file}:{statement.lineno}", text) for text in _texts(statement))


def test_no_word_of_python_is_left_for_students_of_cpp() -> None:
    texts = list(_all_texts())
    assert len(texts) > 500
    left = [
        f"{where}: {found[0]!r} in {in_cpp(text)!r}"
        for where, text in texts
        if (found := _OF_PYTHON.search(in_cpp(text)))
    ]
    assert not left, "\n".join(left)


def test_hints_of_the_lessons_have_no_word_of_python_for_students_of_cpp() -> None:
    with speaking(CPP):
        left = [
            f"{name}: {bound.spec.id}: {found[0]!r}"
            for name in list_assignments()
            for bound in load_assignment(name).checks
            for hint in bound.spec.hints
            if (found := _OF_PYTHON.search(str(hint)))
        ]
    assert not left, "\n".join(left)


@pytest.mark.parametrize(
    ("python", "cpp"),
    [
        (
            "Create a timer with self.create_timer(0.3, self.timer_callback), and publish in it.",
            "Create a timer with timer_ = this->create_wall_timer(0.3s, callback), and publish in "
            "it.",
        ),
        (
            "The line in setup.py is 'bot_pub = bot_publisher.bot_publisher:main': the name of the "
            "executable, the module in your package, the function in the module.",
            "CMakeLists.txt needs add_executable(bot_pub src/your_file.cpp), "
            "ament_target_dependencies(bot_pub rclcpp ...) and install(TARGETS bot_pub DESTINATION "
            "lib/${PROJECT_NAME}).",
        ),
        (
            "Give create_publisher a profile: QoSProfile(depth=10, "
            "reliability=ReliabilityPolicy.BEST_EFFORT, lifespan=Duration(seconds=1)), from "
            "rclpy.qos.",
            "Give create_publisher a profile: rclcpp::QoS(10) with best_effort(), lifespan(1s).",
        ),
        ("Call self.get_logger().warning('...').", 'Call RCLCPP_WARN(get_logger(), "...").'),
        (
            "Look for time.sleep() or input() in a callback; time.sleep(0.4) waits.",
            "Look for std::this_thread::sleep_for() or std::cin in a callback; "
            "std::this_thread::sleep_for(0.4s) waits.",
        ),
        ("It is important: rclpy.spin(node)", "It is important: rclcpp::spin(node)"),
        ("`src/bot.cpp:12` imported", "`src/bot.cpp:12` included"),
    ],
)
def test_terms_of_python_have_their_counterparts(python: str, cpp: str) -> None:
    assert in_cpp(python) == cpp
    assert in_cpp(cpp) == cpp


def test_a_package_speaks_the_language_of_its_programs() -> None:
    compiled = package("drive", build_type="ament_cmake", path="src/drive", imports=())
    scripts = package("look", build_type="ament_cmake", path="src/look", sources=(SOURCE,))
    messages = package("msgs", build_type="ament_cmake", path="src/msgs", imports=())
    python = package("plan", path="src/plan")
    record = submission(
        compiled, scripts, messages, python, files=("src/drive/src/drive.cpp", "src/look/bin/look")
    )
    spoken = {one.name: record.language(one) for one in record.packages}
    assert spoken == {"drive": CPP, "look": PYTHON, "msgs": "", "plan": PYTHON}
    assert record.spoken(["drive", "msgs"]) == CPP
    assert record.spoken(["drive", "plan"]) == PYTHON
    # Interfaces have no language of their own: what is said of them is in that of the programs.
    assert record.spoken(["msgs"]) == PYTHON
    assert submission(compiled, messages, files=record.files).spoken(["msgs"]) == CPP


def test_findings_and_hints_of_the_author_are_in_the_language_of_the_package() -> None:
    compiled = PackageRecord("bot_publisher", "src/bot_publisher", "ament_cmake")
    files = ("src/bot_publisher/src/bot.cpp",)
    handed_in = make_submission(packages=(compiled,), files=files)
    words = {"python": "Call rclpy.init() first.", "cpp": "Call rclcpp::init(argc, argv) first."}
    loaded = make_loaded([Told("node", FAIL, hint=[words, "It imports rclpy."])])
    for record, expected in (
        (handed_in, ("Call rclcpp::spin(node).", words["cpp"], "It imports rclpy.")),
        (make_submission(), ("Call rclpy.spin(node).", words["python"], "It imports rclpy.")),
    ):
        run = {"listen": make_recording(submission=record)}
        result = grade(loaded, record, run).result("node")
        assert (result.decisive.finding.hint, *result.hints) == expected


def test_a_check_that_reads_python_takes_no_points_from_students_of_cpp() -> None:
    class OfPython(NoParameters):
        only = PYTHON

    compiled = PackageRecord("bot_publisher", "src/bot_publisher", "ament_cmake")
    record = make_submission(packages=(compiled,), files=("src/bot_publisher/src/bot.cpp",))
    check = Told("classes", FAIL, Subject.SUBMISSION, parameters=OfPython())
    result = grade(make_loaded([check]), record, {}).result("classes")
    assert result.status is Status.ERROR
    assert "reads Python" in result.decisive.finding.observed
    assert not check.asked
