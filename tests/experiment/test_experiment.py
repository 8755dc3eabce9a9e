"""Experiment files: what they say becomes the problem, what is wrong is said in one line."""

import numpy as np
import pytest

from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.literature.frequency_domain import FrequencyDomain
from pivident.estimation.method import AutoRegressive
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.signal_recipes import Algebraic, Bandpass, RandomWalk
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import (
    DatasetUnavailable,
    ExperimentError,
    PividentError,
    UnknownColumn,
)
from pivident.loop.simulation.controllers import PID, Cascade
from tests.planar_log import EXPERIMENT, planar_log, write_experiment


def changed(old: str, new: str) -> str:
    assert old in EXPERIMENT
    return EXPERIMENT.replace(old, new)


def with_identify(text: str) -> str:
    return changed('methods = ["ls"]', text)


def load(folder, text: str = EXPERIMENT):
    return load_experiment(write_experiment(folder, text))


def message(folder, text: str) -> str:
    with pytest.raises(ExperimentError) as caught:
        load(folder, text).problem()
    line = str(caught.value)
    assert "\n" not in line and str(folder / "experiment.toml") in line
    return line.replace(str(folder / "experiment.toml"), "FILE")


def test_file_becomes_robot_recording_loop_and_methods(tmp_path):
    experiment = load(tmp_path)
    problem = experiment.problem()
    assert problem.robot.name == "planar 2R"
    (recording,) = problem.recordings
    assert recording.rate == pytest.approx(1000.0) and recording.samples == 8000
    assert np.allclose(recording.q, np.deg2rad(planar_log()[:, 1:3]), atol=1e-9)
    assert recording.q_ref is not None
    assert isinstance(problem.loop.controller, PID)
    assert np.array_equal(problem.loop.controller.kp, [6000.0, 2500.0])
    assert problem.loop.reference == "recorded"
    assert experiment.methods() == {"ls": LeastSquares()}
    assert experiment.output is None and experiment.title == "experiment"


def test_paths_are_relative_to_the_file(tmp_path, monkeypatch):
    path = write_experiment(tmp_path)
    monkeypatch.chdir("/")
    assert load_experiment(path).recordings()[0].sources[0].name == "log.csv"


def test_progress_is_told(tmp_path):
    lines: list[str] = []
    load(tmp_path).problem(lines.append)
    assert any("recording" in line for line in lines)


def test_several_recordings_parts_and_timing(tmp_path):
    text = EXPERIMENT.replace("[recording]", "[[recording]]", 1)
    second = text[text.index("[[recording]]") : text.index("[controller]")]
    extra = 'name = "middle"\npart = [1, 3.5]\ncontrol_rate = 2000\ndelay = 0.001\n'
    text = text.replace("[controller]", second + extra + 'torque_timing = "averaged"\n[controller]')
    whole, part = load(tmp_path, text).problem().recordings
    assert whole.samples == 8000 and part.samples == 2500 and part.start_time == 1.0
    assert part.name == "middle" and part.control_rate == 2000.0 and part.delay == 0.001
    assert part.torque_timing == "averaged" and whole.torque_timing == "held"


def test_a_pattern_stands_for_every_run_of_a_folder(tmp_path):
    path = write_experiment(tmp_path, changed('"log.csv"', '"runs/*.csv"'))
    runs = tmp_path / "runs"
    runs.mkdir()
    for name in ("tuesday", "monday"):
        (runs / f"{name}.csv").write_bytes((tmp_path / "log.csv").read_bytes())
    problem = load_experiment(path).problem()
    assert [recording.name for recording in problem.recordings] == ["monday", "tuesday"]


def test_a_pattern_that_no_file_fits_is_named(tmp_path):
    line = message(tmp_path, changed('"log.csv"', '"runs/*.csv"'))
    assert "runs/*.csv" in line and "no file fits" in line


def test_one_name_for_many_runs_is_refused(tmp_path):
    text = changed('files = "log.csv"', 'name = "shift"\nfiles = "*.csv"')
    path = write_experiment(tmp_path, text)
    (tmp_path / "other.csv").write_bytes((tmp_path / "log.csv").read_bytes())
    with pytest.raises(ExperimentError, match="leave it out, they are named by their files"):
        load_experiment(path)


