"""Students of C++ read no words of Python, and students of Python read what they always read."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.assignment.load import list_assignments, load_assignment
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import NoParameters, Subject
from grader.diagnosis.explanation import explanations, hints, mistakes, remedy
from grader.diagnosis.process import exception_table
from grader.findings.finding import Finding, Status
from grader.findings.words import SPIN_NODE, Words, speaking
from grader.grade import judge_all
from grader.grade.model import CheckResult
from grader.machine import resources
from grader.recording.submission import CPP, PYTHON, PackageRecord, SourceFile
from tests.checks.builder import endpoint, judge, output, package, recording, submission
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
    *("why_unknown_imports", "tests"),
    *("why_unreadable", "_documentable_python", "_CONSTRUCTS"),
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
        if isinstance(node, ast.Call) and ast.unparse(node.func) in (
            "Words",
            "worded",
            "EntityKind",
        ):
            named = [one.value for one in node.keywords if one.arg == "python"]
            hidden |= {id(part) for part in ast.walk([*named, *node.args][0])}
    for node in ast.walk(statement):
        if id(node) in hidden:
            continue
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        text = "".join(
            str(part.value) if isinstance(part, ast.Constant) else "info" for part in parts
        )
        if isinstance(node, (ast.JoinedStr, ast.Constant)) and " " in text:
            yield re.sub(r"(?<!\$)\{[^{}]*\}", "info", text)


def _statements() -> Iterator[tuple[str, ast.stmt]]:
    """Where each statement is that students of any language may get to read of."""
    root, declared = resources.root(), _declared()
    folders = [root / "grader" / name for name in _FOLDERS]
    for folder in (*folders, *resources.assignments().glob("*/checks")):
        for file in sorted(folder.rglob("*.py")):
            module = ".".join(file.relative_to(root).with_suffix("").parts)
            own = {name for where, name in declared if where == module}
            for statement in _spoken(ast.parse(file.read_text(encoding="utf-8")), own):
                yield f"{file}:{statement.lineno}", statement


def _all_texts() -> Iterator[tuple[str, str]]:
    for where, statement in _statements():
        yield from ((where, text) for text in _texts(statement))


def test_no_word_of_python_is_left_for_students_of_cpp() -> None:
    texts = list(_all_texts())
    assert len(texts) > 500
    left = [
        f"{where}: {found[0]!r} in {text!r}"
        for where, text in texts
        if (found := _OF_PYTHON.search(text))
    ]
    assert not left, "\n".join(left)


def test_hints_have_no_word_of_python_for_students_of_cpp() -> None:
    constants = {
        str(node.value)
        for _, statement in _statements()
        for node in ast.walk(statement)
        if isinstance(node, ast.Constant)
    }
    of_python = {
        name for about in mistakes().values() for name, one in about.items() if one.only == PYTHON
    }
    with speaking(CPP):
        left = [
            f"{name}: {found[0]!r}"
            for name in constants & hints().keys() - of_python
            if (found := _OF_PYTHON.search(remedy(name)))
        ]
    assert len(constants & hints().keys()) > 200
    assert not left, "\n".join(left)


def test_exceptions_of_both_languages_have_no_word_of_python_for_students_of_cpp() -> None:
    hints = [row.hint for row in exception_table.TABLE.exceptions if isinstance(row.hint, Words)]
    with speaking(CPP):
        assert hints and not list(filter(_OF_PYTHON.search, map(str, hints)))


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


_TEXT = st.one_of(
    st.text(min_size=1, max_size=40),
    st.sampled_from(
        [
            *(
                "/import",
                "imported goods",
                "rclpy.spin(node)",
                "from x.msg import Y",
                "time.sleep(1)",
            ),
            *("self.create_timer(0.5, self.callback)", "QoSProfile", "${PROJECT_NAME}", "{value}"),
        ]
    ),
)
_NAME = st.sampled_from(["/import", "/imported", "/input", "/attribute", "/math", "/self"])


def _grade_in(language: str, hint: str, says: Finding) -> CheckResult:
    packages = {
        PYTHON: make_submission(),
        CPP: make_submission(
            packages=(PackageRecord("bot_publisher", "src/bot_publisher", "ament_cmake"),),
            files=("src/bot_publisher/src/bot.cpp",),
        ),
    }
    record = packages[language]
    loaded = make_loaded([Told("node", says, hint=hint)])
    return judge_all(loaded, record, {"listen": make_recording(submission=record)}).result("node")


@given(written=_TEXT, printed=_TEXT)
def test_texts_of_authors_and_students_are_the_same_in_both_languages(
    written: str, printed: str
) -> None:
    for language in (PYTHON, CPP):
        says = Finding.failed(f"expected {printed}", f"printed {printed}", f"Look at {printed}.")
        result = _grade_in(language, written, says)
        assert result.hints == (written,)
        assert result.decisive.finding == says


@given(topic=_NAME, line=_TEXT)
def test_names_and_printed_lines_stand_in_a_finding_as_they_are(topic: str, line: str) -> None:
    run = recording(
        messages={},
        endpoints=(endpoint(topic),),
        log=tuple(output(line.replace("\n", " ").replace("\r", " "), time_s=1.0)),
    )
    for check, parameters in (
        ("messages.count", {"topic": topic, "at_least": 1}),
        ("log.contains", {"text": "never said"}),
    ):
        told = {}
        for language in (PYTHON, CPP):
            with speaking(language):
                told[language] = judge(check, run, **parameters)
        assert told[PYTHON].expected == told[CPP].expected
        assert told[PYTHON].evidence.log == told[CPP].evidence.log
        if check == "messages.count":
            assert f"`{topic}`" in told[CPP].observed


@pytest.mark.parametrize(
    ("check", "parameters", "hint"),
    [
        (
            "service.exists",
            {"service": "/speed", "type": "std_srvs/srv/SetBool"},
            'this->create_service<std_srvs::srv::SetBool>("speed", callback)',
        ),
        (
            "qos.offered",
            {"topic": "/cmd_vel", "durability": "transient_local", "deadline": "300 ms"},
            "rclcpp::QoS(10).transient_local().deadline(0.3s).",
        ),
    ],
)
def test_a_hint_in_cpp_is_code_that_compiles(
    check: str, parameters: dict[str, Any], hint: str
) -> None:
    run = recording(endpoints=(endpoint("/cmd_vel"),))
    with speaking(CPP):
        assert hint in judge(check, run, **parameters).hint


def test_no_sentence_is_said_while_a_module_is_imported() -> None:
    """It would be that of Python for ever."""
    modules = [f"grader.{name}" for name in _FOLDERS]
    lessons = [str(file) for file in resources.assignments().glob("*/checks")]
    program = f"""
