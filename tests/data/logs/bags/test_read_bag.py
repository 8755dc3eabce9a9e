"""Bags: the numbers of messages come back, whatever the container and the publishers' habits."""

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from pivident.data.logs.bags import joint_topics
from pivident.data.logs.bags.read_bag import open_bag, read_bag
from pivident.data.logs.described_log import bare_log
from pivident.data.logs.source_files import SourceFile
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.data.recording.load import load_recording
from pivident.foundation.errors import FileFormatError, RecordingError, UnknownColumn
from tests.bags import (
    EPOCH,
    MIDNIGHT,
    NEWER,
    OLDER,
    STATE,
    Messages,
    header,
    joint_state,
    joint_states,
    typestore,
    write_bag,
)

KINDS = [
    ".bag", "lz4.bag", "bz2.bag", "sqlite3", "sqlite3+file", "sqlite3+message", "mcap",
    "mcap+storage", "mcap+file",
]  # fmt: skip
NAMES = ["shoulder", "elbow"]
RATE, SAMPLES = 500.0, 400
T = np.arange(SAMPLES) / RATE
Q = np.column_stack([np.sin(9 * T), np.cos(7 * T)])
TAU = np.column_stack([np.cos(3 * T), np.sin(5 * T)])
COLUMNS = {"q": "position", "tau": "effort"}


def simple(folder, kind, **changes):
    store = typestore(kind)
    content = {"names": NAMES, "t": T, "q": Q, "tau": TAU} | changes
    return write_bag(folder, kind, store, [joint_states(store, kind.endswith("bag"), **content)])


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_holds_the_numbers_of_the_table(tmp_path, kind):
    path = simple(tmp_path, kind)
    table = np.column_stack([T, Q, TAU])
    np.savetxt(
        tmp_path / "log.csv", table, delimiter=",", header="t,q1,q2,a,b", comments="", fmt="%.17g"
    )
    text = load_recording(
        tmp_path / "log.csv", {"t": "t", "q": ["q1", "q2"], "tau": ["a", "b"]}, joint_names=NAMES
    )
    made = load_recording(path, COLUMNS, joint_names=NAMES)
    np.testing.assert_array_equal(made.q, text.q)
    np.testing.assert_array_equal(made.tau, text.tau)
    assert made.rate == RATE
    assert made.start_time == EPOCH - MIDNIGHT
    assert made.sources[0].sha256 == SourceFile.of(path).sha256


def test_a_bare_mcap_and_a_bare_database_are_read_without_their_folder(tmp_path):
    for kind, ending in (("mcap", "mcap"), ("sqlite3", "db3")):
        (file,) = simple(tmp_path, kind).glob(f"*.{ending}")
        columns = read_table(file, ["/joint_states/effort/elbow", "/joint_states/stamp"])
        np.testing.assert_array_equal(columns["/joint_states/effort/elbow"], TAU[:, 1])
        np.testing.assert_allclose(
            columns["/joint_states/stamp"], EPOCH - MIDNIGHT + T, rtol=0, atol=1e-10
        )


def test_names_are_those_of_topics_fields_and_joints(tmp_path):
    assert names_in(simple(tmp_path, "mcap")) == (
        "/joint_states/position/shoulder",
        "/joint_states/position/elbow",
        "/joint_states/velocity/shoulder",
        "/joint_states/velocity/elbow",
        "/joint_states/effort/shoulder",
        "/joint_states/effort/elbow",
        "/joint_states/stamp",
        "/joint_states/receive_time",
    )


@pytest.mark.parametrize("kind", [".bag", "mcap"])
def test_joints_that_change_places_keep_their_names(tmp_path, kind):
    store = typestore(kind)
    messages = joint_states(store, kind == ".bag", NAMES, T, Q, TAU)
    for _, message in messages.content[1::2]:
        message.name = message.name[::-1]
        message.position = message.position[::-1].copy()
        message.effort = message.effort[::-1].copy()
    path = write_bag(tmp_path, kind, store, [messages])
    made = load_recording(path, COLUMNS, joint_names=NAMES[::-1])
    np.testing.assert_array_equal(made.q, Q[:, ::-1])
    np.testing.assert_array_equal(made.tau, TAU[:, ::-1])