def test_robot_additions(tmp_path):
    robot = """
        [robot]
        model = "planar_2r"
        gravity = "none"
        friction = [{term = "viscous"}, {term = "coulomb", smoothing = "sign"}]
        extra_friction = {elbow = [{term = "offset"}]}
        rotor_inertia = {shoulder = 0.3}
        reduction_matrix = [[50, 0], [25, 50]]
        drive_gain = [2, 3]
        couplings = [{motor = "elbow", joint = 1, parameters = ["fvm"]}]
    """
    built = load(tmp_path, changed('robot = "planar_2r"', robot)).robot
    assert np.array_equal(built.gravity, np.zeros(3))
    stems = [[term.stem for term in joint.friction.terms] for joint in built.joints]
    assert stems == [["fv", "fc"], ["fv", "fc", "off"]]
    assert np.allclose(built.rotor_inertia, [0.3, 0.1])
    assert built.transmission.reduction[1, 0] == 25.0
    assert np.array_equal(built.transmission.drive_gain, [2.0, 3.0])
    (coupling,) = built.couplings
    assert (coupling.motor, coupling.joint, coupling.ratio) == (1, 0, 0.5)
    assert coupling.viscous and not coupling.inertia


def test_single_joints_may_have_laws_of_their_own(tmp_path):
    robot = """
        [robot]
        model = "planar_2r"
        friction = ["viscous", "coulomb", "load"]
        joint_friction = {elbow = ["viscous", {term = "dahl", distance = 1e-3}]}
        extra_friction = {elbow = [{term = "ripple", order = 51, name = "_g"}]}
    """
    text = changed('robot = "planar_2r"', robot)
    built = load(tmp_path, text).robot
    stems = [[term.stem for term in joint.friction.terms] for joint in built.joints]
    assert stems == [["fv", "fc", "fl"], ["fv", "fc", "rc_g", "rs_g"]]
    assert built.joints[1].friction.terms[1].shape("presliding_distance").value == 1e-3
    twice = text.replace('["viscous", {term = "dahl"', '["coulomb", {term = "dahl"')
    said = message(tmp_path, twice)
    assert "joint_friction of joint 'elbow'" in said and "named twice: fc; 'dahl'" in said


def test_robot_from_files_beside_the_experiment(tmp_path):
    (tmp_path / "arm.toml").write_text('name = "one"\n[[joints]]\nname = "a"\n')
    assert load(tmp_path, changed("planar_2r", "arm.toml")).robot.name == "one"


URDF = """<robot name="pair"><link name="base"/><link name="l1"/><link name="l2"/>
<joint name="a" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="2" effort="3"/></joint>
<joint name="b" type="revolute"><parent link="l1"/><child link="l2"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="2" effort="3"/></joint></robot>"""


def test_urdf_with_frozen_joints(tmp_path):
    (tmp_path / "pair.urdf").write_text(URDF)
    text = '[robot]\nmodel = "pair.urdf"\njoints = ["a"]\nfrozen = {b = 0.5}'
    assert load(tmp_path, changed('robot = "planar_2r"', text)).robot.joint_names == ("a",)


@pytest.mark.parametrize(
    ("lines", "kind", "gains"),
    [
        ('type = "pid"\nkp = 10\nkd = [1, 2]\nki = 3\nderivative_time = 0.001', PID, [10.0, 10.0]),
        ('type = "cascade"\nkp = [10, 20]\nkv = 3\naveraged = true\nlimit = 9', Cascade, [10, 20]),
    ],
)
def test_controllers(tmp_path, lines, kind, gains):
    head, _, tail = EXPERIMENT.partition("[controller]")
    text = (
        head
        + "[controller]\n"
        + lines
        + '\ndrive_gain = [2, 4]\nfeed_forward = "gravity"\n'
        + tail[tail.index("[ident") :]
    )
    loop = load(tmp_path, text).problem().loop
    assert isinstance(loop.controller, kind)
    assert np.array_equal(loop.controller.kp, gains)
    assert np.array_equal(loop.drive_gain, [2.0, 4.0]) and loop.feed_forward == "gravity"


def test_virtual_law_follows_the_smoothed_measurement(tmp_path):
    head, _, tail = EXPERIMENT.partition("[controller]")
    text = (
        head + '[controller]\ntype = "virtual_pd"\nbandwidth = 5\n' + tail[tail.index("[ident") :]
    )
    text = text.replace(', q_ref = ["r1", "r2"]', "").replace('q_ref = "deg", ', "")
    loop = load(tmp_path, text.replace('["ls"]', '["iv"]')).problem().loop
    assert loop.reference == "smoothed"
    assert (loop.controller.kp > 0).all() and (loop.controller.kd > 0).all()


def test_shared_and_own_options(tmp_path):
    text = with_identify(
        """
        methods = ["ols", "ls", "iv", "iv-full-rate", "piv", "piv-as-printed"]
        tolerance = 0.005
        bandpass = {cutoff = 60, decimation = [5, 4], edge = [10, 0]}
        random_walk = {order = 2}
        noise = {p_max = 40}
        ls = {signals = "random_walk", random_walk = {f50_max = 80}}
        iv = {bandpass = {bandwidth = 15}, max_iterations = 7}
        piv = {prefilter = "direct", noise = {criterion = "bic"}}
        """
    )
    methods = load(tmp_path, text).methods()
    filters = Bandpass(cutoff=60, decimation=(5, 4), edge=(10, 0))
    assert methods["ols"] == LeastSquares(weighted=False, signals=filters)
    assert methods["ls"] == LeastSquares(signals=RandomWalk(order=2, f50_max=80))
    assert methods["iv"] == InstrumentalVariables(
        Bandpass(cutoff=60, bandwidth=15, edge=(10, 0)), tolerance=0.005, max_iterations=7
    )
    assert methods["iv-full-rate"] == InstrumentalVariables(RandomWalk(order=2), tolerance=0.005)
    assert methods["piv"] == PrefilteredIV(
        signals=RandomWalk(order=2),
        noise=AutoRegressive(40, "bic"),
        prefilter="direct",
        tolerance=0.005,
    )
    assert methods["piv-as-printed"] == PrefilteredIV(
        noise=AutoRegressive(40), as_printed=True, tolerance=0.005
    )


def test_algebraic_signals(tmp_path):
    text = with_identify(
        """
        methods = ["ols", "ls", "tls", "iv", "iv-full-rate"]
        algebraic = {degree = 4, bandwidth = 15}
        ls = {signals = "algebraic", algebraic = {window = [0.1, 0.2], decimation = [5, 4]}}
        tls = {signals = "algebraic"}
        iv = {signals = "algebraic", algebraic = {both_sides = false}}
        iv-full-rate = {signals = "algebraic", algebraic = {decimation = 1, exponent = 3}}
        """
    )
    methods = load(tmp_path, text).methods()
    own = Algebraic(degree=4, bandwidth=15)
    assert methods["ols"] == LeastSquares(weighted=False)
    assert methods["ls"] == LeastSquares(signals=Algebraic((0.1, 0.2), degree=4, decimation=(5, 4)))
    assert methods["tls"].signals == own
    assert methods["iv"] == InstrumentalVariables(
        Algebraic(degree=4, both_sides=False, bandwidth=15)
    )
    assert methods["iv-full-rate"] == InstrumentalVariables(
        Algebraic(degree=4, exponent=3.0, decimation=1)
    )
    text = with_identify('methods = ["iv-full-rate"]\niv-full-rate = {signals = "algebraic"}')
    assert load(tmp_path, text).methods()["iv-full-rate"].signals == Algebraic(decimation=1)


def test_lines_of_a_periodic_motion(tmp_path):
    text = with_identify(
        """
        methods = ["frequency"]
        tolerance = 0.005
        frequency = {period = 5, transient = 2, bandpass = {cutoff = 80, bandwidth = 25}}
        """
    )
    assert load(tmp_path, text).methods()["frequency"] == FrequencyDomain(
        signals=Bandpass(cutoff=80, bandwidth=25), period=5, transient=2, tolerance=0.005
    )
    text = with_identify('methods = ["frequency"]\nfrequency = {signals = "algebraic"}')
    assert "[identify.frequency]" in message(tmp_path, text) and "signals" in message(
        tmp_path, text
    )


def test_parameters_mask_and_start(tmp_path):
    text = with_identify(
        'parameters = ["zz1", "zz2", "fv1", "fv2", "fc1", "fc2"]\nmask = 0\ninitial = {zz1r = 2.5}'
    )
    problem = load(tmp_path, text).problem()
    assert problem.names == ("zz1r", "fv1", "fc1", "zz2", "fv2", "fc2")
    assert problem.initial_values()[0] == 2.5
    assert not problem.speed_limits(problem.recordings[0]).joints.any()


def test_default_methods_follow_from_the_controller(tmp_path):
    assert tuple(load(tmp_path, with_identify("")).methods()) == ("ls", "iv", "iv-full-rate", "piv")
    head, _, _ = EXPERIMENT.partition("[controller]")
    assert tuple(load(tmp_path, head).methods()) == ("ls", "iv-full-rate", "piv")


