"""A wrong name of a service, an action or a node costs the points of its own check."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import Ending
from grader.spec.names import NO_NAMES, Names, Thing, WrongName
from tests.checks.builder import died, judge, node, recording
from tests.checks.requests import SET_BOOL, action, asked, goal, service

LIGHT = {"service": "/light", "type": SET_BOOL}
CALLED = (asked(name="/light", answer_s=None, error="no server"),)


def names(check, run, **parameters):
    assert not judge(check, run, **parameters).names
    return [str(one) for one in judge(check, run, **parameters, remap=True).names.wrong]


def offering(*services, **changes):
    return recording(services=services, **changes)


def test_the_one_service_of_the_right_type_is_the_one_that_was_meant():
    run = offering(service("/ligth"), service("/bot/add", "std_srvs/srv/Trigger"), calls=CALLED)
    assert names("service.exists", run, **LIGHT) == ["/ligth:=/light"]
    # Without a type, that of the calls is the right one.
    assert names("service.exists", run, service="/light") == ["/ligth:=/light"]


@pytest.mark.parametrize(
    "run",
    [
        offering(),
        offering(service("/ligth", "std_srvs/srv/Trigger")),
        offering(service("/ligth"), service("/lamp")),
        # Another check asks for it, by calls.
        offering(service("/lamp"), calls=(*CALLED, asked(name="/lamp"))),
        offering(service("/ligth -r __ns")),
    ],
)
def test_an_unclear_service_is_never_guessed(run):
    assert names("service.exists", run, **LIGHT) == []


def test_the_one_action_of_the_right_type_is_the_one_that_was_meant():
    unmet = replace(goal(accepted=None, end_s=None), error="no server")
    run = offering(action("/fibonaci"), service("/enable"), goals=(unmet,), calls=())
    assert names("action.exists", run, action="/fibonacci") == ["/fibonaci:=/fibonacci"]


@pytest.mark.parametrize(
    ("nodes", "meant"),
    [
        (["/talker"], "/talker"),
        (["/lab/bot", "/bots"], "/lab/bot"),
        (["/bott", "/limiter"], "/bott"),
        (["/limiter", "/driver"], None),
        (["/lab/bot", "/lub/bot"], None),
        (["/_hidden"], None),
        ([], None),
    ],
)
def test_the_node_that_was_meant_is_the_only_or_the_nearest_one(nodes, meant):
    run = recording(nodes=tuple(map(node, nodes)))
    found = names("node.exists", run, name="bot")
    assert found == ([f"{meant}:=/bot"] if meant else [])


def test_a_node_to_which_the_assignment_speaks_by_its_name_is_not_misnamed():
    called = (asked(name="/driver/get_parameters"), asked(name="/lamp/list_parameters"))
    run = recording(nodes=(node("/driver"),), calls=called)
    assert names("node.exists", run, name="limiter") == []
    run = recording(nodes=(node("/driver"), node("/lamp")), calls=called)
    assert names("node.exists", run, name="limiter") == ["/lamp:=/limiter"]


def test_a_node_that_is_missing_because_a_process_ended_is_not_misnamed():
    run = recording(nodes=(node("/bots"),), processes=(died(-6, 1.6),), ending=Ending.EXITED)
    assert names("node.exists", run, name="bot") == []


@pytest.mark.parametrize(
    ("check", "there", "thing", "own", "asked_for"),
    [
        ("service.exists", {"services": (service("/light"),)}, Thing.SERVICE, "/ligth", LIGHT),
        (
            "action.exists",
            {"services": (action(),)},
            Thing.ACTION,
            "/fibb",
            {"action": "/fibonacci"},
        ),
        ("node.exists", {"nodes": (node("/bot"),)}, Thing.NODE, "/lab/bo", {"name": "bot"}),
    ],
)
def test_in_the_run_that_puts_it_right_the_name_is_still_wrong(check, there, thing, own, asked_for):
    asked_name = f"/{str(next(iter(asked_for.values()))).lstrip('/')}"
    wrong = Names.of([WrongName(thing, own, asked_name)])
    run = recording(**there, names=wrong)
    finding = judge(check, run, **asked_for, remap=True)
    assert (finding.status, finding.names) == (Status.FAILED, wrong)
    assert finding.observed.startswith(f"found `{own}` instead; everything else was judged in")
    assert judge(check, run, **asked_for).status is Status.PASSED
    assert judge(check, recording(**there), **asked_for, remap=True).names == NO_NAMES
