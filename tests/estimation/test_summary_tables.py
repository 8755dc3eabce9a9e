from dataclasses import replace

from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.summary import (
    WIDTH,
    comparison_table,
    identification_table,
    shortened,
)
from pivident.foundation.text.finding import Finding
from tests.synthetic_identification import synthetic_identification, true_parameters


def test_table_says_how_the_result_came_about():
    text = synthetic_identification(
        warnings=(Finding("warning", "motion", "small", "The wrist hardly moved."),)
    ).summary()
    assert text.startswith("IDIM-PIV of planar 2R: converged in 5 iterations, relative error 3.4 %")
    assert "3.4 % (all samples)" in text and "over all samples, 1000 Hz" in text
    assert "Warning: The wrist hardly moved." in text
    assert "\x1b" not in text


def test_table_has_every_parameter_with_unit_and_group():
    identification = synthetic_identification()
    lines = identification_table(identification).splitlines()
    for name, unit, expression in zip(
        identification.names, identification.units, identification.expressions, strict=True
    ):
        (line,) = [line for line in lines if line.split(" ")[0] == name]
        assert unit in line
        assert line.endswith(expression)


def test_table_fits_its_width_and_shortens_groups():
    text = identification_table(synthetic_identification(robot_name="staubli_tx40"))
    assert max(map(len, text.splitlines())) <= WIDTH
    assert "…" in text


def test_decimal_points_stand_below_each_other():
    lines = identification_table(synthetic_identification()).splitlines()[2:15]
    assert len({line.index(".") for line in lines[1:]}) == 1


def test_joints_have_units_and_noise_orders():
    identification = synthetic_identification()
    bound = replace(identification.joints[0], ar_at_bound=True, ar_order=150)
    text = identification_table(replace(identification, joints=(bound, identification.joints[1])))
    (line,) = [line for line in text.splitlines() if line.startswith("shoulder")]
    assert line.split() == "shoulder 3.0 0.120 N m 2.40e-05 rad 150 (bound) 2000 6.9".split()


def test_a_result_that_did_not_converge_says_so():
    assert "NOT converged after 5 iterations" in str(synthetic_identification(converged=False))
    assert "solved in one step" in str(synthetic_identification("IDIM-LS"))


def test_comparison_marks_contradictions_only():
    good = synthetic_identification(seed=2)
    biased = replace(good, method="IDIM-LS", judged=None, theta=good.theta + 6.0 * good.std)
    text = comparison_table([biased, good])
    assert "IDIM-LS" in text.splitlines()[0]
    assert text.count(" *\n") == len(good.names)
    assert " *\n" not in comparison_table([replace(good, method="IDIM-IV"), good])


def test_comparison_with_truth_gives_errors():
    text = comparison_table([synthetic_identification("IDIM-LS")], true_parameters())
    head, columns = text.splitlines()[:2]
    assert columns.split()[:3] == ["parameter", "unit", "truth"]
    assert "error %" in columns
    assert "largest" not in head


def test_comparison_of_different_parameter_sets():
    full = synthetic_identification()
    part = replace(
        full,
        method="IDIM-LS",
        parameters=full.parameters[:3],
        names=full.names[:3],
        expressions=full.expressions[:3],
        judged=None,
        theta=full.theta[:3],
        covariance=full.covariance[:3, :3],
        robust_covariance=full.robust_covariance[:3, :3],
    )
    assert len(comparison_table([part, full]).splitlines()) == 2 + len(full.names) + 3


def test_texts_are_cut_at_blanks():
    assert shortened("zz1 + ia1 + yy2", 11) == "zz1 + ia1 …"
    assert shortened("short", 11) == "short"
    assert shortened("unbreakable", 5) == "unbr…"


def filtered(identification):
    return replace(identification, method_used=LeastSquares())


def test_tables_say_which_rows_an_error_is_taken_over():
    decimated = filtered(synthetic_identification("IDIM-WLS"))
    assert "relative error 3.4 % (filtered rows)" in str(decimated)
    assert "low-passed and thinned" in str(decimated)
    text = comparison_table([decimated, synthetic_identification()])
    assert "IDIM-WLS 3.4 % (filtered rows, 1000 Hz)" in text
    assert "IDIM-PIV 3.4 % (all samples, 1000 Hz)" in text
    assert "compare only errors over the same rows" in text
    assert "same rows" not in comparison_table([decimated, decimated])


def test_tables_show_the_friction_law_with_its_slopes():
    line = "Friction: fv dq + fc (2/π) atan(γ dq) + off, γ = 238.7, 179 s/rad"
    assert line in str(synthetic_identification()).splitlines()
    assert line in comparison_table([synthetic_identification()]).splitlines()
