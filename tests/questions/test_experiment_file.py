# ruff: noqa: E501  (one case, one line)
"""Mistakes in the experiment file: tables, keys, values, options that contradict each other."""

import pytest

from tests.questions.conftest import answered
from tests.questions.material import Case, csv, log, replaced, short_log, with_table

COLUMNS = 'columns = {t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["tau1", "tau2"]}'
CONTROLLER = 'type = "pd"\nkp = [6000, 2500]\nkd = [180, 60]\n'
NO_REFERENCE = (', q_ref = ["r1", "r2"]', "")


def said(question: str, *answer: str, text: str, **more) -> Case:
    return Case(question, answer, text=text, **more)


def swap(question: str, old: str, new: str, *answer: str, **more) -> Case:
    return said(question, *answer, text=replaced((old, new)), **more)


def add(question: str, lines: str, *answer: str, **more) -> Case:
    return said(question, *answer, text=with_table(lines), **more)


CASES = [
    # tables and keys
    swap("a table is misspelt", "[controller]", "[contoller]", "line 7", "unknown table 'contoller'", "'controller'"),
    swap("a table is in the plural", "[recording]", "[recordings]", "line 3", "'recordings'", "did you mean 'recording'"),
    swap("a key is misspelt", "kp =", "pk =", "line 9", "[controller] pk", "did you mean 'kp'"),
    swap("a key is in capitals", "kd =", "Kd =", "line 10", "'Kd'", "'kd'"),
    swap("a channel is misspelt", "tau = [", "tua = [", "line 5", "'columns.tua'", "'tau'"),
    swap("torque is written out", "tau = [", "torque = [", "line 5", "'columns.torque'", "'tau'"),
    swap("the log is called path", "files =", "path =", "line 4", "'path'", "did you mean 'files'"),
    swap("the log is called csv", "files =", "csv =", "line 4", "'csv'", "'files'"),
    swap("the methods are called method", "methods =", "method =", "line 13", "'method'", "'methods'"),
    swap("the robot table names a urdf key", 'robot = "planar_2r"', 'robot = {urdf = "arm.urdf"}', "line 1", "'urdf'", "did you mean 'model'"),
    swap("there is no robot", 'robot = "planar_2r"\n', "", "there is no robot", "[robot]"),
    said("there is no recording", "There is no recording", "[recording]", text='robot = "planar_2r"\n'),
    swap("there are no columns", COLUMNS, "", "[recording]", "files need columns", "q and tau"),
    swap("no columns are named for the torque", ', tau = ["tau1", "tau2"]', "", "line 5", "'tau1', 'tau2' read like torques", "a measured torque tells the scale", code=0),
    said("the log has no torque and the law is not known", "line 5", "no tau", "no control law", "under [controller]", text=replaced((', tau = ["tau1", "tau2"]', ""), ("[controller]\n" + CONTROLLER, ""))),
    said("the log has no torque and the law is to be identified", "[controller] type", "cannot be found without a torque", text=replaced((', tau = ["tau1", "tau2"]', ""), (CONTROLLER, 'type = "identify"\n'))),
    said("the log has no torque and no reference", "line 5", "no q_ref that the control law would follow", text=replaced((', q_ref = ["r1", "r2"], tau = ["tau1", "tau2"]', ""))),
    said("a method compares torques that were not logged", "[identify] methods", "'didim' needs measured torques", text=replaced((', tau = ["tau1", "tau2"]', ""), ('methods = ["ls"]', 'methods = ["didim"]'))),
    swap("the drive gain is unknown beside a torque", "kp =", 'drive_gain = "unknown"\nkp =', "line 9", "for logs without torque", 'type = "identify"'),
    swap("no columns are named for the position", 'q = ["q1", "q2"], ', "", "line 5", "'columns.q'", "missing"),
    swap("there is no file", 'files = "log.csv"', "", "neither is given", "files or a dataset"),
    swap("file and dataset are both given", "files =", 'dataset = "emps"\nfiles =', "both are given", "dataset"),
    add("a table appears twice in the file", '[identify]\nmethods = ["iv"]', "not TOML", "identify"),
    swap("a key appears twice in a table", "kp = [6000, 2500]", "kp = [6000, 2500]\nkp = 3", "not TOML", "line 10"),
    swap("a text has no quotes", 'files = "log.csv"', "files = log.csv", "not TOML", "line 4"),
    swap("a list is not closed", '"tau2"]}', '"tau2"', "not TOML", "line"),
    swap("an inline table spans several lines", 'columns = {t = "time", ', 'columns = {t = "time",\n  ', "not TOML", "line 5"),
    swap("a Windows path has backslashes", '"log.csv"', '"C:\\Users\\log.csv"', "not TOML", "line 4", "backslash"),
    swap("gains have decimal commas", "kd = [180, 60]", "kd = [180,5, 60,0]", "line 10", "kd", "4 numbers for 2 joints"),
    said("the file is JSON", "JSON", "TOML", text='{"robot": "planar_2r"}'),
    said("the file is a URDF", "robot description", "robot =", text="<robot name='arm'/>"),
    said("the file is empty", "There is no robot", text=""),
    said("the robot file is given for the experiment", "robot description", "robot =", text='name = "arm"\n[[joints]]\nname = "shoulder"\n'),
    said("the file is saved as UTF-16", "UTF-8", text="", files={"experiment.toml": "robot = 'a'".encode("utf-16")}),
    # values of the wrong kind
    swap("a gain is text", "[6000, 2500]", '"6000"', "line 9", "'kp'", "must be a number"),
    swap("a gain is missing for a joint", "[6000, 2500]", "[6000]", "line 9", "kp", "1 number for 2 joints"),
    swap("there is one gain too many", "[180, 60]", "[180, 60, 5]", "line 10", "kd", "3 numbers for 2 joints"),
    swap("a gain is negative", "[6000, 2500]", "[-6000, 2500]", "line", "kp of joint 1 is -6000", "not negative"),
    swap("a gain is not a number", "[6000, 2500]", "nan", "line 9", "'kp'", "nan"),
    swap("a flag is text", 'files = "log.csv"', 'files = "log.csv"\nresample = "perhaps"', "line 5", "'resample'", "boolean"),
    swap("the rate is text", 'files = "log.csv"', 'files = "log.csv"\nrate = "1 kHz"', "line 5", "'rate'", "number"),
    swap("the rate is zero", 'files = "log.csv"', 'files = "log.csv"\nrate = 0', "line 5", "'rate'", "greater than 0"),
    swap("the rate is negative", 'files = "log.csv"', 'files = "log.csv"\nrate = -1000', "line 5", "'rate'", "greater than 0"),
    swap("the methods are not a list", 'methods = ["ls"]', "methods = 3", "line 13", "'methods'", "must be a list"),
    swap("the list of methods is empty", 'methods = ["ls"]', "methods = []", "line 13", "'methods'", "ols, ls"),
    swap("a column is a number", '"tau2"', "7", "columns of tau", "a name or a list of names is needed"),
    swap("the recording is a text", '[recording]\nfiles = "log.csv"\n' + COLUMNS, 'recording = "log.csv"', "recording", "must be"),
    # methods, parameters, options
    swap("a method of the file is misspelt", '["ls"]', '["pvi"]', "line 13", "no method 'pvi'", "'piv'"),
    swap("a method has another name elsewhere", '["ls"]', '["idim-piv"]', "line 13", "no method 'idim-piv'", "'piv'"),
    swap("a method is named twice", '["ls"]', '["ls", "ls"]', "line 13", "twice"),
    said("a method needs a loop and there is no controller", "'didim'", "no table [controller]", "iv-full-rate", text=replaced(('["ls"]', '["didim"]'), (f"[controller]\n{CONTROLLER}", ""))),
    said("a consistent method needs a loop and there is no controller", "'didim'", "no table [controller]", text=replaced(('["ls"]', '["pc-didim"]'), (f"[controller]\n{CONTROLLER}", ""))),
    said("a cascade has no reference in the log", "no column is named for q_ref", "reconstruct", text=replaced(NO_REFERENCE, (CONTROLLER, 'type = "cascade"\nkp = 20\nkv = [180, 60]\n'), ('["ls"]', '["iv"]'))),
    said("IV has no reference in the log", "no column is named for q_ref", '"reconstruct"', '"smoothed"', text=replaced(NO_REFERENCE, ('["ls"]', '["iv"]'))),
    said("the law is to be identified without a reference", "q_ref", "[controller]", text=replaced(NO_REFERENCE, (CONTROLLER, 'type = "identify"\n'), ('["ls"]', '["iv"]'))),
    swap("a parameter does not exist", 'methods = ["ls"]', 'methods = ["ls"]\nparameters = ["zz1", "vf1"]', "line 14", "no base parameter 'vf1'", "fv1"),
    swap("a parameter is in capitals", 'methods = ["ls"]', 'methods = ["ls"]\nparameters = ["ZZ1", "FZ1"]', "line 14", "no base parameter 'FZ1'"),
    swap("a parameter was regrouped away", 'methods = ["ls"]', 'methods = ["ls"]\nparameters = ["zz1", "m1"]', "line 14", "no base parameter 'm1'"),
    swap("a parameter is asked for twice", 'methods = ["ls"]', 'methods = ["ls"]\nparameters = ["zz1", "zz1r"]', "line 14", "twice", "'zz1'"),
    swap("the list of parameters is empty", 'methods = ["ls"]', 'methods = ["ls"]\nparameters = []', "line 14", "'parameters'", "at least 1"),
    swap("a starting value belongs to no parameter", 'methods = ["ls"]', 'methods = ["ls"]\ninitial = {zz9 = 1}', "line 14", "no base parameter 'zz9'"),
    swap("essential parameters are given as names", 'methods = ["ls"]', 'methods = ["ls"]\nessential = ["zz1"]', "line 14", "'essential'", "boolean", "parameters"),
    swap("the mask is in per cent", 'methods = ["ls"]', 'methods = ["ls"]\nmask = 5', "line 14", "'mask'", "share of the rated speed"),
    swap("a tolerance is in per cent", 'methods = ["ls"]', 'methods = ["ls"]\ntolerance = 2.5', "line 14", "'tolerance'", "less than 1"),
    swap("a method is given options of another one", 'methods = ["ls"]', 'methods = ["ls"]\nls = {noise = {p_max = 3}}', "line 14", "'ls' has no noise"),
    swap("decimation and bandwidth are both given", 'methods = ["ls"]', 'methods = ["ls"]\nbandpass = {decimation = 5, bandwidth = 20}', "line 14", "decimation and bandwidth"),
    swap("the median filter has an even length", 'methods = ["ls"]', 'methods = ["ls"]\nbandpass = {median = 4}', "line 14", "median = 4", "odd"),
    swap("as printed, and yet with another prefilter", 'methods = ["ls"]', 'methods = ["ls"]\npiv = {as_printed = true, prefilter = "direct"}', "line 14", "as_printed", "prefilter"),
    swap("the cutoff lies beyond half the rate", 'methods = ["ls"]', 'methods = ["ls"]\nbandpass = {cutoff = 800}', "line 14", "cutoff", "800", "500 Hz"),
    swap("the number of iterations is zero", 'methods = ["ls"]', 'methods = ["ls"]\nmax_iterations = 0', "line 14", "'max_iterations'", "greater than or equal to 1"),
    swap("shapes have an unknown value", 'methods = ["ls"]', 'methods = ["ls"]\nshapes = "find"', "line 14", "'shapes'", "'identify'"),
    # controller
    swap("the law has an unknown type", '"pd"', '"pdd"', "line 8", "'type'", "'pdd'", "'cascade'"),
    swap("the law is in capitals", '"pd"', '"PD"', "line 8", "'type'", "'PD'", "'pd'"),
    swap("the law has no type", 'type = "pd"\n', "", "line 7", "'type'", "missing", "'pd'"),
    swap("a PD law has no kd", "kd = [180, 60]\n", "", "[controller]", "needs kd"),
    swap("a cascade is given kd in place of kv", 'type = "pd"', 'type = "cascade"', "[controller]", "cascade controller needs kv"),
    swap("a PD law gets an integrator", "kd = [180, 60]", "kd = [180, 60]\nki = 5", "[controller]", "pd controller has no ki"),
    said("a virtual law gets gains", "virtual_pd controller has no kd, kp", text=replaced(('"pd"', '"virtual_pd"'))),
    said("an identified law gets gains", "identify controller has no kd, kp", text=replaced(('"pd"', '"identify"'))),
    swap("the reference has an unknown source", "kd =", 'reference = "logged"\nkd =', "line 10", "'reference'", "'recorded'"),
    said("a law is to be identified from a smoothed reference", "cannot be identified", "smoothed", text=replaced((CONTROLLER, 'type = "identify"\nreference = "smoothed"\n'))),
    swap("the limit has a value for one joint of two", "kd =", "limit = [100]\nkd =", "line 10", "limit", "1 number for 2 joints"),
    swap("the limit lies below the torques of the log", "kd =", "limit = 10\nkd =", "line 10", "limit", "shoulder", "N m", log=log(), code=4),
    swap("feed-forward has an unknown kind", "kd =", 'feed_forward = "full"\nkd =', "line 10", "'feed_forward'", "'computed_torque'"),
    # robot
    swap("the robot is misspelt", "planar_2r", "planar_2q", "line 1", "no robot 'planar_2q'", "'planar_2r'"),
    swap("the robot is named by its maker", '"planar_2r"', '"Stäubli TX-40"', "line 1", "neither a gallery name nor a robot file", "staubli_tx40"),
    swap("the robot file does not exist", "planar_2r", "arms/arm.urdf", "line 1", "arm.urdf", "No such file"),
    swap("the robot file is a mesh", "planar_2r", "arm.stl", "line 1", "arm.stl", ".urdf"),
    swap("the robot file is an unprocessed xacro", "planar_2r", "arm.urdf.xacro", "line 1", "xacro", ".urdf"),
    swap("the log is named as the robot", '"planar_2r"', '"log.csv"', "line 1", "log.csv", "neither a gallery name nor a robot file"),
    swap("gravity is in units of g", '"planar_2r"', '{model = "planar_2r", gravity = [0, -1, 0]}', "line 1", "1 m/s²", "units of g", code=4),
    swap("gravity is one number", '"planar_2r"', '{model = "planar_2r", gravity = -9.81}', "line 1", "gravity", "three numbers"),
    swap("gravity is a direction without a sign", '"planar_2r"', '{model = "planar_2r", gravity = "down"}', "line 1", "gravity", "-z"),
    swap("a frozen joint still has columns", '"planar_2r"', '{model = "planar_2r", frozen = {elbow = 0}}', "q lists 2 column(s) for 1 joint(s) (shoulder)"),
    swap("a friction term does not exist", '"planar_2r"', '{model = "planar_2r", friction = ["viscos", "coulomb"]}', "line 1", "viscos", "'viscous'"),
    swap("friction is one word", '"planar_2r"', '{model = "planar_2r", friction = "coulomb"}', "line 1", "friction", "list of terms"),
    swap("a friction term appears twice", '"planar_2r"', '{model = "planar_2r", friction = ["viscous", "viscous"]}', "line 1", "twice", "fv"),
    swap("a friction term lacks its speed", '"planar_2r"', '{model = "planar_2r", friction = ["viscous", {term = "stribeck"}]}', "line 1", "stribeck", "speed"),
    swap("a joint of the friction law does not exist", '"planar_2r"', '{model = "planar_2r", extra_friction = {wrist = ["load"]}}', "line 1", "no joint 'wrist'", "shoulder"),
    swap("the number of gear ratios is wrong", '"planar_2r"', '{model = "planar_2r", reduction = [50, 50, 30]}', "line 1", "reduction", "2"),
    swap("a gear ratio is zero", '"planar_2r"', '{model = "planar_2r", reduction = [50, 0]}', "line 1", "reduction", "elbow"),
    swap("a drive gain names a joint that does not exist", '"planar_2r"', '{model = "planar_2r", drive_gain = {joint7 = 3}}', "line 1", "joint7"),
    swap("a rotor inertia is negative", '"planar_2r"', '{model = "planar_2r", rotor_inertia = [-0.1, 0.1]}', "line 1", "rotor_inertia", "negative"),
    # windows and recordings
    swap("the window is reversed", "files =", "part = [2, 1]\nfiles =", "line 4", "part", "empty"),
    swap("the window lies outside the record", "files =", "part = [20, 30]\nfiles =", "line 4", "no sample", "20 and 30 s"),
    swap("the window is in samples", "files =", "part = [1000, 9000]\nfiles =", "line 4", "1000 and 9000 s", "runs from 0"),
    swap("the window has one end", "files =", "part = [1]\nfiles =", "line 4", "'part'", "2 items"),
    swap("the window is before the start", "files =", "part = [-5, -1]\nfiles =", "line 4", "no sample", "-5 and -1 s"),
    add("the fitted log is held out", '[[validation.recording]]\nfiles = "log.csv"\n' + COLUMNS, "line 15", "[validation] recording", "same motion", "[[recording]] 1", code=4),
    add("the held-out log is a copy of the fitted one", '[[validation.recording]]\nfiles = "copy.csv"\n' + COLUMNS, "same motion", "copy.csv", files={"copy.csv": csv(short_log())}, code=4),
    said("one log is listed twice", "[[recording]] 2", "same motion", "counts twice", text=replaced(("[recording]", "[[recording]]")) + '[[recording]]\nfiles = "log.csv"\n' + COLUMNS + "\n", code=4),
    add("one block is held out of one", "[validation]\nfolds = 1", "line 15", "folds = 1", "nothing to fit"),
    add("the folds are negative", "[validation]\nfolds = -3", "line 15", "'folds'", "greater than or equal to 0"),
    swap("no file fits a pattern", '"log.csv"', '"runs/*.csv"', "line 4", "no file fits", "runs/*.csv"),
    swap("the log does not exist", '"log.csv"', '"logs.csv"', "line 4", "logs.csv", "No such file"),
    swap("the log is named relative to another folder", '"log.csv"', '"data/log.csv"', "line 4", "data/log.csv", "No such file"),
    swap("the log is a folder", '"log.csv"', '"runs"', "line 4", "runs", "folder", files={"runs/log.csv": "q1"}),
    swap("the data set does not exist", 'files = "log.csv"\n' + COLUMNS, 'dataset = "tx60"', "line 4", "no data set 'tx60'", "staubli_tx40"),
    swap("the run of a data set does not exist", 'files = "log.csv"\n' + COLUMNS, 'dataset = "emps"\nrun = "third"', "no run 'third'", "'estimation'"),
    swap("a data set gets columns", 'files = "log.csv"', 'dataset = "emps"', "'emps' brings its own columns"),
    swap("the delay is in milliseconds", "files =", "drive_delay = 0.3\nfiles =", "line 4", "drive_delay", "0.3 s", "in seconds"),
    swap("the control rate is a period", "files =", "control_rate = 0.001\nfiles =", "line 4", "control_rate", "Hz", "period", code=4),
    swap("the torque timing is misspelt", "files =", 'torque_timing = "hold"\nfiles =', "line 4", "'torque_timing'", "'held'"),
    swap("the side is misspelt", "files =", 'side = "motors"\nfiles =', "line 4", "side", "'motors'", "joint or motor"),
    swap("saturation has an unknown value", "files =", 'saturation = "ignore"\nfiles =', "line 4", "'saturation'", "'allow'"),
    swap("the position offset is for another arm", "files =", "position_offset = [0, 0, 0]\nfiles =", "line 4", "position_offset", "2 joint(s)"),
    # output, payload, consistency, gains
    add("the folder of the results lies elsewhere", '[output]\nfolder = "../results"', "line 15", "beside or below", "--out"),
    add("the folder of the results is a file of that name", '[output]\nfolder = "log.csv"', "line 15", "log.csv is a file", "--out"),
    add("the load hangs on a joint that does not exist", '[payload]\nlink = "wrist"\n[[payload.recording]]\nfiles = "log.csv"\n' + COLUMNS, "line 15", "wrist", "shoulder"),
    add("the record with the load is that without it", '[[payload.recording]]\nfiles = "log.csv"\n' + COLUMNS, "same motion", "with the load", code=4),
    add("the load has a negative mass", '[payload]\nmass = -1\n[[payload.recording]]\nfiles = "log.csv"\n' + COLUMNS, "line 15", "'mass'", "greater than 0"),
    add("the load has an inertia of three numbers", '[payload]\ninertia = [1, 1, 1]\n[[payload.recording]]\nfiles = "log.csv"\n' + COLUMNS, "line 15", "'inertia'", "6 items"),
    add("bounds are given for a link that does not exist", "[consistency.bounds.hand]\nmass = [0, 1]", "hand", "upper_arm", "[consistency]"),
    add("the bounds of a mass are reversed", "[consistency.bounds.forearm]\nmass = [3, 1]", "line 15", "mass", "lower end comes first"),
    add("a mass may be negative", "[consistency.bounds.forearm]\nmass = [-1, 1]", "line 15", "mass", "below zero"),
    add("bounds bound nothing", "[consistency.bounds.forearm]", "bounds nothing", "mass"),
    add("a prior does not exist", '[consistency]\nprior = "entropy"', "line 15", "'prior'", "'entropic'"),
    add("drive gains have a payload and no record with it", "[gains.payload]\nmass = 2", "payload and [[gains.recording]]", "belong together"),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.question)
def test_the_answer_names_cause_and_place(ask, case):
    code, lines = ask(case)
    assert answered(lines, case.answer), "\n".join(lines)
    assert code == case.code, "\n".join(lines)
