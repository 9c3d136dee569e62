"""Mutants follow from what an assignment asks for, each with the checks that it loses."""

from __future__ import annotations

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.reference import CPP, LANGUAGES, PYTHON, Language, read_files, reference_of
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
        "import_misspelt",
        "resource_file_missing",
        "setup_cfg_missing",
        "setup_raises",
    }
    assert {*cpp} - {*python} == {
        "header_misspelt",
        "include_folder_missing",
        "installed_in_bin",
        "never_initialised",
        "not_installed",
        "package_not_found",
        "source_misspelt",
        "target_dependencies_missing",
    }
    assert python["import_misspelt"].mutant.loses == ("starts",)
    assert cpp["never_initialised"].mutant.loses == ("starts",)
    assert cpp["installed_in_bin"].mutant.loses == ("executable",)


def test_what_is_wrong_in_one_file_for_several_programs_is_one_mutant() -> None:
    found = made("executors", CPP)
    assert found["installed_in_bin"].mutant.loses == ("single_executable", "multi_executable")
    assert found["not_installed_multi_threaded"].mutant.loses == ("multi_executable",)


@pytest.mark.parametrize("language", LANGUAGES, ids=lambda one: one.key)
def test_interfaces_are_wrong_in_every_place_that_a_check_looks_at(language: Language) -> None:
    found = {name: one.mutant.loses for name, one in made("custom_interface", language).items()}
    assert found["package_misnamed_enpm702_msgs"] == ("msgs_package",)
    assert found["definition_in_lower_case"] == ("definition",)
    assert found["array_without_bound"] == ("fields",)
    assert found["constant_missing"] == ("constants",)
    # Without a package the type is another one, and there is no such type.
    assert found["type_without_package"] == ("fields", "generated")
    assert found["runtime_undeclared"] == ("manifest",)
    # Not manifest, which waits for the build here.
    assert found["no_member_of_group"] == ("generated",)
    assert ("ament_package_missing" in found) == (language is PYTHON)


def test_a_program_lacks_what_it_has_in_the_graph_or_has_too_much() -> None:
    found = {name: one.mutant.loses for name, one in made("custom_interface").items()}
    assert found["no_publisher"] == ("topic",)
    assert found["no_subscription"] == ("odom",)
    assert found["publishes_too"] == ("untouched",)
    # Not on /odom, which it has a subscription to: no node may have two types for one topic.
    assert made("custom_interface")["publishes_too"].mistakes[0].value == "/cmd_vel"
    assert made("subscribers")["never_exits"].mutant.loses == ("ends",)
    assert found["hangs_at_start"] == ("starts",)


def test_a_period_is_longer_by_twice_its_tolerance() -> None:
    found = made("timed_publisher")
    assert found["period_a_little_longer"].mistakes[0].value == "1.1"
    # So long that nothing comes.
    assert found["period_a_thousand_times"].mutant.loses == ("sent",)
    # The executor waits for the timer, and answers calls meanwhile; it does not if it never spins.
    loses = {name: one.mutant.loses for name, one in made("qos").items()}
    assert loses["never_spins"] == ("publisher_spins", "counts")
    assert loses["period_a_thousand_times"] == ("period", "counts")


def test_where_there_are_several_of_a_kind_the_id_says_of_what() -> None:
    found = made("bot_controller")
    assert found["topic_misspelt_scan"].mutant.loses == ("subscribes",)
    assert found["topic_misspelt_cmd_vel"].mutant.loses == ("topic",)
    assert "best_effort" in found
    programs = {name: [one.program for one in item.mistakes] for name, item in made("qos").items()}
    assert programs["node_misnamed_qos_subscriber"] == ["qos_subscriber"]
