"""A recording survives its MCAP file, and any MCAP reader opens it."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from grader.errors import UsageError
from grader.recording.event import Disturbance, Intervention, Wait
from grader.recording.interaction import Asked, Feedback, Goal, Service
from grader.recording.interface import concatenated_definition, definition_finder
from grader.recording.mcap_reader import read_inputs, read_recording
from grader.recording.mcap_writer import RawMessage, write_recording
from grader.recording.model import (
    Call,
    Declaration,
    Ending,
    Join,
    LogLine,
    Node,
    Owner,
    Process,
    Qos,
    Recording,
)
from grader.recording.simulated import Incident, Scene, Truth
from grader.recording.submission import (
    BuildRecord,
    Lint,
    LintFinding,
    PackageRecord,
    SourceError,
    SourceFile,
    SubmissionRecord,
)
from sim.motion import Pose
from sim.shapes import MovingObstacle, Waypoint
from tests.checks.builder import endpoint
from tests.recording.written import TWIST

CDR_HEADER = b"\x00\x01\x00\x00"


FED = (Feedback(3_100, {"sequence": [0, 1]}),)
STATUSES = ((3_020, "executing"),)
WAY = (Waypoint(0, Pose(1.0, 2.0, 0.5)), Waypoint(10, Pose(1.0, 2.5, 0.5)))
BOX = MovingObstacle("moving[0]", WAY, size_m=(0.4, 0.2), appears_ns=5, line=7)
PACKAGE = PackageRecord(
    name="bot_publisher",
    path="src/bot_publisher",
    syntax_errors=(SourceError("node.py", 3, "invalid syntax"),),
    files=(("bot_publisher/node.py", "src/node.py"),),
    sources=(SourceFile("src/node.py", "bot_publisher.node", prints=(7,)),),
    lint=Lint(None, (LintFinding("F401", "src/node.py", 1, "unused"),)),
)

SECOND = 1_000_000_000


def a_recording(**changes: object) -> Recording:
    """A recording with one fact of each kind."""
    recording = Recording(
        scenario="run",
        seed=7,
        ending=Ending.UNTIL,
        launched_ns=1_000,
        matched_ns=2_000,
        stop_ns=9_000,
        end_ns=9_500,
        submission=SubmissionRecord(
            bags=(),
            id="ada",
            sha256="ab" * 32,
            packages=(PACKAGE,),
            build=BuildRecord(succeeded=True, duration_s=0.9, log="ok"),
        ),
        nodes=(Node("/bot_publisher", Owner.STUDENT, 1_500),),
        endpoints=(dataclasses.replace(endpoint(), vanished_ns=9_100),),
        processes=(Process("p/e", 42, 1_000, 9_400, -2, "SIGINT", 0.06, ("sleep 99",), 5),),
        log=(LogLine(3_000, "p/e", "stdout", "<b>\x1b[31mred\u202e"),),
        declarations=(Declaration(1_700, "p/e", "timer", {"period_s": 0.3, "group": {"id": 1}}),),
        calls=(
            Call("/bot_publisher/list_parameters", "srv", 2_500, None),
            Call("/go", "x/srv/Go", 2_600, 2_700, {"to": [1.5]}, {"done": True}),
            Call("/gone", "x/srv/Go", 2_800, request={}, error="no server"),
        ),
        services=(Service("/go", "x/srv/Go", "/bot_publisher", 1_650, 9_100),),
        clients=(Service("/add", "x/srv/Add", "/bot_publisher", 1_660),),
        asked=(
            Asked("/add", "x/srv/Add", {"a": 1}, 2_000, "answered", None, FED, None, 2_010, {}),
        ),
        goals=(Goal("/fib", "x/action/Fib", {"order": 2}, 3_000, True, 3_010, FED, STATUSES),),
        waits=(Wait("a node", 10.0, 1_000, 1_500),),
        joins=(Join("late", "/cmd_vel", "geometry_msgs/msg/Twist", Qos("reliable"), 4_000, 4_500),),
        interventions=(Intervention(5_000, "p/e", "kill", "SIGINT"),),
        sent={"/chatter": ()},
        answers={"/chatter": "/cmd_vel"},
        disturbance=(Disturbance(2_000, 30, 40),),
        faults=("not alone",),
        truth=(Truth(2_010, 0.1, -0.2, 3.0, 0.1, 0.0, 0.2, -0.1, "moving[0]"),),
        incidents=(
            Incident(2_010, "contact_began", "moving[0]"),
            Incident(2_020, "late", "3 steps done 25 ms late", 0.025),
        ),
        scenes={
            name: Scene(0.1, 0.22, 2.84, {"boxes[0]": ((1.0, -1.0, 1.0, 1.0, 0.0),)}, (BOX,), 2_000)
            for name in ("tb1", "tb2")
        },
        environment={"rmw": "rmw_fastrtps_cpp"},
    )
    return dataclasses.replace(recording, **changes)  # type: ignore[arg-type]


def written(folder: Path, recording: Recording, *messages: RawMessage) -> Path:
    file = folder / "run.mcap"
    write_recording(file, recording, messages, {"geometry_msgs/msg/Twist": TWIST})
    return file


def raw(stamp_ns: int, *fields: float, sequence: int = 1) -> RawMessage:
    cdr = CDR_HEADER + struct.pack("<6d", *fields)
    return RawMessage("/cmd_vel", "geometry_msgs/msg/Twist", cdr, stamp_ns, stamp_ns + 50, sequence)


def test_all_that_was_written_is_read_again(tmp_path: Path) -> None:
    recording = a_recording()
    again = read_recording(written(tmp_path, recording))
    assert again == recording


def test_messages_come_back_decoded_in_the_order_of_their_source_stamps(tmp_path: Path) -> None:
    file = written(
        tmp_path, a_recording(), raw(4_000, 1, 0, 0, 0, 0, 0.5, sequence=2), raw(3_000, *range(6))
    )
    first, second = read_recording(file).on("/cmd_vel")
    assert (first.stamp_ns, first.received_ns, first.sequence) == (3_000, 3_050, 1)
    assert first.value == {
        "linear": {"x": 0.0, "y": 1.0, "z": 2.0},
        "angular": {"x": 3.0, "y": 4.0, "z": 5.0},
    }
    assert second.value["angular"]["z"] == 0.5


def test_the_feedback_of_an_action_is_a_message_like_any_other(tmp_path: Path) -> None:
    share = tmp_path / "share"
    for name, text in (
        ("x/action/Fib.action", "int32 order\n---\n---\nint32[] sequence # so far\n"),
        ("unique_identifier_msgs/msg/UUID.msg", "uint8[16] uuid\n"),
    ):
        (share / name).parent.mkdir(parents=True)
        (share / name).write_text(text)
    kind, topic = "x/action/Fib_FeedbackMessage", "/fib/_action/feedback"
    definition = concatenated_definition(kind, definition_finder([tmp_path]))
    cdr = CDR_HEADER + bytes(range(16)) + struct.pack("<I2i", 2, 5, 8)
    message = RawMessage(topic, kind, cdr, 3_000, 3_050, 1)
    write_recording(tmp_path / "run.mcap", a_recording(), [message], {kind: definition})
    (found,) = read_recording(tmp_path / "run.mcap").on(topic)
    assert (found.type, found.value["feedback"]) == (kind, {"sequence": [5, 8]})


def test_a_message_of_other_bytes_than_its_type_has_is_counted_and_hurts_no_other(
    tmp_path: Path,
) -> None:
    good = raw(4_000, *range(6))
    wrong = [dataclasses.replace(good, cdr=cdr) for cdr in (b"", CDR_HEADER + b"abc")]
    read = read_recording(written(tmp_path, a_recording(), *wrong, good))
    assert [message.stamp_ns for message in read.on("/cmd_vel")] == [4_000]
    assert read.unreadable == {"/cmd_vel": 2}


def test_a_type_that_cannot_be_decoded_is_no_fault_of_who_published_it(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    wide = RawMessage("/name", "bot_msgs/msg/Name", CDR_HEADER + b"\0" * 8, 3_000, 3_050, 1)
    write_recording(file, a_recording(), [wide], {"bot_msgs/msg/Name": "wstring name\n"})
    with pytest.raises(UsageError, match=r"/name: a wstring cannot be read"):
        read_recording(file)


def test_what_was_sent_and_what_joined_late_stay_apart_from_what_was_heard(tmp_path: Path) -> None:
    heard, kept = raw(3_000, 1, 0, 0, 0, 0, 0), raw(3_000, 1, 0, 0, 0, 0, 0)
    ours = dataclasses.replace(raw(2_500, 2, 0, 0, 0, 0, 0), topic="/goal", is_sent=True)
    late = dataclasses.replace(kept, received_ns=4_600, join="late")
    later = dataclasses.replace(raw(2_000, 3, 0, 0, 0, 0, 0), received_ns=4_700, join="late")
    recording = a_recording(sent={"/chatter": (), "/goal": ()})
    again = read_recording(written(tmp_path, recording, heard, ours, late, later))
    assert [message.value["linear"]["x"] for message in again.on("/cmd_vel")] == [1.0]
    assert again.on("/goal") == ()
    assert again.sent["/chatter"] == ()
    (sent,) = again.sent["/goal"]
    assert (sent.topic, sent.stamp_ns, sent.value["linear"]["x"]) == ("/goal", 2_500, 2.0)
    # In the order of their reception, which tells what came of the past.
    assert [message.received_ns for message in again.joined["late"]] == [4_600, 4_700]
    assert {message.topic for message in again.joined["late"]} == {"/cmd_vel"}
    assert again.carried("/goal") == (sent,)
    assert again.carried("/cmd_vel") == again.on("/cmd_vel")


@settings(max_examples=50, deadline=None)
@given(st.lists(st.text(max_size=40), max_size=20))
def test_any_log_line_comes_back(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str]
) -> None:
    # Surrogates cannot come from decoding with errors="replace".
    texts = [line.encode(errors="replace").decode() for line in lines]
    log = tuple(LogLine(n, "p/e", "stdout", text) for n, text in enumerate(texts))
    recording = a_recording(log=log)
    folder = tmp_path_factory.mktemp("log")
    assert read_recording(written(folder, recording)).log == log


def test_any_mcap_reader_opens_it(tmp_path: Path) -> None:
    file = written(tmp_path, a_recording(), raw(3_000, 1, 0, 0, 0, 0, 0.5))
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        topics = {channel.topic for channel in summary.channels.values()}
        decoded = [m for _, _, _, m in reader.iter_decoded_messages(topics=["/cmd_vel"])]
    assert topics == {"/cmd_vel", "/rosgrade/launched"}
    assert decoded[0].angular.z == 0.5


@pytest.mark.parametrize("size", [0, 1, 100, -50, -1])
def test_a_damaged_file_is_one_clear_error(tmp_path: Path, size: int) -> None:
    file = written(tmp_path, a_recording(), raw(3_000, *range(6)))
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(UsageError, match=r"run\.mcap: "):
        read_recording(file)


@pytest.mark.parametrize("flipped", [0x01, 0x10, 0xFF])
def test_a_flipped_byte_is_never_another_recording(
    tmp_path: Path, flipped: int, capfd: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, a_recording(), raw(3_000, *range(6)))
    good, recording = file.read_bytes(), read_recording(file)
    for place in range(0, len(good), 7):
        damaged = bytes([good[place] ^ flipped])
        file.write_bytes(good[:place] + damaged + good[place + 1 :])
        try:
            assert read_recording(file) == recording, f"byte {place}"
        except UsageError as error:
            assert str(file) in str(error)
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file"):
        read_recording(tmp_path / "none.mcap")


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyError):
        write_recording(tmp_path / "run.mcap", a_recording(), [raw(1, *range(6))], {})
    assert list(tmp_path.iterdir()) == []


def test_the_host_s_share_is_what_overlaps_the_interval() -> None:
    recording = a_recording(
        disturbance=(
            Disturbance(2_000, 10, 100),
            Disturbance(3_000, 50, 200),
            Disturbance(4_000, 20, 400),
        )
    )
    assert recording.stolen_s(2_500, 2_600) == pytest.approx(250e-9)
    assert recording.stolen_s(2_500, 3_500) == pytest.approx(650e-9)
    assert recording.stolen_s(5_000, 6_000) == 0.0


def test_a_time_of_one_s_own_is_longer_by_all_that_the_host_took_in_it() -> None:
    host = (Disturbance(n * SECOND, 0, SECOND // 2) for n in (2, 3, 4, 9))
    recording = a_recording(disturbance=tuple(host))
    # By the half second of the first sample it reaches into the second, and so on.
    assert recording.own_end_ns(SECOND, 0.9) == SECOND + 1_900_000_000
    assert recording.own_begin_ns(4 * SECOND, 0.9) == 4 * SECOND - 1_900_000_000
    assert recording.own_end_ns(5 * SECOND, 0.9) == 5 * SECOND + 1_400_000_000


def with_every_channel(folder: Path) -> Path:
    heard = raw(3_000, 1, 0, 0, 0, 0, 0.5)
    sent = dataclasses.replace(raw(2_500, 2, 0, 0, 0, 0, 0), topic="/goal", is_sent=True)
    late = dataclasses.replace(raw(3_000, 1, 0, 0, 0, 0, 0), received_ns=4_600, join="late")
    again = dataclasses.replace(heard, is_sent=True)
    return written(
        folder, a_recording(sent={"/chatter": (), "/goal": ()}), heard, sent, late, again
    )


def test_a_recording_of_before_is_read_as_before(tmp_path: Path) -> None:
    """The file is one that the writer of format 2 wrote."""
    old = read_recording(Path(__file__).with_name("format_2.mcap"))
    file = with_every_channel(tmp_path)
    new = read_recording(file)
    # It had one robot, without a name.
    of_before = {"sent": {**new.sent, "/cmd_vel": ()}, "scenes": {"": new.scenes["tb1"]}}
    assert dataclasses.replace(new, **of_before) == dataclasses.replace(
        old, sent={**old.sent, "/cmd_vel": ()}
    )
    assert [sent.is_sent for sent in read_inputs(file, new)] == [True, True]


def test_rosbags_reads_a_recording_that_begins_at_the_launch(tmp_path: Path) -> None:
    file = with_every_channel(tmp_path)
    with AnyReader([file]) as reader:
        topics = {connection.topic for connection in reader.connections}
        found = [
            (reader.deserialize(raw, connection.msgtype), time_ns - reader.start_time)
            for connection, time_ns, raw in reader.messages()
            if connection.topic == "/rosgrade/joins/late"
        ]
        assert reader.start_time == a_recording().launched_ns
    assert topics == {"/cmd_vel", "/goal", "/rosgrade/joins/late", "/rosgrade/launched"}
    assert [(message.linear.x, since_ns) for message, since_ns in found] == [(1.0, 3_600)]


def test_the_same_recording_is_the_same_bytes(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    one, other = with_every_channel(tmp_path), with_every_channel(tmp_path / "other")
    assert one.read_bytes() == other.read_bytes()
