"""A contract stands for the packages and checks that an author would write, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.assignment.contract.expand import expanded, plain
from grader.assignment.contract.table import MARKER, with_table
from grader.assignment.load import load_assignment
from grader.authoring.visible_files import visible_files
from grader.errors import AssignmentError
from grader.machine import resources
from grader.report.html.handout import make_handout
from grader.spec.document import write_yaml
from grader.spec.source import parse_source

GOOD = """\
rosgrade: 1
id: lesson
title: Drive
contract:
  packages:
    bot:
      build_type: [ament_python, ament_cmake]
      depends: [rclpy, geometry_msgs]
      executables:
        drive:
          node: driver
          publishes:
            /cmd_vel:
              type: geometry_msgs/msg/Twist
              reliability: reliable
              period: 100 ms
  points: {builds: 1, topic: 1, type: 1, qos: 1, period: 2}
scenarios:
  - {id: run, until: {messages: 5}, timeout: 5 s}
"""

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(text: str) -> Path:
        place = tmp_path / "lesson"
        place.mkdir(exist_ok=True)
        (place / "assignment.yaml").write_text(text, encoding="utf-8")
        return place

    return write


def found(place: Path) -> list[str]:
    """The mistakes in an assignment, without the file."""
    try:
        load_assignment(place)
    except AssignmentError as error:
        return [f"{one.line}: {one.where}: {one.message}" for one in error.problems]
    return []


def test_it_is_read_as_what_it_stands_for(write: Write) -> None:
    short = load_assignment(write(GOOD))
    assert short.source is not None
    whole = load_assignment(write(write_yaml(plain(short.source))))
    assert whole.assignment.contract is None
    for key in ("packages", "scenarios", "checks"):
        assert getattr(short.assignment, key) == getattr(whole.assignment, key)
    assert [one.title for one in short.checks] == [one.title for one in whole.checks]


def test_it_makes_packages_launches_records_and_checks(write: Write) -> None:
    made = load_assignment(write(GOOD)).assignment
    assert made.packages[0].executables == ("drive",)
    (scenario,) = made.scenarios
    assert scenario.launch[0].executable == "drive"
    assert scenario.recorded_types == {"/cmd_vel": "geometry_msgs/msg/Twist"}
    requires = {one.id: one.requires for one in made.checks}
    assert requires == {
        "builds": (),
        "topic": ("builds",),
        "type": ("topic",),
        "qos": ("topic",),
        "period": ("type", "builds"),
    }


def test_a_launch_that_names_no_program_starts_the_only_one(write: Write) -> None:
    launch = "launch: [{parameters: {speed: 0.5}}], until: {m"
    (scenario,) = load_assignment(write(GOOD.replace("until: {m", launch))).assignment.scenarios
    (started,) = scenario.launch
    assert (started.executable, started.parameters) == ("drive", {"speed": 0.5})
    assert scenario.recorded_types == {"/cmd_vel": "geometry_msgs/msg/Twist"}


def test_where_the_check_of_a_name_is_left_out_the_next_one_puts_the_name_right(
    write: Write,
) -> None:
    checks = load_assignment(write(GOOD.replace("topic: 1, ", ""))).assignment.checks
    assert next(one for one in checks if one.id == "type").with_["remap"] is True


def test_two_parts_with_one_fact_have_their_names_in_the_ids(write: Write) -> None:
    second = "        turn:\n          publishes: {/turns: {type: geometry_msgs/msg/Twist}}\n"
    text = GOOD.replace(
        "  points: {builds: 1, topic: 1, ", f"{second}  points: {{cmd_vel_topic: 1, "
    )
    text = text.replace("type: 1, qos: 1", "turns_topic: 1, turn_alive: 1, qos: 1")
    text = text.replace("until: {m", "launch: [{executable: drive}, {executable: turn}], until: {m")
    ids = [one.id for one in load_assignment(write(text)).assignment.checks]
    assert ids == ["cmd_vel_topic", "qos", "period", "turn_alive", "turns_topic"]
    named = text.replace("turns: {type", "turns: {ids: {topic: turning}, type")
    named = named.replace("turns_topic: 1", "turning: 1").replace("cmd_vel_topic: 1", "topic: 1")
    ids = [one.id for one in load_assignment(write(named)).assignment.checks]
    assert ids == ["topic", "qos", "period", "turn_alive", "turning"]


def test_what_differs_is_written_under_its_id(write: Write) -> None:
    changed = "  checks: {period: {title: Ten a second, with: {spread: 20 %}, requires: [qos]}}\n"
    (period,) = load_assignment(
        write(GOOD.replace("scenarios:\n", f"{changed}scenarios:\n"))
    ).checks[-1:]
    assert (period.title, period.spec.requires) == ("Ten a second", ("qos",))
    assert period.spec.with_ == {"topic": "/cmd_vel", "period": "100 ms", "spread": "20 %"}


def test_a_parameter_of_a_standard_check_is_taken_out_by_null(write: Write) -> None:
    changed = "  checks: {topic: {with: {remap: null}}}\nscenarios:\n"
    checks = load_assignment(write(GOOD.replace("scenarios:\n", changed))).assignment.checks
    (topic,) = (one for one in checks if one.id == "topic")
    assert topic.with_ == {"topic": "/cmd_vel"}


def test_a_row_of_the_handout_tells_all_of_a_parameter(write: Write) -> None:
    said = "{type: double, default: 0.2, range: [0, 1], read_only: true, described: true}"
    parameters = f"parameters: {{speed: {said}}}\n          publishes:"
    place = write(GOOD.replace("publishes:", parameters))
    (place / "README.md").write_text("<!-- contract -->\n")
    assert (
        "| parameter | `speed`, double, default `0.2`, from 0 to 1, read-only, with a description |"
        in make_handout(load_assignment(place)).text
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "geometry_msgs/msg/Twist\n",
            "geometry_msgs/Twist\n",
            "13: contract.packages.bot.executables.drive.publishes./cmd_vel: ",
        ),
        (
            "contract:\n",
            "packages: []\ncontract:\n",
            "4: packages: the packages stand in the contr",
        ),
        ("qos: 1, ", "qoz: 1, ", "17: contract.points.qoz: the contract has no check 'qoz'."),
        (
            "          node: driver\n",
            "          node: driver\n          ids: {exists: there}\n",
            "12: contract.packages.bot.executables.drive.ids.exists: nothing here makes a check",
        ),
        (
            "scenarios:\n",
            "  checks: {qos: {points: 3}}\nscenarios:\n",
            "18: contract.checks.qos.points: its points stand under 'points'",
        ),
        (
            "scenarios:\n",
            "checks:\n  - {id: qos, uses: node.alive, points: 1}\nscenarios:\n",
            "19: checks[0].id: 'qos' comes from the contract already: write what differs under",
        ),
        (
            "scenarios:\n",
            "checks:\n  - {id: mine, uses: node.alife, points: 1}\nscenarios:\n",
            "19: checks[0].uses: there is no check 'node.alife'.",
        ),
        (
            "scenarios:\n",
            "  checks: {period: {with: {spread: much}}}\nscenarios:\n",
            "18: contract.checks.period.with.spread: ",
        ),
        (
            "scenarios:\n",
            "  checks: {period: {visibility: hidden}}\nscenarios:\n",
            "18: contract.checks.period.visibility: the contract is what students are told",
        ),
        (
            "scenarios:\n",
            "  checks: {ends: {hint: Look}}\nscenarios:\n",
            "18: contract.checks.ends: the contract judges no check 'ends'.",
        ),
        ("builds: 1", "builds: -1", "17: contract.points.builds: "),
        (
            "period: 100 ms",
            "period: {spread: 20 %}",
            "13: contract.packages.bot.executables.drive.",
        ),
        (
            "      executables:\n",
            "      interfaces: {msg/A: {definition: x}}\n      executables:\n",
            "6: contract.packages.bot: CMake generates interfaces",
        ),
        ("scenarios:\n", "checks: {a: b}\nscenarios:\n", "18: checks: expected a list"),
        ("  - {id: run", "  run: {id: run", "18: scenarios: expected a list"),
        ("depth", "", ""),
        ("node: driver", "nodes: driver", "11: contract.packages.bot.executables.drive.nodes: "),
        (
            "            /cmd_vel:\n",
            "            /o: {type: a/msg/B, ids: {topic: t, type: t}}\n            /cmd_vel:\n",
            "13: contract.packages.bot.executables.drive.publishes./o: two checks of the contr",
        ),
    ],
)
def test_what_contradicts_itself_is_told_at_its_line(
    write: Write, old: str, new: str, said: str
) -> None:
    told = found(write(GOOD.replace(old, new, 1)))
    assert told[0].startswith(said) if said else not told


def test_a_name_that_is_open_twice_is_refused(write: Write) -> None:
    free = "{match: any, in: executables, example: drive}"
    text = GOOD.replace("contract:\n", f"variables:\n  a: {free}\n  b: {free}\ncontract:\n")
    told = found(write(text))
    assert told == [
        "6: variables.b.match: 'a' takes any name of the executables already: give one a form, "
        "another 'of', or both the same 'where'"
    ]


@given(total=st.integers(1, 400), without=st.sets(st.sampled_from(["qos", "period"])))
def test_one_number_is_shared_out_to_the_last_point(total: int, without: set[str]) -> None:
    text = GOOD
    for name, line in (("qos", "reliability: reliable"), ("period", "period: 100 ms")):
        if name in without:
            text = text.replace(f"              {line}\n", "")
    points = total / 4
    text = text.replace("{builds: 1, topic: 1, type: 1, qos: 1, period: 2}", f"{points}")
    checks = expanded(parse_source(text, Path("a.yaml"))).data["checks"]
    shares = [one["points"] for one in checks]
    assert math.isclose(math.fsum(shares), points)
    assert all(share >= 0.0 for share in shares)


def test_the_handout_has_the_table_and_goes_on_with_the_authors_rows(write: Write) -> None:
    place = write(GOOD)
    (place / "README.md").write_text("# Drive\n\n<!-- contract -->\n| stops | at walls |\n")
    text = make_handout(load_assignment(place)).text
    assert "| executable | `drive` |\n| node | `driver` |\n" in text
    assert "| publishes | `/cmd_vel`, type `geometry_msgs/msg/Twist`, reliable |\n" in text
    assert text.endswith("| runs | until Ctrl+C |\n| stops | at walls |\n")


def test_a_chosen_name_may_stand_in_a_contract(write: Write) -> None:
    text = GOOD.replace("    bot:\n", '    "bot{n}":\n').replace(
        "contract:\n", "variables: {n: {match: 'bot{n}', example: 7}}\ncontract:\n"
    )
    loaded = load_assignment(write(text))
    assert loaded.assignment.packages[0].name == "bot7"
    assert loaded.entries["builds"]["with"] == {"package": "bot{n}"}


def test_a_program_waits_for_no_check_of_another_one(write: Write) -> None:
    second = """        echo:
          responsive: {within: 1 s}
          serves: {/ask: {type: std_srvs/srv/Trigger}}
