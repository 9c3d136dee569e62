"""rosgrade as it is where only a wheel or an export of it was installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_PROGRAM = f"""\
import sys
sys.path[:] = [sys.argv.pop(1), *(path for path in sys.path if path != {str(ROOT)!r})]
from grader.__main__ import main
main()
"""


def alone(site: Path, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A command of the rosgrade in a folder, which finds nothing of this checkout."""
    return subprocess.run(
        [sys.executable, "-I", "-c", _PROGRAM, str(site), *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )
