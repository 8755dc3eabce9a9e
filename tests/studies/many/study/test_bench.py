"""The test bench: records, noise inside and outside the loop, starts."""

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.linear.free_law import TransferLaw
from pivident.loop.simulation.simulated_record import Noise
from pivident.models.runnable_model import is_possible
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.bound import efficiency_bounds
from pivident.studies.many.study.run import Task, execute
from pivident.studies.many.study.scenario import read_scenario
from tests.studies.many.study.small import TEXT, small


def made(**tables):
    bench = Bench(small(**tables))
    return bench, bench.recording(0)


def test_a_record_depends_on_its_number_and_the_seed_alone():
    first, again = Bench(small()), Bench(small())
    again.recording(3)
    assert np.array_equal(first.recording(2).q, again.recording(2).q)
    assert not np.array_equal(first.recording(2).q, first.recording(1).q)
    assert not np.array_equal(first.recording(2).q, Bench(small(seed=8)).recording(2).q)


def test_noise_on_the_record_leaves_the_loop_alone():
    bench, record = made(noise={"encoder": 1e-4, "torque": 0.0, "where": "record"})
    assert np.array_equal(record.tau, bench.noise_free.tau)
    assert np.std(record.q - bench.noise_free.q) == pytest.approx(1e-4, rel=0.1)
    _, inside = made(noise={"encoder": 1e-4, "torque": 0.0})
    assert not np.allclose(inside.tau, bench.noise_free.tau, atol=1.0)


def test_torque_sensors_are_on_the_record_only():
    bench, record = made(noise={"encoder": 0.0, "torque": [0.5, 0.0]})
    assert np.array_equal(record.q, bench.noise_free.q)
    error = record.tau - bench.noise_free.tau
    assert error[:, 0].std() == pytest.approx(0.5, rel=0.1)
    assert not error[:, 1].any()


def test_coloured_noise_peaks_where_it_is_said_to():
    noise = {"encoder": 0.0, "torque": 0.0, "coloured": {"std": 2e-5, "frequency": 60.0}}
    _, record = made(noise=noise | {"where": "record"}, trajectory={"duration": 8.0})
    bench, _ = made(noise=noise | {"where": "record"}, trajectory={"duration": 8.0})
    error = record.q[:, 0] - bench.noise_free.q[:, 0]
    spectrum = np.abs(np.fft.rfft(error)) ** 2
    frequency = np.fft.rfftfreq(error.size, 1 / 500.0)
    assert frequency[np.argmax(spectrum)] == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize("rounding", ["record", "loop"])
def test_positions_are_rounded_to_counts(rounding):
    noise = {"encoder": 0.0, "torque": 0.05, "counts": 3600, "rounding": rounding}
    bench, record = made(noise=noise)
    steps = record.q / (2 * np.pi / 3600)
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    quiet = np.array_equal(
        record.tau - bench.noise.of_torque((0, 7), record.tau.shape), bench.noise_free.tau
    )
    close = np.allclose(record.tau, bench.noise_free.tau, atol=0.5)
    assert close if rounding == "record" else not close
    assert not quiet or rounding == "record"


@pytest.mark.parametrize(
    "law",
    [
        {"kp": [6000, 2500], "kd": [180, 60]},
        {
            "type": "pid",
            "kp": [6000, 2500],
            "kd": [180, 60],
            "ki": [900, 400],
            "derivative_time": 1e-3,
        },
        {"type": "cascade", "kp": [33, 41], "kv": [180, 60], "ki": [2, 3], "averaged": True},
    ],
)
def test_a_law_behind_a_very_fine_counter_is_the_compiled_law(law):
    counts = {"encoder": 1e-6, "torque": 0.0, "counts": 1e13, "rounding": "loop"}
    _, counted = made(controller={"type": "pd"} | law, noise=counts)
    _, compiled = made(controller={"type": "pd"} | law, noise={"encoder": 1e-6, "torque": 0.0})
    assert np.allclose(counted.q, compiled.q, rtol=0, atol=1e-9)
    assert np.allclose(counted.tau, compiled.tau, rtol=0, atol=1e-4)


def test_a_slower_record_holds_every_nth_sample_of_the_loop():
    noise = {"encoder": 2e-6, "torque": 0.0}
    _, fast = made(record={"rate": 1000}, noise=noise)
    _, slow = made(record={"rate": 250, "control_rate": 1000}, noise=noise)
    assert np.array_equal(slow.q, fast.q[::4])
    assert np.array_equal(slow.tau, fast.tau[::4])
    assert slow.control_rate == 1000.0