import pkgutil, importlib
from pathlib import Path
from grader.findings.words import Words
def refuse(words):
    raise AssertionError(words.python)
Words.__str__ = refuse
for name in {modules}:
    found = importlib.import_module(name)
    for one in pkgutil.walk_packages(found.__path__, name + "."):
        importlib.import_module(one.name)
from grader.assignment.lesson_checks import lesson_checks
for folder in {lessons}:
    lesson_checks(Path(folder).parent)
"""
    subprocess.run([sys.executable, "-c", program], check=True, cwd=resources.root())


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
    check = Told(
        "node", lambda: replace(FAIL, hint=f"Call {SPIN_NODE}."), hint=[words, "It imports rclpy."]
    )
    loaded = make_loaded([check])
    for record, expected in (
        (handed_in, ("Call rclcpp::spin(node).", words["cpp"], "It imports rclpy.")),
        (make_submission(), ("Call rclpy.spin(node).", words["python"], "It imports rclpy.")),
    ):
        run = {"listen": make_recording(submission=record)}
        result = judge_all(loaded, record, run).result("node")
        assert (result.decisive.finding.hint, *result.hints) == expected


def test_a_check_that_reads_python_takes_no_points_from_students_of_cpp() -> None:
    class OfPython(NoParameters):
        only = PYTHON

    compiled = PackageRecord("bot_publisher", "src/bot_publisher", "ament_cmake")
    record = make_submission(packages=(compiled,), files=("src/bot_publisher/src/bot.cpp",))
    check = Told("classes", FAIL, Subject.SUBMISSION, parameters=OfPython())
    result = judge_all(make_loaded([check]), record, {}).result("classes")
    assert result.status is Status.ERROR
    assert "reads Python" in result.decisive.finding.observed
    assert not check.asked
