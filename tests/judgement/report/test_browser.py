"""The page in a browser: figures drawn, no errors, no sideways scrolling on a phone."""

from pivident.judgement.report.builder import render_report
from tests.browser import needs_browser, seen_on_a_phone
from tests.synthetic_identification import (
    synthetic_identification,
    synthetic_loop,
    true_parameters,
)


@needs_browser
def test_page_on_a_phone(tmp_path):
    results = [
        synthetic_identification("IDIM-LS", seed=3),
        synthetic_identification("IDIM-IV", seed=4, loop=synthetic_loop("law")),
        synthetic_identification("IDIM-PIV", seed=5, loop=synthetic_loop("moves")),
    ]
    seen = seen_on_a_phone(render_report(results, true_parameters()), tmp_path)
    assert seen["drawn"] == seen["plots"] > 10