def test_a_gripper_that_speaks_between_does_not_leave_holes(tmp_path):
    store = typestore("sqlite3")
    gripper = Messages("/joint_states", "sensor_msgs/msg/JointState")
    for t in np.arange(0.0131, 0.7, 0.05):
        gripper.content.append((t, joint_state(store, False, t, ["finger"], [0.01])))
    path = write_bag(
        tmp_path, "sqlite3", store, [joint_states(store, False, NAMES, T, Q, TAU), gripper]
    )
    made = load_recording(path, COLUMNS, joint_names=NAMES)
    np.testing.assert_array_equal(made.q, Q)
    columns = read_bag(path)
    finger = columns["/joint_states/position/finger"]
    assert np.isfinite(finger).sum() == len(gripper.content)
    assert np.isnan(columns["/joint_states/position/elbow"]).sum() == len(gripper.content)


def test_joints_in_messages_of_their_own_are_merged_by_joint(tmp_path):
    store = typestore("mcap")
    one = joint_states(store, False, NAMES[:1], T, Q[:, :1], TAU[:, :1])
    later = T + 0.7e-3
    other = joint_states(
        store, False, NAMES[1:], later, np.cos(7 * later)[:, None], np.sin(5 * later)[:, None]
    )
    path = write_bag(tmp_path, "mcap", store, [one, other])
    made = load_recording(path, COLUMNS, joint_names=NAMES)
    assert any("sparsest" in note for note in made.notes)
    t = made.t - (EPOCH - MIDNIGHT)
    np.testing.assert_allclose(made.q, np.column_stack([np.sin(9 * t), np.cos(7 * t)]), atol=1e-7)
    np.testing.assert_allclose(made.tau, np.column_stack([np.cos(3 * t), np.sin(5 * t)]), atol=1e-4)


@pytest.mark.parametrize("filled", ["positions", "everything", "drifting"])
@pytest.mark.parametrize("kind", [".bag", "mcap"])
def test_another_publisher_of_the_same_joints_is_left_out_and_named(tmp_path, kind, filled):
    """A node for a display sends zeros five times as often; the driver's messages are the log."""
    store, is_ros1 = typestore(kind), kind == ".bag"
    display = Messages("/joint_states", "sensor_msgs/msg/JointState")
    for t in np.arange(0.0131, 0.7, 0.2e-3):
        arrays = [[5.0 * t if filled == "drifting" else 0.0, 0.0]]
        arrays += [] if filled == "positions" else 2 * [[0.0, 0.0]]
        display.content.append((t, joint_state(store, is_ros1, t, NAMES[::-1], *arrays)))
    driver = joint_states(store, is_ros1, NAMES, T, Q, TAU)
    path = write_bag(tmp_path, kind, store, [driver, display])
    made = load_recording(path, COLUMNS, joint_names=NAMES)
    np.testing.assert_array_equal(made.q, Q)
    np.testing.assert_array_equal(made.tau, TAU)
    why = open_bag(path).passed_over["/joint_states"]
    number, total = len(display.content), len(display.content) + len(T)
    assert f"{number} (" in why and f"of {total} messages come from other sources" in why


def test_a_publisher_of_other_joints_beside_the_same_ones_keeps_those(tmp_path):
    """The display's own joint is no other source; its copies of the arm's joints are."""
    store = typestore("mcap")
    head = Messages("/joint_states", "sensor_msgs/msg/JointState")
    for t in T[::4] + 0.2e-3:
        message = joint_state(store, False, t, [*NAMES, "head"], [0.0, 0.0, np.sin(t)])
        head.content.append((t, message))
    path = write_bag(tmp_path, "mcap", store, [joint_states(store, False, NAMES, T, Q, TAU), head])
    np.testing.assert_array_equal(load_recording(path, COLUMNS, joint_names=NAMES).q, Q)
    own = read_bag(path)["/joint_states/position/head"]
    np.testing.assert_array_equal(own[np.isfinite(own)], np.sin(T[::4] + 0.2e-3))


