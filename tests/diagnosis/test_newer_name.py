"""Right code is not called wrong where the Python or numpy here is not Jazzy's."""

from __future__ import annotations

import pytest

from grader.findings.finding import Finding, Status
from grader.recording.model import Ending
from tests.checks.builder import SOURCE, died, judge, nodeless, output, text, traceback


def ended_by(raised: str, python: str = "3.10.12") -> Finding:
    run = nodeless(
        processes=(died(1),),
        ending=Ending.EXITED,
        log=output(traceback(raised)),
        environment={"python": python},
    )
    return judge("node.starts", run)


@pytest.mark.parametrize(
    ("raised", "name"),
    [
        (
            "ImportError: cannot import name 'StrEnum' from 'enum' (/usr/lib/python3.10/enum.py)",
            "enum.StrEnum",
        ),
        ("ImportError: cannot import name 'UTC' from 'datetime' (x)", "datetime.UTC"),
        ("AttributeError: module 'itertools' has no attribute 'batched'", "itertools.batched"),
        (
            "AttributeError: module 'math' has no attribute 'cbrt'. Did you mean: 'sqrt'?",
            "math.cbrt",
        ),
        ("AttributeError: 'PosixPath' object has no attribute 'walk'", "pathlib.Path.walk"),
        ("ModuleNotFoundError: No module named 'tomllib'", "tomllib"),
    ],
)
def test_a_name_that_jazzy_s_python_has_costs_no_point(raised: str, name: str) -> None:
    finding = ended_by(raised)
    assert finding.status is Status.ERROR
    assert f"uses `{name}`" in text(finding)
    assert f"{SOURCE}:14" in text(finding)
    assert "it needs Python 3.12" in text(finding)


@pytest.mark.parametrize("python", ["3.10.12", "3.13.1"])
@pytest.mark.parametrize(
    ("raised", "name"),
    [
        (
            "AttributeError: `np.Inf` was removed in the NumPy 2.0 release. Use `np.inf` instead.",
            "numpy.Inf",
        ),
        ("AttributeError: module 'numpy' has no attribute 'product'", "numpy.product"),
        ("ImportError: cannot import name 'NAN' from 'numpy' (x)", "numpy.NAN"),
    ],
)
def test_a_name_that_ubuntu_s_numpy_has_costs_no_point(raised: str, name: str, python: str) -> None:
    finding = ended_by(raised, python)
    assert finding.status is Status.ERROR
    assert f"uses `{name}`" in text(finding)
    assert "it needs numpy 1.26 (for Python 3.12 and older)" in text(finding)


@pytest.mark.parametrize(
    ("raised", "python"),
    [
        # The student's own module of that name hides Python's.
        ("ImportError: cannot import name 'StrEnum' from 'enum' (/ws/enum.py)", "3.12.3"),
        ("ImportError: cannot import name 'StringEnum' from 'enum' (x)", "3.10.12"),
        ("ImportError: cannot import name 'Twists' from 'geometry_msgs.msg' (x)", "3.10.12"),
        ("AttributeError: module 'math' has no attribute 'squareroot'", "3.10.12"),
        ("AttributeError: module 'numpy' has no attribute 'prodct'", "3.10.12"),
        ("AttributeError: 'Robot' object has no attribute 'walk'", "3.10.12"),
        ("ModuleNotFoundError: No module named 'tomlib'", "3.10.12"),
        ("ValueError: `np.Inf` was removed in the NumPy 2.0 release.", "3.10.12"),
        ("AttributeError: module 'itertools' has no attribute 'batched'", ""),
    ],
)
def test_a_name_that_jazzy_lacks_as_well_is_a_mistake(raised: str, python: str) -> None:
    assert ended_by(raised, python).status is Status.FAILED
