"""What is held back, and what somebody gets who goes on all the same."""

import json

import pytest

from pivident.app.studio.gate import Gate, before_run, before_use
from pivident.app.studio.projects import Project, ProjectError
from pivident.app.studio.results_list import result_context
from pivident.app.studio.studio import Studio
from pivident.judgement.diagnostics.stored_verdict import said_against
from tests.app.studio.projects import EXPERIMENT
from tests.app.studio.test_results_list import entry

READY = {"findings": "ready", "error": ""}
NO = {"answer": "no", "why": "no machine has these parameters", "evidence": {}}
YES = {"answer": "yes", "why": "", "evidence": {}}
FOR_SIMULATION = "The verdict rejects it for simulation: no machine has these parameters."


@pytest.fixture
def project(tmp_path):
    folder = tmp_path / "arm"
    for step in ("001-identify", "002-consistent"):
        (folder / "results" / step).mkdir(parents=True)
    (folder / "results" / "001-identify" / "identification.json").write_text("{}")
    (folder / "results" / "002-consistent" / "consistent.json").write_text("{}")
    account = {"arguments": {"result": "results/001-identify"}}
    (folder / "results" / "002-consistent" / "run.json").write_text(json.dumps(account))
    (folder / "experiment.toml").write_text(EXPERIMENT)
    return folder


def judge(project, torque, simulation, **more):
    verdict = {"name": "ls", "headline": "…", "severity": "warning", "statements": []}
    verdict |= {"uses": {"torque": torque, "simulation": simulation}} | more
    (project / "results" / "001-identify" / "verdict.json").write_text(json.dumps(verdict))


def test_nobody_can_go_on_where_a_run_would_stop():
    error = {"severity": "error", "message": "The torque has the other sign."}
    for check in ({"error": "no TOML"}, {"refused": True, "remarks": [error]}):
        gate = before_run(True, READY, check)
        assert gate.reason and not gate.against
    for look in ({"findings": "running"}, {"findings": "failed", "error": "no memory"}):
        assert before_run(True, look, {}).reason and not before_run(True, look, {}).against
    assert before_run(False, READY, {}).reason
    misled = before_run(True, READY, {"refused": False, "remarks": [error]})
    assert "mislead" in misled.reason and misled.against == (error["message"],)
    assert before_run(True, READY, {"remarks": [error | {"severity": "warning"}]}) == Gate()


def test_only_a_rejected_use_is_held_back(project):
    def held_back(step, **arguments):
        return before_use(project, step, {"result": "results/001-identify"} | arguments).against

    assert held_back("export", to="urdf") == ()  # there is no verdict
    judge(project, YES, NO)
    assert held_back("export", to="urdf") == held_back("consistent") == (FOR_SIMULATION,)
    assert held_back("export", to="c") == held_back("compare") == ()
    derived = "results/002-consistent"
    assert held_back("export", result=derived, to="mjcf") == (FOR_SIMULATION,)
    assert held_back("export", result="results/007-identify", to="mjcf") == ()
    judge(project, NO, YES)
    (reason,) = held_back("export", to="c")
    assert reason.startswith("The verdict rejects it for torque prediction:")


def test_who_knows_it_goes_on_and_the_result_remembers_it(project):
    judge(project, YES, NO)
    (run,) = result_context(
        Project(project, "arm"), [entry("001", "identify") | {"methods": ["ls"]}], "", {}, {}, ()
    )["runs"]
    assert run["held_back_by"] == [FOR_SIMULATION]
    assert {o["step"] for o in run["held_back"]} == {"consistent", "export"}
    assert not {o["step"] for o in run["offered"]} & {"consistent", "export"}
    studio, ours = Studio(project.parent), Project(project, "arm")
    asked = {"result": "results/001-identify", "to": "urdf"}
    try:
        with pytest.raises(ProjectError, match="rejects it for simulation"):
            studio.run(ours, "export", asked)
        studio.run(ours, "export", asked, go_on=True)
        assert studio.runs.listed(project)[0]["in_spite_of"] == [FOR_SIMULATION]
    finally:
        studio.close()


def test_what_a_file_made_of_a_result_has_to_say(project):
    folder = project / "results" / "001-identify"
    assert said_against(folder) == ()
    judge(project, YES, NO, in_spite_of=["The torque has the other sign."])
    expected = ("Identified in spite of this: The torque has the other sign.", FOR_SIMULATION)
    assert said_against(folder) == said_against(folder / "piv") == expected