"""
    text = GOOD.replace(
        "  points: {", f"{second}  points: {{echo_alive: 1, responsive: 1, service: 1, "
    )
    text = text.replace("until: {m", "launch: [{executable: drive}, {executable: echo}], until: {m")
    checks = load_assignment(write(text.replace("period: 2", "drive_alive: 1, period: 2"))).checks
    requires = {one.spec.id: one.spec.requires for one in checks}
    assert requires["period"] == ("type", "drive_alive")
    assert requires["responsive"] == ("echo_alive",)
    assert requires["service"] == ("builds",)


def test_two_topics_of_a_program_have_titles_of_their_own(write: Write) -> None:
    other = "            /b: {type: geometry_msgs/msg/Twist, reliability: reliable}\n"
    text = GOOD.replace("            /cmd_vel:\n", f"{other}            /cmd_vel:\n")
    text = text.replace("topic: 1, type: 1, qos: 1", "b_qos: 1, cmd_vel_qos: 1")
    titles = {one.spec.id: one.title for one in load_assignment(write(text)).checks}
    assert titles["b_qos"] == "The publisher on /b is reliable"
    assert titles["cmd_vel_qos"] == "The publisher on /cmd_vel is reliable"


def test_a_client_is_judged_where_the_scenario_serves_what_it_calls(write: Write) -> None:
    client = """              period: 100 ms
          calls: {/ask: {type: std_srvs/srv/Trigger}}
          sends_goals: {/turn: {type: bot_msgs/action/Turn}}
