"""source.*: judged by what the files say, in any style."""

import ast

import pytest

from grader.findings.finding import Status
from grader.recording.submission import Lint, LintFinding, SourceError
from grader.submission.read.outline import outline
from tests.checks.builder import failing, judge, package, submission

PACKAGE = {"package": "bot_publisher"}
FOLDER = "src/bot_publisher/bot_publisher"


def files(**sources):
    """A submission with these modules; ``init`` is __init__.py."""
    found = []
    for name, text in sources.items():
        base = "__init__" if name == "init" else name
        module = "bot_publisher" if name == "init" else f"bot_publisher.{name}"
        found.append(outline(ast.parse(text), f"{FOLDER}/{base}.py", module))
    return submission(package(sources=tuple(found)))


def linted(*codes):
    findings = tuple(LintFinding(code, f"{FOLDER}/node.py", 3, "is wrong") for code in codes)
    source = files(node="x = 1").packages[0].sources
    return submission(package(sources=source, lint=Lint(None, findings)))


class TestClass:
    @pytest.mark.parametrize(
        "text",
        [
            "from rclpy.node import Node\nclass Bot(Node): pass",
            "from rclpy.node import Node as Parent\nclass Bot(Parent): pass",
            "import rclpy.node\nclass Bot(rclpy.node.Node): pass",
            "import rclpy.node as n\nclass Bot(n.Node): pass",
            "from rclpy import node\nclass Bot(node.Node): pass",
            "from rclpy.node import *\nclass Bot(Node): pass",
            "from rclpy.node import Node\nParent = Node\nclass Bot(Parent): pass",
            "import rclpy.node as n\nN = n.Node\nM = N\nclass Bot(object, M): pass",
            "from rclpy.lifecycle import LifecycleNode\nclass Bot(LifecycleNode): pass",
            "from rclpy.node import Node\nclass Base(Node): pass\nclass Bot(Base): pass",
            "from rclpy.node import Node\ndef make():\n    class Bot(Node): pass\n    return Bot",
            "from rclpy.node import Node\nclass Bot(mixed(Node)): pass",
            "import typing\nfrom rclpy.node import Node\nclass Bot(Node, typing.Generic[T]): 1",
            "try:\n    from rclpy.node import Node\nfinally:\n    pass\nclass Bot(Node): 1",
        ],
    )
    def test_every_style_is_right(self, text):
        finding = judge("source.class", files(node=text), **PACKAGE, name="Bot")
        assert finding.status is Status.PASSED

    def test_a_base_class_in_another_file(self):
        base = "from rclpy.node import Node\nclass Base(Node): pass"
        for imported in (
            "from .base import Base",
            "from bot_publisher.base import Base",
            "from . import base\nBase = base.Base",
            "from .base import *",
        ):
            run = files(base=base, node=f"{imported}\nclass Bot(Base): pass")
            assert judge("source.class", run, **PACKAGE, name="Bot").status is Status.PASSED

    def test_a_base_class_that_the_package_itself_hands_on(self):
        run = files(
            init="from .base import Base",
            base="from rclpy.node import Node\nclass Base(Node): pass",
            node="from bot_publisher import Base\nclass Bot(Base): pass",
        )
        assert judge("source.class", run, **PACKAGE, name="Bot").status is Status.PASSED

    def test_a_base_class_in_another_package_of_the_submission(self):
        text = "from rclpy.node import Node\nclass Base(Node): pass"
        other = outline(ast.parse(text), "src/common/common/base.py", "common.base")
        mine = files(node="from common.base import Base\nclass Bot(Base): pass").packages[0]
        run = submission(mine, package("common", sources=(other,)))
        assert judge("source.class", run, **PACKAGE, name="Bot").status is Status.PASSED

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            (
                "class Bot: pass",
                "`Bot` inherits nothing (src/bot_publisher/bot_publisher/node.py:1",
            ),
            ("import threading\nclass Bot(threading.Thread): 1", "inherits `threading.Thread`"),
            ("class Node: pass\nclass Bot(Node): pass", "`Bot` inherits `Node`"),
            ("class Bot(Bot): pass", "`Bot` inherits `Bot`"),
            ("class A(B): 1\nclass B(A): 1\nclass Bot(A): 1", "`Bot` inherits `A`"),
            ("from rclpy.executors import Executor\nclass Bot(Executor): 1", "`Executor`"),
        ],
    )
    def test_what_is_no_node(self, text, words):
        assert words in failing("source.class", files(node=text), **PACKAGE, name="Bot")

    def test_a_misspelt_class_and_none_at_all(self):
        text = "from rclpy.node import Node\nclass BotPublsher(Node): pass"
        found = failing("source.class", files(node=text), **PACKAGE, name="BotPublisher")
        assert "found the class `BotPublsher`" in found
        assert "no class is defined" in failing("source.class", files(node="x = 1"), **PACKAGE)

    def test_a_base_class_that_was_not_handed_in_is_left_to_people(self):
        text = "from nav2_simple_commander import Nav\nclass Bot(Nav): pass"
        finding = judge("source.class", files(node=text), **PACKAGE)
        assert finding.status is Status.ERROR
        assert "which was not handed in" in finding.observed

    def test_a_file_that_python_cannot_read(self):
        broken = SourceError(f"{FOLDER}/node.py", 4, "SyntaxError: invalid syntax")
        run = submission(package(syntax_errors=(broken,)))
        assert f"{FOLDER}/node.py:4: SyntaxError" in failing("source.class", run, **PACKAGE)

    def test_a_package_without_code(self):
        assert "has no code" in failing("source.class", submission(), **PACKAGE)


