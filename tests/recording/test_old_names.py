"""Wrong names in recordings and records of before."""

from __future__ import annotations

import json

from grader.recording.model import to_json
from grader.recording.old_names import names_of_run
from grader.recording.submission import PackageRecord, SubmissionRecord, record_of
from grader.spec.names import NO_NAMES, Names, Thing, WrongName


def test_names_of_a_recording_of_before_are_read_once():
    text = "/cmdvel:=/cmd_vel lib/bot/go:=lib/bot/run pkg:=bot velocity:=speed"
    assert names_of_run({"remaps": text, "parameters": "speed"}) == Names.of(
        [
            WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel"),
            WrongName(Thing.FILE, "lib/bot/go", "lib/bot/run"),
            WrongName(Thing.PACKAGE, "pkg", "bot"),
            WrongName(Thing.PARAMETER, "velocity", "speed"),
        ]
    )
    assert names_of_run({}) == NO_NAMES


def test_packages_of_a_record_of_before_still_stand_in_for_others():
    record = SubmissionRecord("ana", "ab" * 32, packages=(PackageRecord("week3", "week3"),))
    before = {**json.loads(to_json(record)), "stand_ins": [["bot", "week3"]]}
    del before["names"]
    found = record_of(json.dumps(before, separators=(",", ":")).encode())
    assert found.package("bot") == record.packages[0]
    assert record_of(to_json(found)) == found
    before["stand_ins"] = []
    assert record_of(json.dumps(before, separators=(",", ":")).encode()) == record
