"""Steps: what they put on the command line, what they refuse, and what a run suggests next."""

import json
import shlex

import pytest

from pivident.app.cli.app import app
from pivident.app.studio.offers import offered
from pivident.app.studio.step_arguments import StepError
from pivident.app.studio.steps import CAUSES, STEPS, step_named
from pivident.models.export.formats import FORMATS
from tests.app.studio.projects import EXPERIMENT

OUT = "results/009-x"

#: A full form for each step.
FULL = {
    "identify": {"method": ["ls", "pc-piv"], "folds": 3, "free": "delay,gear-ratio"},
    "compare": {"results": ["001-identify", "002-identify/piv"], "level": "0.01"},
    "consistent": {"result": "results/001-identify", "prior": "none", "accept_far": "on"},
    "export": {"result": "001-identify", "to": "mjcf", "free": True},
    "friction": {"method": "piv", "standstill": 0.02, "ripple": True},
    "laws": {"method": "ls", "blocks": "5", "band": 12.5, "depth": 2},
    "predict": {"result": "001-identify", "log": "test_logs/other.csv"},
    "payload": {"arm": "001-identify", "method": "piv"},
    "gains": {"in_log_units": True, "least_squares": False},
    "excite": {
        "result": "001-identify", "duration": 30, "motion": "fourier", "criterion": "d",
        "parameters": ["zz1r", "my2"], "to": 2.5, "rate": 500, "seconds": 10, "seed": 3,
    },
}  # fmt: skip


@pytest.fixture
def project(tmp_path):
    folder = tmp_path / "p"
    for name in ("001-identify", "002-identify/piv"):
        (folder / "results" / name).mkdir(parents=True)
        (folder / "results" / name / "identification.json").write_text("{}")
    (folder / "results" / "002-identify" / "verdict.json").write_text("{}")
    (folder / "results" / "003-laws").mkdir()
    (folder / "experiment.toml").write_text(EXPERIMENT)
    (folder / "test_logs").mkdir()
    for name in ("test_logs/other.csv", "-x.csv"):
        (folder / name).write_text("t\n")
    return folder


@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("full", [False, True])
def test_the_command_line_understands_every_step(project, name, full, monkeypatch):
    """Not run, but parsed by the command line itself."""
    needed = {a.name: FULL[name][a.name] for a in STEPS[name].arguments if a.is_needed}
    given = FULL[name] if full else needed
    argv = STEPS[name].command(project, given, OUT)
    monkeypatch.chdir(project)
    command, bound, _ = app.parse_args(argv, exit_on_error=False, print_error=False)
    assert command.__name__ == name
    options = sum(token.startswith("--") for token in argv)
    said = len(bound.arguments) - len(bound.args)
    assert said == options if name != "compare" else said <= options


def test_what_is_written_on_the_command_line(project):
    found = STEPS["excite"].command(project, FULL["excite"], OUT)
    assert shlex.join(found) == (
        "excite results/001-identify --duration 30 --motion fourier --criterion d --for zz1r,my2 "
        "--to 2.5% --rate 500 --seconds 10 --seed 3 --out results/009-x"
    )
    assert STEPS["excite"].command(project, {}, OUT)[1] == "experiment.toml"
    assert STEPS["payload"].command(project, FULL["payload"], OUT)[1:3] == [
        "results/001-identify", "experiment.toml",
    ]  # fmt: skip
    assert STEPS["export"].command(project, FULL["export"], OUT)[-1] == f"{OUT}/robot_estimate.xml"
    shown = STEPS["export"].command(project, {"result": "001-identify", "to": "rrd"}, OUT)
    assert shown[4:6] == ["--log", "experiment.toml"] and shown[-1] == f"{OUT}/robot_motion.rrd"
    assert STEPS["laws"].command(project, {}, OUT)[-2:] == ["--out", f"{OUT}/laws.toml"]
    tested = {"result": "001-identify", "log": "-x.csv"}
    assert STEPS["predict"].command(project, tested, OUT)[2] == "./-x.csv"  # no option


@pytest.mark.parametrize("to", [*FORMATS, "rrd"])
def test_every_format_is_written_into_a_file_with_its_ending(project, to):
    other, result = {"mjcf": "xml", "numpy": "py", "latex": "tex"}, "001-identify"
    for free, name in ((False, "robot_consistent"), (True, "robot_estimate")):
        found = STEPS["export"].command(project, {"result": result, "to": to, "free": free}, OUT)
        name = "robot_motion" if to == "rrd" else name
        assert found[-1] == f"{OUT}/{name}.{other.get(to, to)}"


