"""From a fresh folder to a verdict by mouse and keyboard alone, in Debian's Chromium.

The arm of six axes is the one of examples/ur10e_like, simulated by Pinocchio; shorter than there.
"""

import importlib.util
import shutil
from functools import partial
from itertools import count

import pytest

pytest.importorskip("playwright")
pytest.importorskip("starlette")

from tests.app.studio.browsing import chromium, fits, needs_browser, served, window
from tests.conftest import REPOSITORY
from tests.planar_log import write_log

pytestmark = needs_browser


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """URDF and log of an arm, as its owner has them."""
    pytest.importorskip("pinocchio")
    folder = tmp_path_factory.mktemp("ur10e")
    path = REPOSITORY / "examples" / "ur10e_like" / "simulate_log.py"
    spec = importlib.util.spec_from_file_location("simulate_log", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.write(folder, seconds=15.0)
    return folder


@pytest.fixture(scope="module")
def browsing():
    """Windows of one browser."""
    with chromium() as browser:
        yield partial(window, browser)


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A studio that has a project for each test."""
    root = tmp_path_factory.mktemp("studio")
    with served(root) as server:
        server.root = root
        yield server


#: Numbers of the projects of a studio.
NUMBERS = count(1)


def open_project(page, server, name):
    """Show a project, with the token in its address as in the one that the server prints."""
    page.goto(f"{server.base}/p/{name}?token={server.token}")


def ready(page):
    """Wait until nothing hinders a run."""
    page.wait_for_function(
        "([part, text]) => document.querySelector(`[data-mark=${part}].mark`).textContent.trim()"
        ".startsWith(text)",
        arg=["run", "ready"],
        timeout=240_000,
    )


def test_two_files_to_a_verdict(arm, studio, browsing):
    """Begun at a desk, answered and run on a phone; both show every state of it."""
    with browsing() as page, browsing(390, "dark") as phone:
        page.goto(studio.address)
        assert "token" not in page.url
        phone.goto(studio.address)
        assert fits(page) and fits(phone)
        page.get_by_label("Name of the project").first.fill("cobot")
        page.get_by_role("button", name="Create", exact=True).click()
        page.wait_for_url("**/p/cobot")
        phone.goto(f"{studio.base}/p/cobot")
        page.locator("#bring").set_input_files([arm / "ur10e_like.urdf", arm / "rtde_log.csv"])
        for window in (page, phone):
            window.locator(".replay canvas").wait_for(timeout=120_000)
        answer_questions(phone)
        for window in (page, phone):
            ready(window)
            assert fits(window)
            window.locator("#checks .headline").wait_for()
            assert "These methods take about" in window.locator("#run output.time").inner_text()
        # from the top of the page to the button: at most three screens
        button = page.get_by_role("button", name="Run", exact=True)
        screens = "e => (e.getBoundingClientRect().bottom + scrollY) / innerHeight"
        assert button.evaluate(screens) < 3.0
        phone.get_by_role("button", name="Run", exact=True).click()
        phone.locator("article.run .headline").wait_for(timeout=300_000)
        is_seen = "e => e.getBoundingClientRect().top < innerHeight"
        assert phone.locator("#run-of-001").evaluate(is_seen)
        page.locator("article.run .headline").wait_for()
        results = studio.root / "cobot" / "results" / "001-identify"
        stored = (results / "verdict.json").read_text("utf-8")
        for window in (page, phone):
            verdict = window.locator("article.run .headline").first.inner_text()
            assert verdict.startswith(("Good for torque prediction", "Do not use"))
            assert verdict.split(",")[0].split(":")[0] in stored
            assert fits(window)
            with window.context.expect_page() as opened:
                window.get_by_role("link", name="Report").first.click()
            opened.value.locator("h1").wait_for()
            assert "Verdict" in opened.value.inner_text("main")


def answer_questions(page):
    """Questions of the draft, if there are any: what a person who knows nothing would do."""
    page.wait_for_function(
        "() => document.querySelector('[data-mark=files].mark').textContent.includes('✓')",
        timeout=180_000,
    )
    questions = page.locator("form.questions")
    if questions.count():
        for group in questions.locator("fieldset").all():
            group.locator("input").first.check()
        questions.get_by_role("button", name="Answer").click()
        questions.wait_for(state="detached")


def unfold(page, group):
    """Open a group of lines."""
    page.locator(f"#group-{group} > summary").click()


def make_planar(folder):
    """A project whose experiment file is there, and its log."""
    from tests.planar_log import EXPERIMENT

    folder.mkdir(parents=True)
    write_log(folder / "log.csv")
    (folder / "experiment.toml").write_text(EXPERIMENT.lstrip(), encoding="utf-8")
    return folder


@pytest.fixture
def planar(studio):
    """A project of the studio."""
    return make_planar(studio.root / f"arm_{next(NUMBERS):02d}")


def test_by_keyboard_alone(planar, studio, browsing):
    with browsing() as page:
        page.goto(studio.address)
        reach(page, "a", planar.name)
        page.keyboard.press("Enter")
        page.wait_for_url(f"**/p/{planar.name}")
        ready(page)
        reach(page, "button", "Run")
        page.keyboard.press("Enter")
        page.locator("article.run .headline").wait_for(timeout=240_000)
        reach(page, "a", "Report")


def reach(page, tag, text):
    """Press the tabulator until an element has the focus; every stop is visible."""
    for _ in range(400):
        page.keyboard.press("Tab")
        found = page.evaluate(
            "() => { const e = document.activeElement, s = getComputedStyle(e);"
            "return [e.tagName.toLowerCase(), e.textContent.trim(), s.outlineStyle]; }"
        )
        if found[0] == tag and found[1].startswith(text):
            assert found[2] != "none"
            return
    raise AssertionError(f"the tabulator does not reach {tag} {text!r}")


def test_a_change_redraws_the_signals_and_can_be_undone(planar, studio, browsing):
    with browsing() as page:
        open_project(page, studio, planar.name)
        ready(page)
        field = page.locator("[id='row-recording.0.units.q-value']")
        assert "deg" in field.input_value()
        highest = (
            "() => { const plot = document.querySelector('[data-channel=q] .plot');"
            "return plot?.data ? Math.max(...plot.data[0].y) : 0; }"  # none while it is read anew
        )
        assert not field.is_visible()  # nothing in this group is assumed
        unfold(page, "q")
        page.locator("[data-channel=q]").scroll_into_view_if_needed()
        page.wait_for_function(f"() => ({highest})() > 0")
        names = page.locator("[data-channel=q] .legendtext").all_text_contents()
        assert names == ["shoulder", "elbow"]
        before = page.evaluate(highest)
        if field.evaluate("e => e.tagName") == "SELECT":
            field.select_option('"rad"')
        else:
            field.fill('"rad"')
            field.press("Enter")
        page.wait_for_function(f"() => ({highest})() > 10 * {before}", timeout=60_000)
        page.wait_for_function(
            "() => document.querySelector('[data-mark=checks].mark').textContent.includes('×')"
        )
        page.get_by_role("button", name="Run", exact=True).and_(
            page.locator(":disabled")
        ).wait_for()
        page.get_by_role("button", name="Undo the last change").click()
        ready(page)
        assert "deg" in field.input_value()


def test_an_assumption_is_confirmed_with_one_button(planar, studio, browsing):
    path = planar / "experiment.toml"
    text = path.read_text(encoding="utf-8")
    assumed = "# ASSUMED, please check: it looks like degrees.\n"
    line = next(one for one in text.splitlines() if one.startswith("units"))
    path.write_text(text.replace(line, assumed + line), encoding="utf-8")
    with browsing() as page:
        open_project(page, studio, planar.name)
        page.locator(".row.assumed").first.wait_for()
        page.get_by_role("button", name="is right").first.click()
        page.locator(".row.assumed").first.wait_for(state="detached")
    assert path.read_text(encoding="utf-8") == text.replace(
        line, f"# Confirmed by hand ({assumed[2:-2]}).\n{line}"
    )


def test_what_has_the_focus_is_brought_up_to_date(tmp_path, studio, browsing):
    """The field of files keeps the focus after a choice; what it has begun is shown all the same.

    Boxes that were ticked and not sent stay.
    """
    write_log(tmp_path / "log.csv")
    (studio.root / "focus").mkdir()
    path = studio.root / "focus" / "experiment.toml"
    path.write_text('robot = "planar_2r"\n', encoding="utf-8")
    with browsing() as page:
        open_project(page, studio, "focus")
        page.locator("#bring").focus()
        page.locator("#bring").set_input_files(tmp_path / "log.csv")
        page.locator("#files").get_by_text("log.csv").first.wait_for(timeout=60_000)
        page.locator("#files .busy").wait_for(state="detached", timeout=60_000)
        assert page.evaluate("document.activeElement.id") == "bring"
        ready(page)
        ticked = page.locator("#run [value=piv]")
        page.locator("#run summary").first.click()
        ticked.focus()
        text = path.read_text(encoding="utf-8")
        path.write_text(text + "[nothing]\n", encoding="utf-8")
        page.locator("#run .remark").wait_for(timeout=30_000)
        path.write_text(text, encoding="utf-8")
        ready(page)
        ticked.focus()
        ticked.click()
        is_ticked = ticked.is_checked()
        shown = page.locator("[data-piece=run]").get_attribute("data-key")
        path.write_text(text + "[nothing]\n", encoding="utf-8")
        while (state := told(page))["busy"] or state["keys"]["run"] == shown:
            pass
        told(page)  # the page asks again once it has done what it does about the answer before
        assert page.locator("#run .remark").count() == 0 and ticked.is_checked() == is_ticked


def told(page):
    """What the server answers next to the page's question for news."""
    with page.expect_response("**/state") as answer:
        pass
    return answer.value.json()


def test_one_change_is_one_request(planar, studio, browsing):
    """A field that is left for its button is sent once; so is a button that is pressed twice."""
    sent = []
    with browsing() as page:
        open_project(page, studio, planar.name)
        ready(page)
        page.on("request", lambda r: r.method == "POST" and sent.append(r.url.rpartition("/")[2]))
        page.get_by_role("button", name="Run", exact=True).dblclick()
        page.locator("article.run").first.wait_for()
        assert sent == ["run"]
        unfold(page, "controller")
        row = page.locator("[id='row-controller.kp']")
        row.locator("[name=value]").fill("[5000, 2500]")
        row.get_by_role("button", name="Change").click()
        page.wait_for_function(
            "() => document.querySelector(\"[id='row-controller.kp-value']\").defaultValue"
            ".includes('5000')"
        )
        assert sent == ["run", "edit"] and page.locator("#said").is_hidden()


def test_files_that_are_dropped_on_the_front_page(tmp_path, studio, browsing):
    write_log(tmp_path / "log.csv")
    content = (tmp_path / "log.csv").read_text(encoding="utf-8")
    with browsing() as page:
        page.goto(studio.address)
        page.evaluate(
            """(content) => {
                const transfer = new DataTransfer();
                transfer.items.add(new File([content], "my arm.csv"));
                dispatchEvent(new DragEvent("drop", {dataTransfer: transfer, cancelable: true}));
            }""",
            content,
        )
        page.wait_for_url("**/p/my%20arm")
        page.locator("[data-file='my arm.csv']").wait_for()
    assert (studio.root / "my arm" / "my arm.csv").read_text(encoding="utf-8") == content


def test_two_tabs_show_the_same(planar, studio, browsing):
    with browsing() as page:
        open_project(page, studio, planar.name)
        other = page.context.new_page()
        other.goto(f"{studio.base}/p/{planar.name}")
        ready(page)
        ready(other)
        row = "[id='row-controller.kp-value']"
        unfold(page, "controller")
        page.locator(row).fill("[5000, 2500]")
        page.locator(row).press("Enter")
        other.wait_for_function(
            f"() => document.querySelector(\"{row}\").value.includes('5000')", timeout=30_000
        )
        # An editor changes the file; a change that was made to the older text is refused.
        text = (planar / "experiment.toml").read_text(encoding="utf-8")
        status = page.evaluate(
            """async (version) => (await fetch(location.pathname + "/text", {method: "POST",
            body: JSON.stringify({text: "robot = 'planar_2r'", version})})).status""",
            "0000000000000000",
        )
        assert status == 409
        page.seen_errors.clear()  # the browser's own line about the answer 409
        assert (planar / "experiment.toml").read_text(encoding="utf-8") == text


def test_a_killed_server_takes_nothing_along(tmp_path, browsing):
    import signal

    planar = make_planar(tmp_path / "root" / "arm")
    with served(planar.parent) as server, browsing() as page:
        open_project(page, server, "arm")
        ready(page)
        page.get_by_role("button", name="Run", exact=True).click()
        page.locator("article.run.running").wait_for()
        server.stop(signal.SIGKILL)
        page.close()
        page.seen_errors.clear()
    with served(planar.parent) as server, browsing() as page:
        open_project(page, server, "arm")
        page.locator("article.run .headline").wait_for(timeout=240_000)
    assert (planar / "results" / "001-identify" / "verdict.json").is_file()


@pytest.fixture(scope="module")
def looked_at(studio):
    """A project that no test changes."""
    return make_planar(studio.root / "looked_at")


@pytest.mark.parametrize("colour", ["light", "dark"])
def test_contrast(looked_at, studio, browsing, colour):
    """Text against its background: 4.5 to 1, as WCAG 2.2 asks (1.4.3)."""
    with browsing(colour=colour) as page:
        for address in (studio.address, f"{studio.base}/p/{looked_at.name}"):
            page.goto(address)
            if "/p/" in address:
                ready(page)
            assert page.evaluate(CONTRAST) == []


CONTRAST = """() => {
  const parsed = (text) => text.match(/[\\d.]+/g).map(Number);
  const linear = (c) => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  function ground(element) {
    for (let e = element; e; e = e.parentElement) {
      const [r, g, b, a = 1] = parsed(getComputedStyle(e).backgroundColor);
      if (a > 0.99) return [r, g, b];
    }
    return [255, 255, 255];
  }
  const found = [];
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    const aside = element.closest("svg, :disabled, .hidden-words, .skip");
    if (!own || aside || !element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    const [a, b] = [light(parsed(style.color)), light(ground(element))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    const words = element.textContent.trim().slice(0, 30);
    if (ratio < 4.5 && style.opacity === "1") found.push(`${words}: ${ratio.toFixed(2)}`);
  }
  return found;
}"""


def test_an_archive_goes_to_another_machine(planar, studio, browsing, tmp_path):
    with browsing() as page:
        open_project(page, studio, planar.name)
        with page.expect_download() as download:
            page.get_by_role("button", name="Pack and download").click()
        download.value.save_as(tmp_path / f"{planar.name}.zip")
    (tmp_path / "other").mkdir()
    with served(tmp_path / "other") as server, browsing() as page:
        page.goto(server.address)
        page.get_by_label("Archive").set_input_files(tmp_path / f"{planar.name}.zip")
        page.get_by_role("button", name="Open").click()
        page.wait_for_url(f"**/p/{planar.name}")
        ready(page)
    shutil.rmtree(planar / ".pivident-studio")
    for name in ("experiment.toml", "log.csv"):
        there = (tmp_path / "other" / planar.name / name).read_bytes()
        assert there == (planar / name).read_bytes()


def test_a_log_for_tests_is_answered_below_the_verdict(planar, studio, browsing, tmp_path):
    import numpy as np

    from tests.planar_log import HEADER, planar_log

    path = tmp_path / "other.csv"
    values = planar_log(samples=4000, seed=7)
    np.savetxt(path, values, fmt="%.9g", delimiter=",", header=HEADER, comments="")
    with browsing() as page:
        open_project(page, studio, planar.name)
        ready(page)
        page.get_by_role("button", name="Run", exact=True).click()
        page.locator("#run-of-001 .headline").wait_for(timeout=240_000)
        top = (
            "e => e.getBoundingClientRect().top"
            " - document.getElementById('results').getBoundingClientRect().top"
        )
        before = page.locator("#run-of-001 .headline").evaluate(top)
        form = page.locator("form[data-step=predict]")
        form.locator("input[type=file]").set_input_files(path)
        form.get_by_role("button", name="Test on another log").click()
        page.locator("#run-of-002.done").wait_for(timeout=120_000)
        answer = page.locator("#run-of-002 strong").first.inner_text()
        assert answer.startswith("The torque error below 20 Hz is")
        assert page.locator("#run-of-001 #run-of-002").count() == 1
        assert abs(page.locator("#run-of-001 .headline").evaluate(top) - before) < 1.0
        assert fits(page)
