"""Mutants follow from what an assignment asks for, each with the checks that it loses."""

from __future__ import annotations

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.mutant import CPP, LANGUAGES, PYTHON, Language, read_files, reference_of
from grader.authoring.mutants.standard import Standard, standard_mutants


def made(name: str, language: Language = PYTHON) -> dict[str, Standard]:
    loaded = load_assignment(name)
    files = read_files(reference_of(name, loaded.folder, language))
    return {one.mutant.id: one for one in standard_mutants(loaded, files)}


@pytest.mark.parametrize("name", list_assignments())
@pytest.mark.parametrize("language", LANGUAGES, ids=lambda one: one.key)
def test_every_lesson_gets_mutants_for_nothing(name: str, language: Language) -> None:
    loaded = load_assignment(name)
    found = standard_mutants(loaded, read_files(reference_of(name, loaded.folder, language)))
    assert len({one.mutant.id for one in found}) == len(found) >= 12
    checks = {spec.id for spec in loaded.assignment.checks}
    for one in found:
        assert one.mutant.loses
        assert {*one.mutant.loses} <= checks
        assert bool(one.mutant.files) != bool(one.mistakes)


def test_a_mutant_loses_what_asks_for_the_fact_that_it_breaks() -> None:
    found = {name: one.mutant.loses for name, one in made("timed_publisher").items()}
    assert found["dependency_misspelt"] == ("dependencies",)
    assert found["best_effort"] == ("qos",)
    assert found["period_ten_times"] == ("period",)
    # Not the checks that require it: those are skipped.
    assert found["ends_at_once"] == ("alive", "sent")
    assert found["never_publishes"] == ("sent",)


def test_only_what_is_asked_for_is_broken() -> None:
    found = made("simple_publisher")
    # No timer is asked for, and one message exactly.
    assert not {"period_ten_times", "blocks_in_its_callback", "never_spins"} & found.keys()
    assert found["published_twice"].mutant.loses == ("once",)


def test_each_language_has_mistakes_of_its_own_files() -> None:
    python, cpp = made("timed_publisher"), made("timed_publisher", CPP)
    assert {*python} - {*cpp} == {
        "entry_point_missing",
        "entry_point_to_nothing",
        "resource_file_missing",
        "setup_cfg_missing",
        "setup_raises",
    }
    assert {*cpp} - {*python} == {"not_installed"}


def test_where_there_are_several_of_a_kind_the_id_says_of_what() -> None:
    found = made("bot_controller")
    assert found["topic_misspelt_scan"].mutant.loses == ("subscribes",)
    assert found["topic_misspelt_cmd_vel"].mutant.loses == ("topic",)
    assert "best_effort" in found
    programs = {name: [one.program for one in item.mistakes] for name, item in made("qos").items()}
    assert programs["node_misnamed_qos_subscriber"] == ["qos_subscriber"]