"""
    text = GOOD.replace("              period: 100 ms\n", client)
    text = text.replace("period: 2}", "period: 2, calls: 1}")
    (said,) = found(write(text))
    assert said.startswith("17: contract.packages.bot.executables.drive.calls./ask: no stimulus")
    served = "stimuli: [{serve: /ask, type: std_srvs/srv/Trigger, answers: [{}]}], until: {m"
    place = write(text.replace("until: {m", served))
    (place / "README.md").write_text("<!-- contract -->\n")
    loaded = load_assignment(place)
    (calls,) = (one for one in loaded.checks if one.spec.id == "calls")
    assert calls.title == "The node calls the service /ask"
    assert calls.spec.with_ == {"server": "/ask", "more": True}
    handout = make_handout(loaded).text
    assert "| calls the service | `/ask`, type `std_srvs/srv/Trigger` |" in handout
    assert "| sends goals to | `/turn`, type `bot_msgs/action/Turn` |" in handout


def test_a_part_whose_name_is_chosen_needs_ids_where_there_are_several(write: Write) -> None:
    text = GOOD.replace(
        "    bot:\n", '    "bot{n}_msgs": {build_type: ament_cmake}\n    "bot{n}":\n'
    )
    text = text.replace("contract:\n", "variables: {n: {match: 'bot{n}', example: 7}}\ncontract:\n")
    assert found(write(text))[0].startswith("7: contract.packages.bot{n}_msgs: its name is chosen")


def test_students_get_the_contract_and_no_hidden_check(write: Write) -> None:
    secret = "checks:\n  - {id: secret, uses: node.alive, points: 1, visibility: hidden}\n"
    place = write(GOOD.replace("scenarios:\n", f"{secret}scenarios:\n"))
    (place / "README.md").write_text("# Drive\n\n<!-- contract -->\n")
    loaded = load_assignment(place)
    files = visible_files(loaded)
    assert "| node | `driver` |" in files["README.md"].decode()
    assert "secret" not in files["assignment.yaml"].decode()
    part = load_assignment(write(files["assignment.yaml"].decode()))
    assert [one.spec.id for one in part.checks] == ["builds", "topic", "type", "qos", "period"]
    assert part.withheld.points == 1.0
    assert make_handout(part).total == make_handout(loaded).total


def test_a_rate_is_judged_and_told_in_the_table(write: Write) -> None:
    text = GOOD.replace("period: 100 ms", "rate: {at_least: 9 Hz, at_most: 11 Hz}")
    text = text.replace("period: 2", "rate: 2")
    loaded, often = load_assignment(write(text)), "at least 9 Hz and at most 11 Hz"
    *_, rate = loaded.checks
    assert (rate.spec.id, rate.title) == ("rate", f"Messages come with {often}")
    assert rate.spec.with_ == {"topic": "/cmd_vel", "at_least": "9 Hz", "at_most": "11 Hz"}
    assert f"| how often | {often} |" in with_table(MARKER, loaded.assignment)
    (wrong,) = found(write(text.replace("at_least: 9 Hz, at_most: 11 Hz", "at_least: 9 m")))
    assert wrong.startswith("13: contract.packages.bot.executables.drive.publishes./cmd_vel: ")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("{data: {contains: ready}}", "data that contains “ready”"),
        ("{data: '!= 0'}", "data != 0"),
        ("{data: 2.0}", "data = 2.0"),
    ],
)
def test_what_is_asked_of_a_value_is_told_in_the_title_and_in_the_handout(
    write: Write, asked: str, words: str
) -> None:
    said = f"reliability: reliable\n              value: {asked}"
    text = GOOD.replace("reliability: reliable", said).replace(
        "period: 2}", "period: 2, values: 1}"
    )
    kind = "String" if "contains" in asked else "Float64"
    text = text.replace("geometry_msgs/msg/Twist", f"std_msgs/msg/{kind}")
    place = write(text)
    (place / "README.md").write_text("<!-- contract -->\n")
    loaded = load_assignment(place)
    assert f"Every message has {words}" in [one.title for one in loaded.checks]
    field, _, rest = words.replace(" that", "").partition(" ")
    assert f"| message | `{field}` {rest};" in make_handout(loaded).text


def test_a_handout_says_which_names_of_its_table_are_only_examples() -> None:
    team = load_assignment(resources.root() / "docs" / "examples" / "rescue_team").assignment
    said, _, table = with_table(MARKER, team).partition("\n\n")
    assert said.startswith("These names are examples, and yours to choose: ") and said.endswith(".")
    assert "`scout`" in said and "`/assign`" in said and "| offers the service | `/assign`" in table
    # The package has the name of the team in front: it is no free name.
    assert "red_rescue" not in said