def test_output_is_beside_the_file(tmp_path):
    experiment = load(tmp_path, EXPERIMENT + '[output]\nfolder = "out"\ntitle = "Arm"\n')
    assert experiment.output == tmp_path / "out" and experiment.title == "Arm"


BAD = {
    "no TOML": ("robot = ", ("is not TOML", "correct this line")),
    "unknown table": (EXPERIMENT + "[outptu]\n", ("FILE: unknown table 'outptu'", "'output'")),
    "unknown key": (changed("kp =", "pk ="), ("[controller] unknown key 'pk'", "'kp'")),
    "key that is gone": (
        changed("[recording]\n", "[recording]\nsimulated = true\n"),
        ("[recording] key 'simulated' is gone", "the data decide", "delete the line"),
    ),
    "unknown key of a method": (
        with_identify("piv = {as_print = true}"),
        ("[identify] unknown key 'piv.as_print'", "'as_printed'"),
    ),
    "unknown method table": (
        with_identify("iv-fullrate = {tolerance = 0.1}"),
        ("'iv-fullrate'", "'iv-full-rate'"),
    ),
    "unknown channel": (
        changed("q_ref = [", "q_reff = ["),
        ("[recording] unknown key 'columns.q_reff'", "'q_ref'"),
    ),
    "missing table": (EXPERIMENT.split("[recording]")[0], ("no recording", "[recording]")),
    "missing key": (changed('type = "pd"\n', ""), ("[controller] key 'type' is missing",)),
    "missing kind of law": (changed('type = "pd"\n', ""), ("add it, one of 'pd', 'pid'",)),
    "key in capitals": (changed("kp =", "kP ="), ("unknown key 'kP'", "did you mean 'kp'")),
    "model called urdf": (
        changed('robot = "planar_2r"', '[robot]\nurdf = "x.urdf"'),
        ("[robot] unknown key 'urdf'; did you mean 'model'?",),
    ),
    "friction by name": (
        changed('robot = "planar_2r"', '[robot]\nmodel = "planar_2r"\nfriction = "tanh"'),
        ("'friction' = 'tanh'", "list of terms", '{term = "coulomb", smoothing = "tanh"}'),
    ),
    "friction without a term": (
        changed('robot = "planar_2r"', '[robot]\nmodel = "planar_2r"\nfriction = [{gamma = 3}]'),
        ("'friction.0.term' is missing", "one of 'viscous', 'coulomb'"),
    ),
    "missing gain": (changed("kd = [180, 60]", ""), ("[controller]", "pd controller needs kd")),
    "gain of another law": (changed("kd =", "kv = 3\nkd ="), ("pd controller has no kv", "kp")),
    "unknown law": (changed('"pd"', '"pdd"'), ("key 'type' = 'pdd'", "'cascade'")),
    "gain is text": (changed("[6000, 2500]", '"6000"'), ("key 'kp' = '6000'", "one number")),
    "too many gains": (changed("[6000, 2500]", "[1, 2, 3]"), ("kp has 3 numbers for 2 joints",)),
    "negative gain": (changed("[6000, 2500]", "[-1, 2]"), ("kp of joint 1 is -1",)),
    "NaN": (changed("[6000, 2500]", "nan"), ("key 'kp' = nan",)),
    "bad value": (with_identify("tolerance = 2"), ("key 'tolerance' = 2", "less than 1")),
    "even median": (with_identify("bandpass = {median = 4}"), ("median = 4", "odd")),
    "unknown method": (with_identify('methods = ["livv"]'), ("'livv'", "'iv'")),
    "method twice": (with_identify('methods = ["ls", "ls"]'), ("twice",)),
    "no methods": (with_identify("methods = []"), ("'methods' = []", "ols, ls")),
    "bad mask": (with_identify("mask = 1.5"), ("key 'mask' = 1.5", "rated speed")),
    "unknown parameter": (with_identify('parameters = ["zz1", "vf1"]'), ("'vf1'", "fv1")),
    "unknown start": (with_identify("initial = {zz9 = 1}"), ("'zz9'", "did you mean")),
    "decimation twice": (
        with_identify("bandpass = {decimation = 5, bandwidth = 20}"),
        ("decimation and bandwidth",),
    ),
    "as printed, directly": (
        with_identify('piv = {as_printed = true, prefilter = "direct"}'),
        ("[identify.piv]", "as_printed", "prefilter", "remove"),
    ),
    "as printed, with another noise": (
        with_identify("piv-as-printed = {noise = {p_max = 32, on_unmasked = true}}"),
        ("[identify.piv-as-printed]", "as_printed", "noise.on_unmasked", "remove"),
    ),
    "options of another method": (
        with_identify("ls = {noise = {p_max = 3}}"),
        ("[identify]", "'ls' has no noise", "bandpass"),
    ),
    "signals without use": (
        with_identify("ls = {random_walk = {order = 2}}"),
        ("[identify.ls]", "random_walk", 'signals = "random_walk"'),
    ),
    "window without use": (
        with_identify("iv = {algebraic = {window = 0.1}}"),
        ("[identify.iv]", "algebraic", 'signals = "algebraic"'),
    ),
    "signals of another method": (
        with_identify('iv = {signals = "random_walk"}'),
        ("[identify.iv]", "signals", "'algebraic'", "'iv-full-rate'"),
    ),
    "degree of no use": (
        with_identify('ls = {signals = "algebraic", algebraic = {degree = 11}}'),
        ("degree",),
    ),
    "DIDIM without controller": (
        EXPERIMENT.split("[controller]")[0] + '[identify]\nmethods = ["didim"]\n',
        ("'didim'", "no table [controller]", "iv-full-rate"),
    ),
    "loop without controller": (
        EXPERIMENT.split("[controller]")[0]
        + '[identify]\nmethods = ["piv"]\ninstruments = "loop"\n',
        ("'piv'", "no table [controller]"),
    ),
    "reference not logged": (
        changed(', q_ref = ["r1", "r2"]', "")
        .replace('"ls"', '"iv"')
        .replace('q_ref = "deg", ', ""),
        ("[controller]", "q_ref", 'reference = "reconstruct"', '"smoothed"'),
    ),
    "files and dataset": (changed("files =", 'dataset = "emps"\nfiles ='), ("both are given",)),
    "no source": (changed('files = "log.csv"', ""), ("neither is given",)),
    "dataset with columns": (
        changed('files = "log.csv"', 'dataset = "emps"'),
        ("'emps' brings its own columns, units",),
    ),
    "unknown dataset": (
        'robot = "emps"\n[recording]\ndataset = "emsp"',
        ("[recording] no data set 'emsp'", "'emps'"),
    ),
    "unknown run": (
        'robot = "emps"\n[recording]\ndataset = "emps"\nrun = "pulse"',
        ("no run 'pulse'", "'pulses'"),
    ),
    "empty part": (changed("files =", "part = [3, 1]\nfiles ="), ("part = [3", "empty")),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said_in_one_line(tmp_path, case):
    text, parts = BAD[case]
    line = message(tmp_path, text)
    for part in parts:
        assert part in line, line


def test_a_misspelt_key_is_not_reported_as_missing_too(tmp_path):
    text = changed('robot = "planar_2r"', '[robot]\nurdf = "x.urdf"')
    assert "more)" not in message(tmp_path, text)


def test_several_problems_are_counted(tmp_path):
    text = changed("kp =", "pk =").replace("methods =", "metods =")
    assert "more)" in message(tmp_path, text)


@pytest.mark.parametrize(
    ("name", "part"), [("absent.toml", "No such file"), (".", "directory"), ("big.toml", "bytes")]
)
def test_file_that_cannot_be_read(tmp_path, name, part):
    (tmp_path / "big.toml").write_text("#" * 2_000_000)
    with pytest.raises(ExperimentError, match=part):
        load_experiment(tmp_path / name)


def test_file_that_is_not_text(tmp_path):
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe robot")
    with pytest.raises(ExperimentError, match="UTF-8"):
        load_experiment(tmp_path / "x.toml")


def test_errors_with_evidence_keep_their_class_and_say_where(tmp_path):
    with pytest.raises(UnknownColumn) as caught:
        load(tmp_path, changed('"tau2"', '"tua2"')).problem()
    assert caught.value.near == ("tau2",)
    (where,) = caught.value.__notes__
    assert where.endswith("experiment.toml: [recording]")


def test_absent_dataset_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PIVIDENT_DATA", str(tmp_path / "none"))
    monkeypatch.setattr("pivident.data.recording.datasets._cache", lambda name: tmp_path / "cache")

    def refuse(*args, **kwargs):
        raise ConnectionError("no network")

    monkeypatch.setattr("pooch.retrieve", refuse)
    with pytest.raises(DatasetUnavailable):
        load(tmp_path, 'robot = "emps"\n[recording]\ndataset = "emps"').problem()


def test_every_error_is_a_pivident_error(tmp_path):
    with pytest.raises(PividentError, match="gallery has no robot 'planar_2q'"):
        load(tmp_path, changed("planar_2r", "planar_2q")).problem()
