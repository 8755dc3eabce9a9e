"""A bag whose controller tells its reference in a topic of its own: from `init` to a result."""

import tomllib

import pytest

from pivident.app.cli.app import main
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.check.audit_file import audit_file
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.errors import RecordingError
from tests.experiment.init.jittery_bag import CONTROLLER, STATES, jittery_bag

REFERENCE = "/arm_controller/controller_state/reference/positions"


@pytest.fixture(scope="module")
def drafted(tmp_path_factory):
    """A folder with a bag and the experiment file that `init` writes for it."""
    folder = tmp_path_factory.mktemp("bag")
    bag, out = jittery_bag(folder), folder / "experiment.toml"
    assert main(["init", str(bag), "--robot", "planar_2r", "--out", str(out)]) == 0
    return out


def recording(bag):
    """The tables of the recording that are drafted."""
    draft = draft_experiment([bag], "planar_2r", out=bag.parent / "experiment.toml")
    assert not draft.troubles
    content = tomllib.loads(draft.text)
    return content["recording"], content.get("controller", {}).get("type")


def test_the_reference_of_another_topic_is_found(drafted):
    content = tomllib.loads(drafted.read_text(encoding="utf-8"))
    log = content["recording"]
    assert log["columns"]["q_ref"] == [f"{REFERENCE}/shoulder", f"{REFERENCE}/elbow"]
    assert log["units"]["q_ref"] == "rad" and content["controller"]["type"] == "identify"
    assert log["rate"] == STATES and log["resample"] is True
    assert "comes at 100 Hz" in drafted.read_text(encoding="utf-8").replace("\n# ", " ")


def test_after_a_clean_init_nothing_is_wrong(drafted):
    found = check_experiment(drafted)
    assert not [r for r in found.remarks if r.severity == "error"]
    (audit,) = audit_file(drafted)
    assert not [f for f in audit.findings if f.severity == "error"]
    experiment = load_experiment(drafted)
    result = identify(experiment.problem(), experiment.methods()["ls"])
    assert result.relative_error < 0.02


def test_the_audit_knows_what_the_file_makes_good(drafted):
    """Without the reference all channels share one clock, which is as jittery as before."""
    lines = drafted.read_text(encoding="utf-8").split("\n")
    start = lines.index("q_ref = [")
    text = "\n".join(lines[:start] + lines[start + 4 :])
    text = text.replace('q_ref = "rad"', "").replace('"identify"', '"virtual_pd"')
    path = drafted.with_name("one_clock.toml")
    path.write_text(text, encoding="utf-8")
    (audit,) = audit_file(path)
    (jitter,) = [f for f in audit.findings if f.kind == "jitter"]
    assert jitter.severity == "ok" and "resample = true" in jitter.message
    assert jitter.quantity.value > 30.0  # it is told all the same [%]
    assert not [f for f in audit.findings if f.severity == "error"]
    path.write_text(text.replace("resample = true", ""), encoding="utf-8")
    (audit,) = audit_file(path)
    assert [f.kind for f in audit.findings if f.severity == "error"] == ["jitter"]


def test_a_slow_channel_that_sets_the_rate_is_named(drafted):
    path = drafted.with_name("slow.toml")
    text = drafted.read_text(encoding="utf-8").replace(f"rate = {STATES}", "")
    path.write_text(text, encoding="utf-8")
    experiment = load_experiment(path)
    (made,) = experiment.recordings()
    assert made.rate == pytest.approx(CONTROLLER)
    literature = LeastSquares(signals=Bandpass(cutoff=50.0))
    with pytest.raises(RecordingError, match=r"q_ref comes at 100 Hz .* write rate = 500 under"):
        identify(experiment.problem(), literature)
    used = identify(experiment.problem(), experiment.methods()["ls"]).method_used.signals
    assert max(used.cutoff) < 0.5 * CONTROLLER and used.bandwidth == pytest.approx(CONTROLLER / 8)
    (remark,) = [r for r in check_experiment(path).remarks if r.kind == "slowed"]
    assert "rate = 500 under [recording]" in remark.next_step and remark.severity == "warning"
    assert remark.quantity.value == pytest.approx(CONTROLLER)


def test_messages_without_stamps_are_taken_when_they_were_received(tmp_path):
    log, law = recording(jittery_bag(tmp_path, stamped=False))
    state = "/arm_controller/controller_state/receive_time"
    stamp = "/joint_states/stamp"
    assert log["columns"]["t"] == {"q": stamp, "tau": stamp, "q_ref": state}
    assert law == "identify"


@pytest.mark.parametrize("how", [{"lead": 5.0}, {"rate": 4.0}, {"gap": (1.0, 6.0)}],
                         ids=["another clock", "too slow", "mostly silent"])  # fmt: skip
def test_a_reference_that_costs_the_record_is_left_aside(tmp_path, how):
    log, law = recording(jittery_bag(tmp_path, **how))
    assert "q_ref" not in log["columns"] and log["rate"] == STATES and law is None


def test_torques_of_another_topic_are_not_taken_faster_than_they_came(tmp_path):
    log, _ = recording(jittery_bag(tmp_path, torques=250.0))
    assert log["columns"]["tau"] == ["/drives/effort/shoulder", "/drives/effort/elbow"]
    assert "q_ref" in log["columns"] and log["rate"] == 250.0


def test_a_pause_of_the_controller_leaves_what_is_on_both_sides(tmp_path):
    bag = jittery_bag(tmp_path, gap=(1.5, 2.0))
    log, law = recording(bag)
    assert "q_ref" in log["columns"] and law == "identify" and "part" not in log
    out = tmp_path / "experiment.toml"
    out.write_text(draft_experiment([bag], "planar_2r", out=out).text)
    first, second = load_experiment(out).recordings()
    assert first.duration == pytest.approx(1.5, abs=0.1)
    assert second.duration == pytest.approx(6.0, abs=0.1)