def test_causes_are_those_of_the_command():
    from pivident.app.cli.identify import identify

    help_text = " ".join((identify.__doc__ or "").split())
    assert f"each with an interval: {', '.join(CAUSES)};" in help_text


HOSTILE = [
    "--out=/etc", "-x", "../..", "/etc/passwd", "results/../../x", "001-identify/../..", "a\nb",
    "ls --out /", "$(id)", "\x1b[1m", "x" * 10_000, "ls;", {"a": 1}, 1e400, float("nan"), -1,
]  # fmt: skip


@pytest.mark.parametrize("value", HOSTILE, ids=lambda value: str(value)[:20])
def test_no_value_reaches_the_command_line_that_is_not_on_a_list(project, value):
    for step in STEPS.values():
        for argument in step.arguments:
            with pytest.raises(StepError):
                step.command(project, {**_needed(step), argument.name: value}, OUT)
            if argument.kind in ("choices", "results", "names"):
                with pytest.raises(StepError):
                    step.command(project, {**_needed(step), argument.name: [value]}, OUT)


def _needed(step) -> dict:
    full = FULL[step.name]
    return {a.name: full[a.name] for a in step.arguments if a.is_needed}


@pytest.mark.parametrize(
    ("step", "arguments", "part"),
    [
        ("identify", {"method": "livv"}, "choose from"),
        ("identify", {"folds": 1}, "Held-out blocks"),
        ("identify", {"folds": 1.5}, "Held-out blocks"),
        ("identify", {"out": "/"}, "takes no 'out'"),
        ("export", {"to": "urdf"}, "Result is missing"),
        ("export", {"result": "003-laws", "to": "urdf"}, "no result of this project"),
        ("export", {"result": "002-identify/ls", "to": "urdf"}, "no result of this project"),
        ("compare", {"results": []}, "missing"),
        ("compare", {"results": ["001-identify"] * 41}, "at most"),
        ("laws", {"blocks": 2.5}, "whole number"),
        ("excite", {"duration": "long"}, "no number"),
        ("excite", {"duration": 1e9}, "between"),
        ("gains", {"least_squares": "maybe"}, "yes nor no"),
    ],
)
def test_refusals_say_what_would_do(project, step, arguments, part):
    with pytest.raises(StepError, match=part):
        STEPS[step].command(project, arguments, OUT)


def test_a_result_that_is_a_link_to_elsewhere_is_none(project, tmp_path):
    (tmp_path / "other" / "x").mkdir(parents=True)
    (tmp_path / "other" / "identification.json").write_text("{}")
    (project / "results" / "004-identify").symlink_to(tmp_path / "other")
    with pytest.raises(StepError, match="no result of this project"):
        STEPS["export"].command(project, {"result": "004-identify", "to": "c"}, OUT)


def test_an_experiment_is_needed_only_where_it_is_read(project):
    (project / "experiment.toml").unlink()
    assert STEPS["consistent"].command(project, {"result": "001-identify"}, OUT)
    with pytest.raises(StepError, match=r"has no experiment\.toml yet"):
        STEPS["identify"].command(project, {}, OUT)
    with pytest.raises(StepError, match="there is no step"):
        step_named("rm")


def statement(topic, kind, severity="warning", message="Because."):
    return {"topic": topic, "kind": kind, "severity": severity, "message": message}


def write_verdict(project, folder, severity="warning", statements=(), name="ls", open_=()):
    content = {"name": name, "severity": severity, "statements": statements, "open": list(open_)}
    (project / "results" / folder / "verdict.json").write_text(json.dumps(content))


def offers(project, folder, step="identify"):
    found = offered(project, {"step": step, "results": f"results/{folder}"})
    for offer in found:  # each can be added as it is
        STEPS[offer["step"]].command(project, offer["arguments"], OUT)
        assert offer["words"] and offer["reason"]
    return found


def test_the_verdict_asks_for_instruments_first(project):
    write_verdict(project, "001-identify", statements=[statement("feedback", "no instruments")])
    first, *others = offers(project, "001-identify")
    assert first["step"] == "identify" and first["reason"] == "Because."
    assert first["arguments"] == {"method": ["ls", "iv-full-rate"]}
    assert [offer["step"] for offer in others] == ["consistent"]
    (project / "experiment.toml").write_text(EXPERIMENT + "[controller]\ntype = 'virtual_pd'\n")
    first, *_ = offers(project, "001-identify")
    assert first["arguments"]["method"] == ["ls", "iv-full-rate", "piv"]