def test_joints_in_turns_are_one_source(tmp_path):
    store = typestore("mcap")
    turns = Messages("/joint_states", "sensor_msgs/msg/JointState")
    names, q = [*NAMES, "wrist"], np.column_stack([Q, Q[:, :1] + 1.0])
    for k, t in enumerate(T):
        own = [j for j in range(3) if j != k % 3]
        message = joint_state(store, False, t, [names[j] for j in own], q[k, own])
        turns.content.append((t, message))
    path = write_bag(tmp_path, "mcap", store, [turns])
    assert not open_bag(path).passed_over
    found = read_bag(path)
    for j, name in enumerate(names):
        rows = [k for k in range(len(T)) if j != k % 3]
        np.testing.assert_array_equal(found[f"/joint_states/position/{name}"][rows], q[rows, j])


MOTORS = "uint8 mode\nfloat32 q\nfloat32 tau_est\nint16[2] temperature\nfloat32[2] spare"
LOW = "builtin_interfaces/Time time\ndemo_msgs/Motor[3] motor_state\ngeometry_msgs/Point[] points"


@pytest.mark.parametrize("kind", [".bag", "mcap"])
def test_arrays_of_a_robot_s_own_type_are_columns_by_number(tmp_path, kind):
    """As the low-level states of a legged robot: motor_state[3], each with its own fields."""
    store = typestore(kind)
    store.register(get_types_from_msg(MOTORS, "demo_msgs/msg/Motor"))
    low = LOW if kind == "mcap" else LOW.replace("builtin_interfaces/Time", "time")
    store.register(get_types_from_msg(low, "demo_msgs/msg/Low"))
    make, low, point = (
        store.types[f"{name}"] for name in
        ("demo_msgs/msg/Motor", "demo_msgs/msg/Low", "geometry_msgs/msg/Point")
    )  # fmt: skip
    stamp = store.types["builtin_interfaces/msg/Time"](1, 2)
    sent = Messages("/lowstate", "demo_msgs/msg/Low")
    q = np.float32(np.random.default_rng(1).normal(size=(40, 3)))
    for k in range(40):
        motors = [
            make(k % 3, q[k, j], 2 * q[k, j], np.int16([20, 30]), np.float32([j, k]))
            for j in range(3)
        ]
        sent.content.append((0.01 * k, low(stamp, motors, [point(1.0, 2.0, 3.0)])))
    columns = read_bag(write_bag(tmp_path, kind, store, [sent]))
    assert not any("points" in name for name in columns), "points are no states of drives"
    for j in range(3):
        np.testing.assert_array_equal(columns[f"/lowstate/motor_state/q/{j}"], q[:, j])
        np.testing.assert_array_equal(columns[f"/lowstate/motor_state/tau_est/{j}"], 2 * q[:, j])
        np.testing.assert_array_equal(columns[f"/lowstate/motor_state/spare/{j}/1"], np.arange(40))


def test_names_beside_the_values_of_each_joint_stand_before_it(tmp_path):
    """control_msgs/DynamicJointState: a list of interfaces for each joint."""
    store = typestore("mcap")
    value = "string[] interface_names\nfloat64[] values"
    state = "std_msgs/Header header\nstring[] joint_names\ndemo_msgs/Value[] interface_values"
    store.register(get_types_from_msg(value, "demo_msgs/msg/Value"))
    store.register(get_types_from_msg(state, "demo_msgs/msg/State"))
    value, state = (store.types[f"demo_msgs/msg/{name}"] for name in ("Value", "State"))
    sent = Messages("/dynamic", "demo_msgs/msg/State")
    for k in range(len(T)):
        own = [value(["position", "effort"], np.array([Q[k, j], TAU[k, j]])) for j in range(2)]
        sent.content.append((T[k], state(header(store, T[k], False), NAMES, own)))
    path = write_bag(tmp_path, "mcap", store, [sent])
    made = load_recording(
        path, {"q": "values/position", "tau": "values/effort"}, joint_names=NAMES[::-1]
    )
    np.testing.assert_array_equal(made.q, Q[:, ::-1])
    np.testing.assert_array_equal(made.tau, TAU[:, ::-1])


