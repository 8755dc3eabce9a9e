"""In tests each figure of a page is checked by plotly, also where a right one is like it."""

import numpy as np
import pytest

from pivident.judgement.report import builder

RIGHT = {"type": "scatter", "y": np.arange(3.0), "opacity": 0.5}


@pytest.mark.parametrize(
    "wrong", [{"nonsense": 1}, {"opacity": 2.0}, {"opacity": -0.1}, {"mode": "wrong"}]
)
def test_a_wrong_figure_after_a_right_one_is_refused(wrong):
    builder.to_json({"data": [RIGHT], "layout": {}})
    with pytest.raises(ValueError, match=next(iter(wrong))):
        builder.to_json({"data": [RIGHT | wrong], "layout": {}})
