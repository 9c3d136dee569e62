"""What every test directory shares."""

from __future__ import annotations

import gc
import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

from grader.errors import GraderFault
from grader.submission.build.toolchain import check_toolchain, has_headers, headers_package

# How long an example takes says something about the machine, not about the code.
# The same examples in every run: a test that fails now and then says nothing of a change. To look
# for new ones: pytest --hypothesis-profile=explore.
settings.register_profile("no_deadline", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None)
settings.load_profile("no_deadline")


def pytest_configure() -> None:
    """Let Ctrl-C reach what the tests start, also where they run as a job in the background.

    A shell starts such jobs with it ignored, and every process that they start inherits that.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # To look for garbage among thousands of tests after each 700 objects takes a sixth of the time.
    gc.set_threshold(50_000)


def pytest_collection_finish() -> None:
    """Look for no garbage among what stays until the end."""
    gc.freeze()


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache folder of rosgrade's: the Python of the sandbox in it is made once."""
    return tmp_path_factory.mktemp("cache")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put long files first; skip what compiles where nothing can, and say why."""
    # Short ones at the end keep every worker busy until then.
    long = {item.path for item in items if any(map(item.get_closest_marker, ("ros", "slow")))}
    items.sort(key=lambda item: item.path not in long)
    try:
        check_toolchain(os.environ["PATH"])
        if not has_headers():
            raise GraderFault(f"no headers of Python here: sudo apt install {headers_package()}")
    except GraderFault as fault:
        for item in items:
            if item.get_closest_marker("compiles"):
                item.add_marker(pytest.mark.skip(reason=str(fault)))
