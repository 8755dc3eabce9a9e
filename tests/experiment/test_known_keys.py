"""What is known of parameters, in the experiment file."""

import pytest

from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError
from tests.planar_log import EXPERIMENT, write_experiment

KNOWN = """
fixed = {ia2 = 0.1}
bounds = {fv1 = [0.0, "none"], fc1 = [0, 50]}
priors = {mx1r = [1.8, 0.1]}
constraints = [{coefficients = {fv1 = 1.0, fv2 = -2.0}, value = 0.1}]
weights = {elbow = 4.0}
"""


def problem_of(tmp_path, lines):
    return load_experiment(write_experiment(tmp_path, EXPERIMENT + lines)).problem()


def test_the_file_says_what_is_known(tmp_path):
    problem = problem_of(tmp_path, KNOWN)
    assert problem.fixed == {"ia2": 0.1}
    assert problem.bounds == {"fv1": (0.0, float("inf")), "fc1": (0.0, 50.0)}
    (prior,) = problem.priors
    assert prior.names == ("mx1r",) and prior.mean[0] == 1.8
    assert prior.std[0] == pytest.approx(0.1)
    (equality,) = problem.constraints
    assert equality.coefficients == {"fv1": 1.0, "fv2": -2.0} and equality.value == 0.1
    assert (problem.recordings[0].weights[:, 1] == 4.0).all()


def test_the_description_and_a_joint_without_equation(tmp_path):
    lines = 'parameters = ["fv2", "fc2", "off2"]\nfixed = "description"\n'
    problem = problem_of(tmp_path, lines + 'without_equation = ["shoulder"]\n')
    assert problem.fixed.keys() >= {"zz1r", "mx1r", "zz2"}
    assert problem.silent_joints == ("shoulder",)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('fixed = "drawing"', "fixed"),
        ('fixed = {ia2 = "0.1"}', "fixed"),
        ("fixed = {ia9 = 0.1}", "no base parameter 'ia9'"),
        ("bounds = {fv1 = 3}", "least, largest"),
        ("bounds = {fv1 = [2, 1]}", "bounds of fv1"),
        ("priors = {fv1 = [1.0]}", "standard deviation"),
        ("priors = {fv1 = [1.0, -0.1]}", "positive"),
        ("constraints = [{coefficients = {fv1 = 0.0}}]", "no coefficient"),
        ("constraints = [{coefficient = {fv1 = 1.0}}]", "coefficient"),
        ('without_equation = ["wrist"]', "no joint 'wrist'"),
        ("weights = {elbow = -1.0}", "weight of elbow"),
    ],
)
def test_bad_values_name_their_key(tmp_path, line, words):
    with pytest.raises((ExperimentError, ValueError), match=words):
        problem_of(tmp_path, line + "\n")
