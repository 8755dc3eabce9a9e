"""The page in a browser: figures drawn, no errors, no sideways scrolling on a phone."""

from pivident.judgement.audit.audit import audit_log
from pivident.judgement.report.audit_account import render_page
from tests.browser import needs_browser, seen_on_a_phone
from tests.judgement.audit.logs import planar


@needs_browser
def test_page_on_a_phone(tmp_path):
    seen = seen_on_a_phone(render_page([audit_log(planar())]), tmp_path)
    assert seen["drawn"] == seen["plots"] >= 8
