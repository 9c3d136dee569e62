"""Whether there can be a sandbox on this machine, and what to do where there cannot."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from grader.errors import GraderFault
from grader.sandbox import bubblewrap
from grader.sandbox.choice import Choice
from grader.sandbox.sandbox import Sandbox

_UID = 2000
_LIMIT_S = 20.0
_APPARMOR = """\
sudo tee /etc/apparmor.d/bwrap <<'EOF'
abi <abi/4.0>,
include <tunables/global>
profile bwrap /usr/bin/bwrap flags=(unconfined) {
  userns,
}
EOF
sudo apparmor_parser -r /etc/apparmor.d/bwrap"""


@dataclass(frozen=True)
class Trial:
    """Whether a sandbox can be made here: the problem and its remedy, or nothing."""

    problem: str = ""
    remedy: str = ""


def choose(choice: Choice, cache: Path) -> tuple[Sandbox | None, str]:
    """The sandbox to use or None, and a line for the user where there is something to say."""
    if choice is Choice.NONE:
        return None, ""
    trial = try_sandbox()
    if not trial.problem:
        return Sandbox(cache), ""
    if choice is Choice.BWRAP:
        raise GraderFault(f"no sandbox: {trial.problem}; {trial.remedy}")
    return None, (
        f"no sandbox ({trial.problem}): the submission runs with your rights; "
        "`rosgrade doctor` says what to do"
    )


def try_sandbox() -> Trial:
    """Make a sandbox in a sandbox, as a run does, and see whether that works here."""
    for program in ("bwrap", "unshare", "mount", "prlimit", "setpriv"):
        if shutil.which(program) is None:
            package = "bubblewrap" if program == "bwrap" else "util-linux"
            return Trial(f"{program} is not installed", f"sudo apt install {package}")
    try:
        from grader.sandbox.seccomp import student_filter

        student_filter()
    except (ImportError, OSError, RuntimeError) as error:
        return Trial(f"libseccomp cannot be used ({error})", "sudo apt install libseccomp2")
    inner = ["bwrap", *bubblewrap.namespaces(_UID, network=False), "--disable-userns"]
    inner += [*bubblewrap.system(), "--", "true"]
    arguments = [*bubblewrap.namespaces(_UID), *bubblewrap.system(), "--tmpfs", "/tmp"]
    command = ["unshare", "--user", "--map-current-user", "--mount", *inner]
    try:
        done = subprocess.run(
            bubblewrap.launch(arguments, (), (), command),
            env=bubblewrap.PLAIN_ENVIRONMENT,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Trial("bubblewrap hangs", "run `bwrap --unshare-all --ro-bind / / true` by hand")
    if done.returncode == 0:
        return Trial()
    lines = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
    return Trial(f"bubblewrap may not make namespaces: {lines[-1]}", _remedy())


def _remedy() -> str:
    if Path("/.dockerenv").exists() or Path("/run/.containerenv").exists():
        return (
            "start the container with --security-opt seccomp=unconfined --security-opt "
            "apparmor=unconfined --security-opt systempaths=unconfined, as root also --cap-add "
            "SYS_ADMIN"
        )
    switch = Path("/proc/sys/kernel/apparmor_restrict_unprivileged_userns")
    if switch.exists() and switch.read_text().strip() == "1":
        return f"allow it to bubblewrap alone (Ubuntu 23.10 and newer):\n{_APPARMOR}"
    return (
        "allow user namespaces (in a container: on its host): sudo sysctl "
        "user.max_user_namespaces=10000, and on some kernels kernel.unprivileged_userns_clone=1"
    )
