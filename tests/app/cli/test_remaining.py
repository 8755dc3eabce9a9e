"""The time that is left, by a clock that is set."""

import pytest

from pivident.app.cli.remaining import TELLING, Remaining

STAGES = {"first": 10.0, "second": 20.0, "third": 5.0}


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def test_a_run_as_expected_takes_what_was_expected(clock):
    left = Remaining(STAGES, clock)
    assert left.seconds == pytest.approx(35.0) and str(left) == ""
    left.begin("first")
    clock.now += 4.0
    assert left.seconds == pytest.approx(31.0)
    assert str(left) == "stage 1 of 3, about 31 s left"
    clock.now += 6.0
    left.begin("second")
    assert left.seconds == pytest.approx(25.0)


def test_the_pace_is_that_of_this_run(clock):
    left = Remaining(STAGES, clock)
    left.begin("first")
    clock.now += 30.0  # not 10: all the rest will take about three times as long
    slowed = (1.0 + 30.0) / (1.0 + 10.0)
    assert left.seconds == pytest.approx(slowed * 25.0)
    left.begin("second")
    assert left.seconds == pytest.approx(slowed * 25.0)
    clock.now += 20.0 * slowed
    left.begin("third")
    clock.now += 1.0
    assert left.seconds == pytest.approx(5.0 * (1.0 + 30.0 + 20.0 * slowed) / (1.0 + 30.0) - 1.0)


def test_a_slow_beginning_announces_a_slow_run(clock):
    left = Remaining(STAGES, clock, before=(2.0, 5.0))
    assert left.seconds == pytest.approx(2.5 * 35.0)
    left.begin("first")
    clock.now += 10.0  # the machine is free again
    left.begin("second")
    assert left.seconds == pytest.approx((5.0 + 10.0) / (2.0 + 10.0) * 25.0)
    assert Remaining(STAGES, clock, before=(1.0, 90.0)).seconds == pytest.approx(TELLING * 35.0)


def test_a_stage_that_takes_longer_slows_what_follows_at_once(clock):
    left = Remaining(STAGES, clock)
    left.begin("first")
    clock.now += 10.0
    before = left.seconds
    clock.now += 20.0
    assert left.seconds > before


def test_a_moment_is_not_worth_a_word(clock):
    left = Remaining(STAGES, clock)
    left.begin("third")
    clock.now += 4.0
    assert str(left) == "stage 3 of 3"


def test_the_line_of_a_terminal_begins_with_what_is_left(monkeypatch):
    from pivident.app.cli.console import Progress

    progress = Progress()
    progress.begin("first")  # nothing is expected yet
    progress.say("reading")
    assert progress.__rich__().plain == "reading"
    progress.stages(STAGES)
    progress.begin("first")
    assert progress.__rich__().plain == "stage 1 of 3, about 35 s left: reading"
