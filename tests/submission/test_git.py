"""git in a repository of a student's runs nothing of theirs."""

from __future__ import annotations

import subprocess
from pathlib import Path

from grader.submission.git import run_git


def test_no_program_that_a_repository_names_is_run(tmp_path: Path) -> None:
    repository, signer = tmp_path / "repository", tmp_path / "gpg"
    signer.write_text(
        "#!/bin/sh\n"
        'case "$*" in\n'
        f"  *--verify*) touch {tmp_path}/ran;;\n"
        # It reads first what it signs: git may still write that.
        '  *) cat >/dev/null; echo "[GNUPG:] SIG_CREATED " >&2\n'
        '     echo "-----BEGIN PGP SIGNATURE-----";;\n'
        "esac\n"
    )
    signer.chmod(0o755)

    def git(*arguments: str) -> None:
        subprocess.run(["git", *arguments], cwd=repository, check=True, capture_output=True)

    repository.mkdir()
    git("init")
    for name, value in {
        "user.name": "Mallory",
        "user.email": "mallory@example.org",
        "gpg.program": str(signer),
        "log.showSignature": "true",
    }.items():
        git("config", name, value)
    git("commit", "--allow-empty", "-m", "mine", "--gpg-sign")
    git("show", "--no-patch")
    assert (tmp_path / "ran").exists()
    (tmp_path / "ran").unlink()
    assert "mine" in run_git(["show", "--no-patch"], repository, 20.0)
    assert not (tmp_path / "ran").exists()
