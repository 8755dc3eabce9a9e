"""Order selection: the published example, the ranking rule, and the table."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.foundation.errors import IdentificationError, UnusableSignal
from pivident.linear.order_selection import select_orders
from tests.linear import published_systems


@pytest.fixture(scope="module")
def table():
    record = published_systems.RAO_GARNIER.record(0)
    return select_orders(record.u, record.y, 0.01, (0, 1), (3, 4, 5))


@pytest.mark.parametrize("seed", range(3))
def test_first_samples_of_the_published_example(seed):
    """CONTSID's demonstration: nb 1 to 2, nf 3 to 5 on 1000 samples selects [2 4 0]."""
    record = published_systems.RAO_GARNIER.record(seed)
    table = select_orders(record.u[:1000], record.y[:1000], 0.01, (0, 1), (3, 4, 5))
    assert (table.rows[0].numerator_order, table.rows[0].denominator_order) == (1, 4)


def test_all_samples_of_the_published_example(table):
    assert (table.rows[0].numerator_order, table.rows[0].denominator_order) == (1, 4)
    assert table.best is table.rows[0].estimate
    assert table.best.fit.r2 == pytest.approx(0.909, abs=0.01)
    assert table.best.fit.yic == pytest.approx(-10.3, abs=0.5)


def test_small_model_of_better_yic_is_not_chosen():
    """A first-order model of a delayed lag is well determined, and explains less."""
    record = published_systems.DELAYED_LAG.record(0)
    table = select_orders(record.u, record.y, 0.1, (0,), (1, 2), (80,))
    assert table.best.denominator.size == 3
    assert table.rows[1].score("r2") < table.rows[0].score("r2") - 0.005


def test_delay_is_found():
    system = published_systems.NON_MINIMUM_PHASE
    record = system.record(1)
    table = select_orders(record.u, record.y, 0.1, (1,), (2,), range(76, 85, 2))
    assert table.rows[0].delay == 80


@pytest.mark.parametrize("criterion", ["aic", "bic", "r2"])
def test_other_criteria_rank_by_their_value(criterion):
    record = published_systems.NON_MINIMUM_PHASE.record(0)
    table = select_orders(
        record.u, record.y, 0.1, (0, 1), (1, 2), (80,), criterion=criterion, method="rivc"
    )
    scores = [row.score(criterion) for row in table.rows if not row.rejected]
    assert scores == sorted(scores, reverse=criterion == "r2")


@pytest.mark.parametrize("method", ["sriv", "riv"])
def test_discrete_models_are_ranked_by_the_same_rule(method):
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 300), 5)
    y = lfilter([0.0, -0.4, 0.8], [1.0, -1.5, 0.7], u) + 0.2 * rng.normal(size=u.size)
    table = select_orders(u, y, 0.1, (0, 1), (1, 2, 3), (0, 1, 2), method=method)
    best = table.rows[0]
    assert (best.numerator_order, best.denominator_order, best.delay) == (1, 2, 1)


def test_table_says_why_a_row_is_rejected(table):
    text = str(table)
    assert text.splitlines()[1].split()[:3] == ["1", "4", "0"]
    assert any(row.rejected for row in table.rows)
    assert all(row.rejected in text for row in table.rows)


def test_nothing_to_choose_from():
    u = np.random.default_rng(0).normal(size=200)
    with pytest.raises(IdentificationError, match="no combination"):
        select_orders(u, u, 0.1, (3,), (1, 2))
    with pytest.raises(IdentificationError, match="all 1 candidates were rejected"):
        _ = select_orders(u, lfilter([0.0, 0.1], [1.0, -1.05], u), 0.1, (0,), (1,)).best
    with pytest.raises(UnusableSignal):
        select_orders(np.ones(200), u, 0.1, (0,), (1,))
    with pytest.raises(IdentificationError, match="criterion 'yik'"):
        select_orders(u, u, 0.1, (0,), (1,), criterion="yik")
    with pytest.raises(IdentificationError, match="method 'arx'"):
        select_orders(u, u, 0.1, (0,), (1,), method="arx")
