"""What the readers did to the samples stands on the page, and numbers read as numbers."""

from dataclasses import replace

from pivident.judgement.diagnostics.summary import Item, Summary
from pivident.judgement.report.builder import _sentence, page_environment, render_report
from pivident.judgement.report.downloads import signals_csv
from tests.judgement.report.test_report import HOSTILE, Page
from tests.planar_results import planar_results


def text_of(found):
    return " ".join(" ".join(Page(render_report([found])).text).split())


def test_how_a_record_was_logged_is_told():
    (found,) = planar_results("ls")
    (recording,) = found.recordings
    assert recording.account[0].endswith("samples at 1000 Hz, control loop at 1000 Hz.")
    text = text_of(found)
    assert all(sentence in text for sentence in recording.account)
    assert "How it was logged and resampled." in text


def test_notes_and_delays_are_told_and_stay_text():
    (found,) = planar_results("ls")
    note = f"Resampled to 1000 Hz. {''.join(HOSTILE)}"
    account = (*found.recordings[0].account, note)
    told = replace(found, recordings=(replace(found.recordings[0], account=account),))
    assert note in "".join(Page(render_report([told])).text)
    silent = replace(found, recordings=(replace(found.recordings[0], account=()),))
    assert "How it was logged" not in text_of(silent)


def test_a_recording_accounts_for_its_delays():
    from tests.data.recording.test_recording import recording

    late = recording(
        delay=0.0012, drive_delay=3e-4, control_rate=4000.0, notes=("Sorted by time.",)
    )
    text = " ".join(late.account)
    assert "control loop at 4000 Hz" in text
    assert "1.2 ms later than the positions" in text
    assert "acts 0.3 ms after its sample" in text
    assert text.endswith("Sorted by time.")
    assert len(recording().account) == 2


def test_powers_in_sentences():
    assert _sentence("F = 1.99e+11, p = 4e-9 of x1e-3 <b>") == (
        "F = 1.99&thinsp;×&thinsp;10<sup>11</sup>, p = 4&thinsp;×&thinsp;10<sup>-9</sup> of x1e-3 "
        "&lt;b&gt;"
    )


def test_commands_in_sentences_are_code():
    assert _sentence("`pivident laws <b>` at 1e-05; a ` alone") == (
        "<code>pivident laws &lt;b&gt;</code> at 1&thinsp;×&thinsp;10<sup>-5</sup>; a ` alone"
    )


def test_keys_in_the_summary_are_code():
    items = (Item("Identify the parts apart (`part`)."),)
    summary = Summary("arm", "Do not use.", "8 % off", (), (), "none", items)
    template = '{% from "macros.html" import screen %}{{ screen(summary) }}'
    page = page_environment().from_string(template).render(summary=summary)
    assert "<li>Identify the parts apart (<code>part</code>).</li>" in page


def test_a_torque_that_was_not_measured_is_not_called_so():
    (found,) = planar_results("ls")
    records = tuple(replace(r, torque_source="law") for r in found.recordings)
    (record,) = records
    computed = replace(found, recordings=records)
    page = render_report([computed])
    assert "Commanded and reconstructed torque of shoulder" in page
    assert "of the control law" in text_of(computed)
    assert "Measured and reconstructed torque of shoulder" in render_report([found])
    assert "shoulder commanded torque [N m]" in signals_csv(computed, record)
