from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from grader.errors import GraderFault
from grader.recording.submission import BuildRecord
from grader.submission.build.build_cache import (
    INSTALL,
    BuildCache,
    CachedBuild,
)

BUILD = BuildRecord(succeeded=True, duration_s=1.5, log="fine\n")
COMPILED = "lib/python3.11/site-packages/node/__pycache__/node.cpython-311.pyc"
DAY_S = 24 * 3600.0


def stored(cache: BuildCache, key: str = "k", content: str = "x = 1\n") -> CachedBuild:
    with cache.unfinished() as folder:
        (folder / INSTALL / COMPILED).parent.mkdir(parents=True)
        (folder / INSTALL / "lib/node.py").write_text(content)
        (folder / INSTALL / COMPILED).write_bytes(b"compiled")
        return cache.store(key, folder, BUILD)


@pytest.fixture
def cache(tmp_path: Path) -> BuildCache:
    return BuildCache(tmp_path)


def names(tmp_path: Path) -> set[str]:
    return {path.name for path in (tmp_path / "builds").iterdir() if path.suffix != ".stamp"}


def test_what_was_stored_is_found_and_marked_as_cached(cache: BuildCache) -> None:
    first = stored(cache)
    found = cache.find("k")
    assert found is not None
    assert (first.build.cached, found.build.cached) == (False, True)
    assert found.build.duration_s == 1.5
    assert found.install == first.install
    assert found.install is not None
    assert (found.install / "lib/node.py").read_text() == "x = 1\n"


def test_a_failed_build_is_kept_too(cache: BuildCache) -> None:
    failed = BuildRecord(succeeded=False, duration_s=1.0)
    with cache.unfinished() as folder:
        assert cache.store("k", folder, failed) == CachedBuild(failed, None)
    found = cache.find("k")
    assert found is not None
    assert (found.build.succeeded, found.install) == (False, None)


def test_an_unfinished_build_leaves_nothing(cache: BuildCache, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), cache.unfinished() as folder:
        (folder / INSTALL).mkdir()
        raise KeyboardInterrupt
    assert names(tmp_path) == set()


@pytest.mark.parametrize(
    "damage", ["changed", "added", "removed", "executable", "compiled", "no record"]
)
def test_a_damaged_build_is_not_found_and_replaced(
    cache: BuildCache, tmp_path: Path, damage: str
) -> None:
    install = stored(cache).install
    assert install is not None
    if damage == "changed":
        (install / "lib/node.py").write_text("x = 2\n")
    elif damage == "added":
        (install / "lib/new.py").touch()
    elif damage == "removed":
        (install / "lib/node.py").unlink()
    elif damage == "executable":
        (install / "lib/node.py").chmod(0o755)
    elif damage == "compiled":
        (install / COMPILED).write_bytes(b"comp")
    else:
        (install.parent / "build.json").write_text("{")
    assert cache.find("k") is None
    stored(cache)
    assert cache.find("k") is not None
    assert names(tmp_path) == {"k"}
    assert {path.name for path in install.parent.iterdir()} == {"build.json", INSTALL}


def test_what_python_caches_while_it_runs_is_no_damage(cache: BuildCache) -> None:
    install = stored(cache).install
    assert install is not None
    (install / "lib/__pycache__").mkdir()
    (install / "lib/__pycache__/node.cpython-311.pyc").touch()
    assert cache.find("k") is not None


def test_who_comes_second_gets_the_first_build(cache: BuildCache) -> None:
    first = stored(cache, content="x = 1\n")
    second = stored(cache, content="x = 2\n")
    assert second.install == first.install
    assert second.build.cached
    assert second.install is not None
    assert (second.install / "lib/node.py").read_text() == "x = 1\n"


def test_a_second_build_waits_for_the_first_but_not_for_ever(cache: BuildCache) -> None:
    order: list[str] = []

    def other() -> None:
        with cache.locked("k", wait_s=20.0):
            order.append("second")

    with cache.locked("k", wait_s=20.0):
        thread = threading.Thread(target=other)
        thread.start()
        with cache.locked("k", wait_s=0.2), cache.locked("other", wait_s=20.0):
            order.append("first")
    thread.join()
    assert order == ["first", "second"]


def age(tmp_path: Path, key: str, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(tmp_path / "builds" / key, (then, then))


def test_builds_that_were_not_used_for_long_go(cache: BuildCache, tmp_path: Path) -> None:
    for key, days in (("old", 31), ("used", 29)):
        stored(cache, key)
        age(tmp_path, key, days * DAY_S)
    stored(cache, "soon after another")
    assert names(tmp_path) == {"old", "used", "soon after another"}
    age(tmp_path, "pruned.stamp", 3600)
    stored(cache, "new")
    assert names(tmp_path) == {"used", "soon after another", "new"}


def test_the_least_recently_used_go_when_there_is_too_much(
    cache: BuildCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grader.submission.build.build_cache._MOST_BYTES", 25)
    for key, days in (("first", 3), ("second", 2), ("third", 1)):
        stored(cache, key, content="x" * 10)
        age(tmp_path, key, days * DAY_S)
    cache.find("first")
    age(tmp_path, "first", 0.5 * DAY_S)
    cache.prune()
    assert names(tmp_path) == {"first", "third"}


def test_what_a_killed_build_left_goes_after_a_day(cache: BuildCache, tmp_path: Path) -> None:
    stored(cache)
    (tmp_path / "builds/.unfinished-old").mkdir()
    (tmp_path / "builds/.unfinished-now").mkdir()
    age(tmp_path, ".unfinished-old", 2 * DAY_S)
    cache.prune()
    assert names(tmp_path) == {"k", ".unfinished-now"}


def test_a_cache_that_cannot_be_used_is_no_fault_of_the_student(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    cache = BuildCache(tmp_path / "file")
    with pytest.raises(GraderFault, match="cache folder"), cache.locked("k", wait_s=0.0):
        pass
    with pytest.raises(GraderFault, match="cache folder"), cache.unfinished():
        pass


def test_a_cache_from_which_nothing_can_be_started_is_named(
    cache: BuildCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    class NoExec:
        f_flag = os.ST_NOEXEC

    monkeypatch.setattr(os, "statvfs", lambda _: NoExec)
    with pytest.raises(GraderFault, match="noexec"), cache.locked("k", 1.0):
        pass
