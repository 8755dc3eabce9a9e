"""The experiment file that all logs of a fleet share."""

from pivident.estimation.methods import WITHOUT_TORQUE
from pivident.studies.many.fleet.template import load_template
from tests.studies.many.fleet.planar_fleet import TEMPLATE


def method_of(folder, text: str) -> str:
    path = folder / "fleet.toml"
    path.write_text(text)
    return load_template(path).method_name


def test_logs_without_torque_have_a_method_of_their_own(tmp_path):
    text = TEMPLATE.replace('method = "ls"\n', "")
    assert method_of(tmp_path, text) == "piv"
    assert method_of(tmp_path, text.replace(', tau = "tau"', "")) == WITHOUT_TORQUE[0]
    assert method_of(tmp_path, TEMPLATE.replace(', tau = "tau"', "")) == "ls"