def test_all_pairs_of_record_and_start_are_met_once():
    for records, starts in ((4, 6), (5, 3)):
        bench = Bench(
            small(
                runs=records * starts,
                record={"records": records},
                start={"spread": 0.1, "count": starts},
            )
        )
        pairs = {(bench.record_of(k), bench.start_of(k)) for k in range(records * starts)}
        assert len(pairs) == records * starts


def test_starts_deviate_by_the_spread_and_stay_physical():
    bench = Bench(small(start={"inertia": 1.0, "friction": 1.0, "spread": 0.15, "count": 200}))
    starts = np.array([list(bench.start(k).values()) for k in range(200)])
    names = list(bench.truth)
    friction = starts[:, names.index("fv1")] / bench.truth["fv1"]
    assert friction.std() == pytest.approx(0.15, rel=0.2)
    assert bench.start(3) == bench.start(3)
    assert is_possible(bench.scenario.robot.links[0].inertia)
    assert not is_possible(np.array([1.0, 0, 0, 0.1, 0, 0.1, 0, 0, 0, 1.0]))


def test_true_values_may_be_given():
    bench = Bench(small(truth={"values": {"fc2": 5.0}}))
    assert bench.truth["fc2"] == 5.0
    assert bench.expected[bench.estimated.index("fc2")] == 5.0


def test_parameters_that_the_truth_has_not_are_zero():
    few = ["zz1", "zz2", "mx1", "mx2", "my2", "ia2", "fv1", "fv2"]
    bench = Bench(small(truth={"parameters": few}, identify={"parameters": [*few, "fc1"]}))
    assert bench.expected[bench.estimated.index("fc1")] == 0.0
    assert np.count_nonzero(bench.expected) == np.count_nonzero(list(bench.truth.values()))


def test_noise_of_a_run_has_streams_of_its_own():
    noise = Noise(coloured=1e-6)
    one, other = noise.in_loop((1, 5), (50, 2)), noise.in_loop((1, 6), (50, 2))
    assert np.abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.4
    assert np.array_equal(noise.in_loop(4, (50, 2)), noise.in_loop((4, 0), (50, 2)))


def test_records_move_in_turns_along_the_motions_of_several_seeds():
    bench = Bench(small(trajectory={"seed": [4, 9]}))
    first, second, third = (bench.reference_of_record(k)[0] for k in range(3))
    alone = Bench(small(trajectory={"seed": 9})).reference[0]
    assert np.array_equal(first, third) and np.array_equal(second, alone)
    assert not np.array_equal(first, second)
    assert np.array_equal(bench.recording(1).q_ref, second)
    other = Bench(small(trajectory={"seed": 10})).reference[0]
    assert np.array_equal(bench.second_reference[0], other), "a seed that none of them has"
    bounds = efficiency_bounds(bench)
    assert bounds.equation is None and bounds.torque_sensor is None, "bounds are of one motion"
    fourier = {"type": "fourier", "duration": 2.0, "seed": [1, 2], "reach": None}
    with pytest.raises(ExperimentError, match="several seeds need several motions"):
        small(trajectory={k: v for k, v in fourier.items() if v is not None})


def test_a_law_may_be_identified_from_each_record():
    tables = {"controller": {"derivative_time": 0.01}, "noise": {"torque": 0.0}}
    known, found = (Bench(small(law=x, **tables)).problem(0) for x in ("known", "identified"))
    assert isinstance(found.loop.controller, TransferLaw)
    assert not isinstance(known.loop.controller, TransferLaw)
    q = known.recordings[0].q
    np.testing.assert_array_equal(q, found.recordings[0].q)
    rate, q_ref, dq_ref = 500.0, known.recordings[0].q_ref, known.recordings[0].dq_ref
    given, own = (p.loop.controller.law(rate, q_ref, dq_ref) for p in (known, found))
    np.testing.assert_allclose(own.feedback.sum(axis=1), given.feedback.sum(axis=1), rtol=0.05)


def test_rows_tell_orders_and_what_the_residual_keeps():
    scenario = small(identify={"methods": ["ls", "piv"]})
    ls, piv = execute(Task.of(scenario, None), 0)
    assert ls["noise_order"] == [0, 0] and min(piv["noise_order"]) > 0
    for row in (ls, piv):
        assert len(row["correlated"]) == 2 and all(0.0 <= x <= 1.0 for x in row["correlated"])


def test_another_number_of_runs_holds_in_all_conditions():
    scenario = read_scenario(TEXT + "[vary.way]\nall = {}\nfew = {runs = 2}\n", "varied")
    assert [c.content.runs for c in scenario.conditions] == [6, 2]
    assert [c.content.runs for c in scenario.with_runs(3).conditions] == [3, 3]