def test_missing_efforts_are_no_columns_and_nan_efforts_are_left_out_by_name(tmp_path):
    with pytest.raises(UnknownColumn, match="effort"):
        load_recording(simple(tmp_path, "mcap", tau=None), COLUMNS, joint_names=NAMES)
    spoilt = TAU.copy()
    spoilt[7, 1] = np.nan
    made = load_recording(simple(tmp_path, "sqlite3", tau=spoilt), COLUMNS, joint_names=NAMES)
    assert np.argwhere(~made.valid).tolist() == [[7, 1]]
    assert "tau of elbow is empty, NaN or infinite at sample 7" in made.notes[0]


@pytest.mark.parametrize("kind", [".bag", "sqlite3", "mcap"])
@pytest.mark.parametrize(
    ("definition", "actual", "desired"),
    [(OLDER, "actual", "desired"), (NEWER, "feedback", "reference")],
)
def test_both_states_of_a_trajectory_controller_are_read(
    tmp_path, kind, definition, actual, desired
):
    store = typestore(kind, definition)
    is_ros1 = kind == ".bag"
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    duration = store.types["builtin_interfaces/msg/Duration"](0, 0)
    free = store.types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]
    nothing = np.zeros(0)
    messages = Messages("/arm/state", STATE)
    for k in range(50):
        points = {
            name: point(*[np.array(x) for x in values], time_from_start=duration)
            for name, values in {
                actual: (Q[k], 2 * Q[k], nothing, TAU[k]),
                desired: (3 * Q[k], nothing, nothing, nothing),
                "error": (nothing,) * 4,
                "output": (nothing,) * 4,
            }.items()
        }
        others = {
            f"multi_dof_{name}": free([], [], [], duration)
            for name in ("reference", "feedback", "error", "output")
        }
        content = {"joint_names": NAMES, "multi_dof_joint_names": [], **points, **others}
        known = {
            name: content[name] for name in store.types[STATE].__annotations__ if name in content
        }
        message = store.types[STATE](header=header(store, T[k], is_ros1), **known)
        messages.content.append((T[k], message))
    path = write_bag(tmp_path, kind, store, [messages])
    made = load_recording(
        path,
        {
            "q": f"{actual}/positions", "tau": f"{actual}/effort", "q_ref": f"{desired}/positions",
        },
        joint_names=NAMES,
    )  # fmt: skip
    np.testing.assert_array_equal(made.q, Q[:50])
    np.testing.assert_array_equal(made.tau, TAU[:50])
    np.testing.assert_array_equal(made.q_ref, 3 * Q[:50])
    log = bare_log(path)
    assert set(log.channels) >= {"q", "dq", "tau", "q_ref"}


def test_a_controller_state_without_a_definition_in_the_bag_is_still_read(tmp_path):
    import sqlite3

    store = typestore("sqlite3", OLDER)
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    duration = store.types["builtin_interfaces/msg/Duration"](0, 0)
    nothing = np.zeros(0)
    messages = Messages("/arm/state", STATE)
    for k in range(20):
        points = [point(Q[k] + c, nothing, nothing, TAU[k], duration) for c in range(3)]
        message = store.types[STATE](header(store, T[k], False), NAMES, *points)
        messages.content.append((T[k], message))
    path = write_bag(tmp_path, "sqlite3", store, [messages])
    (file,) = path.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("DROP TABLE message_definitions")
    np.testing.assert_array_equal(
        read_bag(path)["/arm/state/actual/positions/elbow"], Q[:20, 1] + 1
    )