def test_loads_and_gains_are_offered_where_the_file_describes_them(project):
    write_verdict(project, "001-identify")
    assert not {"payload", "gains"} & {o["step"] for o in offers(project, "001-identify")}
    text = EXPERIMENT + "[[payload.recording]]\nfiles = 'loaded.csv'\n[gains]\n"
    (project / "experiment.toml").write_text(text)
    assert {"payload", "gains"} <= {o["step"] for o in offers(project, "001-identify")}


def test_causes_friction_and_motion_follow_from_statements(project):
    said = [
        statement("model", "gear ratio"),
        statement("model", "delay", "note"),
        statement("model", "friction"),
        statement("motion", "wanted", "note", "Move more."),
        statement("prediction", "nothing held out"),
    ]
    write_verdict(project, "001-identify", "error", said, open_=["zz1r"])
    found = offers(project, "001-identify")
    assert [offer["step"] for offer in found] == [
        "identify", "identify", "laws", "friction", "excite",
    ]  # fmt: skip
    assert found[0]["arguments"] == {"method": ["ls"], "folds": 5}
    assert found[1]["arguments"] == {"method": ["ls"], "free": ["gear-ratio"]}
    assert found[4]["arguments"]["parameters"] == ["zz1r"] and found[4]["reason"] == "Move more."


def test_a_motion_for_many_parameters_is_one_for_all(project):
    write_verdict(project, "001-identify", open_=[f"zz{k}r" for k in range(20)])
    (motion,) = (o for o in offers(project, "001-identify") if o["step"] == "excite")
    assert "parameters" not in motion["arguments"]


@pytest.mark.parametrize(
    ("answer", "why", "first", "steps"),
    [
        ("care", "take the consistent set (fit error 5.1 → 5.5 %)", "Make the consistent set",
         ["consistent", "laws", "friction"]),
        ("yes", "", "Choose friction laws", ["laws", "friction", *["export"] * 3]),
        ("no", "no machine has these parameters", "Choose friction laws",
         ["laws", "friction", "consistent"]),
    ],
)  # fmt: skip
def test_the_consistent_set_is_offered_where_the_verdict_needs_it(
    project, answer, why, first, steps
):
    path = project / "results" / "001-identify" / "verdict.json"
    content = {"name": "ls", "statements": [statement("model", "friction")]}
    path.write_text(json.dumps(content | {"uses": {"simulation": {"answer": answer, "why": why}}}))
    found = [o for o in offers(project, "001-identify") if o["step"] != "compare"]
    assert found[0]["words"] == first and [o["step"] for o in found] == steps
    reasons = [o["reason"] for o in found if o["step"] == "consistent"]
    assert reasons == ([f"For simulation: {why}."] if why else [])


def test_consistent_parameters_are_exported(project):
    (project / "results" / "002-identify" / "piv" / "consistent.json").write_text("{}")
    (project / "results" / "002-identify" / "ls").mkdir()
    (project / "results" / "002-identify" / "ls" / "identification.json").write_text("{}")
    write_verdict(project, "002-identify", "ok", name="piv")
    found = offers(project, "002-identify")
    assert [o["step"] for o in found] == ["export"] * 3 + ["compare"] * 2
    assert found[0]["arguments"] == {"result": "results/002-identify/piv", "to": "urdf"}
    assert found[3]["arguments"]["results"] == ["results/001-identify", "results/002-identify"]
    assert found[4]["arguments"]["results"] == ["results/002-identify"]


def test_consistent_parameters_alone_are_named_by_their_file(project):
    folder = project / "results" / "003-consistent"
    folder.mkdir()
    (folder / "consistent.json").write_text("{}")
    first, *_ = offers(project, "003-consistent", "consistent")
    argv = STEPS["export"].command(project, first["arguments"], OUT)
    assert argv[1] == "results/003-consistent/consistent.json"


def test_runs_without_results_offer_nothing(project):
    assert offered(project, {"step": "identify", "results": ""}) == []
    assert offers(project, "003-laws", "laws") == []
    assert [o["step"] for o in offers(project, "003-laws", "friction")] == ["laws"]