class TestDocstrings:
    def test_what_needs_no_docstring_costs_nothing(self):
        text = (
            'import x\nclass A:\n    """A."""\n    def __init__(self): pass\n'
            "    def _private(self): pass\n    @x.setter\n    def x(self, v): pass\n"
            '    def go(self):\n        """Go."""\n        def inner(): pass\n'
        )
        finding = judge("source.docstrings", files(node=text), **PACKAGE)
        assert finding.status is Status.PASSED

    def test_each_lack_is_reported_with_its_line(self):
        text = "class A:\n    # A comment.\n    def go(self):\n        return 1\n"
        finding = judge("source.docstrings", files(node=text), **PACKAGE)
        assert [str(place) for place in finding.evidence.places] == [
            f"{FOLDER}/node.py:1: the class A",
            f"{FOLDER}/node.py:3: A.go()",
        ]

    def test_a_share_is_enough_where_the_yaml_says_so(self):
        run = files(node='def a():\n    """A."""\n\ndef b(): pass\n')
        assert "1 of 2 have a docstring" in failing("source.docstrings", run, **PACKAGE)
        finding = judge("source.docstrings", run, **PACKAGE, share="50 %")
        assert finding.status is Status.PASSED

    def test_modules_if_asked_for(self):
        run = files(init="", node='def a():\n    """A."""\n')
        found = failing("source.docstrings", run, **PACKAGE, of=["module"])
        assert f"the first without is {FOLDER}/node.py:1: the module" in found


class TestTypeHints:
    def test_complete_type_hints_pass(self):
        text = (
            "class A:\n    def __init__(self, x: int): pass\n"
            "    @staticmethod\n    def s(x: int) -> None: pass\n"
            "    @classmethod\n    def c(cls, *a: int, k: int = 1, **kw: int) -> None: pass\n"
            "def f(a: int, /, b: 'int') -> None: pass\n"
        )
        finding = judge("source.type_hints", files(node=text), **PACKAGE)
        assert finding.status is Status.PASSED

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("def f(a, b: int) -> None: pass", "f(): no hint for `a`"),
            ("def f(a: int): pass", "f(): no hint for what it returns"),
            ("class A:\n    def m(self, msg): pass", "`msg` and what it returns"),
            ("class A:\n    @staticmethod\n    def m(x) -> None: pass", "no hint for `x`"),
            ("def f(*args, **kw) -> None: pass", "no hint for `args` and `kw`"),
            ("async def f(a) -> None: pass", "no hint for `a`"),
        ],
    )
    def test_missing_type_hints_are_named(self, text, words):
        assert words in failing("source.type_hints", files(node=text), **PACKAGE)

    def test_parameters_alone_may_be_asked_for(self):
        run = files(node="def f(a: int): pass")
        finding = judge("source.type_hints", run, **PACKAGE, returns=False)
        assert finding.status is Status.PASSED


class TestNoPrint:
    @pytest.mark.parametrize(
        "text",
        [
            "x.print()",
            "def print(*a): pass\nprint(1)",
            "print = log.info\nprint(1)",
            "with open('a') as f: print(1, file=f)",
            "# print(1)\n'print(1)'",
        ],
    )
    def test_what_is_no_print_costs_nothing(self, text):
        assert judge("source.no_print", files(node=text), **PACKAGE).status is Status.PASSED

    @pytest.mark.parametrize(
        "text",
        [
            "\nprint(1)",
            "\nprint(1, file=sys.stderr)",
            "\nlist(map(print, [1]))",
            "\nshow = print",
            "from rich import print\nprint(1)",
        ],
    )
    def test_a_print_is_found_at_its_line(self, text):
        found = failing("source.no_print", files(node=text), **PACKAGE)
        assert f"1 place with print(), the first at {FOLDER}/node.py:2" in found


class TestRuff:
    def test_groups_and_single_rules(self):
        run = linted("F401", "E501", "ERA001", "PLR2004")
        for rules, number in ((["F"], 1), (["E"], 1), (["ERA"], 1), (["PL"], 1), (["E", "F4"], 2)):
            found = failing("source.ruff", run, **PACKAGE, rules=rules)
            assert found.startswith(f"{number} place")
        assert judge("source.ruff", run, **PACKAGE, rules=["W"]).status is Status.PASSED
        finding = judge("source.ruff", run, **PACKAGE, rules=["E"], **{"except": ["E501"]})
        assert finding.status is Status.PASSED

    def test_the_place_and_the_words_of_ruff(self):
        found = failing("source.ruff", linted("F401"), **PACKAGE, rules=["F"])
        assert f"the first at {FOLDER}/node.py:3: F401 is wrong" in found
        assert "`ruff check --select F` shows them all" in found

    def test_some_may_be_there(self):
        finding = judge("source.ruff", linted("F401"), **PACKAGE, rules=["F"], at_most=1)
        assert finding.status is Status.PASSED

    def test_without_ruff_it_is_our_error(self):
        run = linted()
        bare = package(sources=run.packages[0].sources, lint=Lint("ruff is not installed"))
        finding = judge("source.ruff", submission(bare), **PACKAGE, rules=["F"])
        assert finding.status is Status.ERROR
        assert "ruff is not installed" in finding.observed

    @pytest.mark.parametrize(
        ("rule", "words"), [("f401", "is not a rule of ruff"), ("D203", "write D211")]
    )
    def test_rules_that_cannot_be_are_refused(self, rule, words):
        with pytest.raises(ValueError, match=words):
            judge("source.ruff", linted(), **PACKAGE, rules=[rule])