def test_several_robots_need_the_topic_in_the_name(tmp_path):
    store = typestore("mcap")
    both = [
        joint_states(store, False, NAMES, T, c * Q, TAU, topic=f"/{side}/joint_states")
        for c, side in ((1.0, "left"), (2.0, "right"))
    ]
    path = write_bag(tmp_path, "mcap", store, both)
    with pytest.raises(RecordingError, match=r"2 topics with 'position'.*/left/joint_states"):
        load_recording(path, COLUMNS, joint_names=NAMES)
    columns = {"q": "/right/joint_states/position", "tau": "right/joint_states/effort"}
    np.testing.assert_array_equal(load_recording(path, columns, joint_names=NAMES).q, 2 * Q)
    with pytest.raises(RecordingError, match="no joint wrist; its joints are shoulder, elbow"):
        load_recording(path, columns, joint_names=["shoulder", "wrist"])


def test_unknown_messages_are_passed_over_and_said(tmp_path):
    store = typestore("mcap")
    text = Messages("/chatter", "std_msgs/msg/String")
    text.content.append((0.1, store.types["std_msgs/msg/String"]("hello")))
    path = write_bag(tmp_path, "mcap", store, [joint_states(store, False, NAMES, T, Q, TAU), text])
    assert open_bag(path).passed_over == {"/chatter": "its messages hold no floats"}
    (tmp_path / "other").mkdir()
    alone = write_bag(tmp_path / "other", "mcap", store, [text])
    with pytest.raises(FileFormatError, match=r"no topic .* /chatter \(std_msgs/msg/String\)"):
        names_in(alone)


def test_messages_without_stamps_get_the_time_of_their_receipt_and_say_so(tmp_path):
    store = typestore("mcap")
    messages = Messages("/joint_states", "sensor_msgs/msg/JointState")
    for k in range(SAMPLES):
        message = joint_state(store, False, None, NAMES, Q[k], (), TAU[k])
        messages.content.append((T[k], message))
    made = load_recording(
        write_bag(tmp_path, "mcap", store, [messages]), COLUMNS, joint_names=NAMES
    )
    assert made.rate == RATE
    assert "carry no stamps" in made.notes[0]


def test_messages_out_of_order_and_repeated_ones_are_put_right_and_said(tmp_path):
    store = typestore("mcap")
    messages = joint_states(store, False, NAMES, T, Q, TAU)
    (one, first), (two, second) = messages.content[10], messages.content[11]
    messages.content[10], messages.content[11] = (one, second), (two, first)
    messages.content.append((T[20] + 0.9e-3, messages.content[20][1]))
    made = load_recording(
        write_bag(tmp_path, "mcap", store, [messages]), COLUMNS, joint_names=NAMES
    )
    np.testing.assert_array_equal(made.q, Q)
    assert any("out of order" in note for note in made.notes)
    assert any("1 repeated" in note for note in made.notes)


def test_messages_are_never_kept_one_by_one(tmp_path, monkeypatch):
    monkeypatch.setattr(joint_topics, "TOGETHER", 64)
    largest = 0
    taken = joint_topics.TopicReader.take

    def take(self, received, message):
        nonlocal largest
        taken(self, received, message)
        largest = max(largest, len(self._waiting))

    monkeypatch.setattr(joint_topics.TopicReader, "take", take)
    made = load_recording(simple(tmp_path, "sqlite3"), COLUMNS, joint_names=NAMES)
    np.testing.assert_array_equal(made.q, Q)
    assert largest < 64


def test_a_folder_that_is_no_bag_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="is a folder; name the file"):
        read_table(tmp_path)
    with pytest.raises(FileFormatError, match=r"without the \.db3 or \.mcap files"):
        open_bag(tmp_path)
