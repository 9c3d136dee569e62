"""rosgrade assumes no processor: not in its sources, and not in the filter of system calls."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from grader.sandbox import seccomp

ROOT = Path(__file__).resolve().parents[1]
PROCESSOR = re.compile(r"x86|amd64|i[36]86|aarch64|arm64|-m(arch|cpu|tune)=", re.IGNORECASE)
WHEELS = 'WHEELS_PLATFORM = "linux-x86_64"'
"""Where the index has wheels of ROS; on other machines a sourced ROS is used."""


def test_no_source_names_a_processor_but_to_say_where_wheels_are() -> None:
    files = [
        file
        for folder in ("grader", "sim", "templates", "assignments", "reference")
        for file in (ROOT / folder).rglob("*")
        if file.is_file() and file.suffix not in (".gz", ".pyc", ".png")
    ]
    named = [
        f"{file.relative_to(ROOT)}: {line}"
        for file in files
        for line in file.read_text(encoding="utf-8").splitlines()
        if PROCESSOR.search(line) and "base64" not in line
    ]
    assert named == [f"grader/machine/bootstrap.py: {WHEELS}"]


@pytest.mark.parametrize("options", [{}, {"one_session": True}, {"guarded": True}])
def test_the_filter_of_system_calls_can_be_made_for_arm(
    options: dict[str, bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyseccomp

    class OfArm(pyseccomp.SyscallFilter):  # type: ignore[misc]
        def __init__(self, action: int) -> None:
            super().__init__(action)
            if not self.exist_arch(pyseccomp.Arch.AARCH64):
                self.add_arch(pyseccomp.Arch.AARCH64)
                self.remove_arch(pyseccomp.system_arch())

    here = seccomp.student_filter.__wrapped__(**options)
    monkeypatch.setattr(pyseccomp, "SyscallFilter", OfArm)
    there = seccomp.student_filter.__wrapped__(**options)
    # AUDIT_ARCH_AARCH64, which the program compares the architecture with.
    assert (0xC000_00B7).to_bytes(4, "little") in there
    assert len(there) > len(here) / 2
    assert (0xC000_00B7).to_bytes(4, "little") in seccomp.guard_filter.__wrapped__()
