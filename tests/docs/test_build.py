"""The documentation is built without a warning, and its theory is tied to code that exists."""

import re
import subprocess
import sys

import pytest

from tests.docs.page_blocks import DOCS

sys.path.insert(0, str(DOCS / "extensions"))

from equation_code import MissingObject, object_named, tied_names

THEORY = DOCS / "theory"

#: Sphinx, but for what `make docs` has beside the pages themselves and what takes half of its time:
#: 280 pages of sources that links lead to, the contents of every page that functions add to, the
#: list of all pages in the margin of each, which the theme makes anew for each of them, the index
#: and its search. A name is looked for once among all objects, not for every type of an argument.
SPHINX = """
import functools, gc, sys
import furo
from sphinx.builders.html import StandaloneHTMLBuilder
from sphinx.cmd.build import main
from sphinx.domains.python import PythonDomain
from sphinx.ext import viewcode
gc.set_threshold(100_000, 50, 50)
viewcode.collect_pages = lambda app: iter(())
furo._compute_navigation_tree = lambda context: ""
StandaloneHTMLBuilder.search = False
PythonDomain.find_obj = functools.cache(PythonDomain.find_obj)
options = ("toc_object_entries=0", "html_use_index=0", "smartquotes=0")
sys.exit(main([*sys.argv[1:], *(word for option in options for word in ("-D", option))]))
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    pytest.importorskip("sphinx", reason="sphinx is not installed; pip install --group docs")
    pytest.importorskip("myst_parser")
    pytest.importorskip("furo")
    out = tmp_path_factory.mktemp("docs")
    command = [sys.executable, "-c", SPHINX, "-W", "--keep-going", "-q", "-b", "html"]
    result = subprocess.run([*command, str(DOCS), str(out)], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr[-3000:]
    return out


def test_every_page_is_built_and_linked(built):
    for page in DOCS.rglob("*.md"):
        if "extensions" not in page.parts:
            assert (built / page.relative_to(DOCS)).with_suffix(".html").is_file(), page


def test_commands_are_on_their_page(built):
    from pivident.app.cli.app import app

    text = (built / "reference" / "command_line.html").read_text("utf-8")
    names = [name for name in app if not name.startswith("-")]
    assert len(names) > 10
    for name in names:
        assert f'id="pivident-{name}"' in text, name
    assert "--folds" in text and "@commands@" not in text


def test_equations_are_drawn_without_a_script(built):
    text = (built / "theory" / "prefiltered_iv.html").read_text("utf-8")
    assert text.count("<math") > 10 and "mathjax.js" not in text.lower()
    assert 'id="equation-eq-prefilter"' in text
    assert "cdn." not in text and 'src="http' not in text


def test_a_fraction_without_braces_has_its_two_parts(built):
    text = re.sub(r"\s+", "", (built / "theory" / "consistency.html").read_text("utf-8"))
    assert "<mfrac><mn>1</mn><mn>2</mn></mfrac>" in re.sub(r"<mfrac[^>]*>", "<mfrac>", text)
    assert "<mn>12</mn>" not in text


def test_ties_lead_to_the_source(built):
    text = (built / "theory" / "prefiltered_iv.html").read_text("utf-8")
    assert "reference/implementation.html#pivident.signals.noise_models.fit_ar" in text
    source = (built / "reference" / "implementation.html").read_text("utf-8")
    assert "_modules/pivident/signals/noise_models.html" in source


def test_every_equation_is_numbered_and_followed_by_its_code():
    labels = []
    for page in sorted(THEORY.glob("*.md")):
        text = page.read_text("utf-8")
        parts = re.split(r"```\{math\}\n", text)[1:]
        for part in parts:
            label = re.match(r":label: (eq-[\w-]+)\n", part)
            assert label, f"{page.name}: an equation without a label"
            labels.append(label[1])
        # Definitions within a derivation may share the code of the equation after them.
        assert not parts or "{code}`" in text, page.name
    assert len(labels) == len(set(labels)) > 30


def test_every_tie_names_an_object_where_it_is_defined():
    """Another path would describe it twice, which stops the build."""
    ties = tied_names(THEORY)
    assert len(ties) > 50
    for name, pages in ties.items():
        found = object_named(name)
        assert found is not None, pages
        assert name.startswith(getattr(found, "__module__", name)), (name, pages)


def test_a_tie_to_nothing_is_refused():
    with pytest.raises(MissingObject, match="has no 'irwsmo'"):
        object_named("pivident.signals.random_walk.irwsmo")


def test_cited_sources_are_in_the_bibliography():
    entries = re.split(r"^: ", (THEORY / "bibliography.md").read_text("utf-8"), flags=re.MULTILINE)
    cited = [
        pair
        for page in THEORY.glob("*.md")
        for pair in re.findall(r"([A-Z][a-z]+)[\s(]+((?:19|20)\d\d)\)", page.read_text("utf-8"))
    ]
    assert len(cited) > 8
    for name, year in cited:
        assert any(name in entry and year in entry for entry in entries), (name, year)


def test_every_equation_of_the_paper_leads_to_its_code(built):
    """One click from the row of an equation to the source's entry, which exists."""
    from pivident.studies.paper.equations import EQUATIONS

    page = built / "paper" / "index.html"
    text = page.read_text("utf-8")
    for equation in EQUATIONS:
        row = re.search(rf"<td><p>\({equation.number}\)</p></td>.*?</tr>", text, re.DOTALL)
        assert row, equation
        links = re.findall(r'href="([^"#]*)#(pivident[^"]+)"', row[0])
        assert [name for _, name in links] == list(equation.code)
        for target, name in links:
            assert f'id="{name}"' in (page.parent / target).resolve().read_text("utf-8"), name


def test_the_page_of_the_paper_has_its_figures_and_no_gaps(built):
    text = (DOCS / "paper" / "index.md").read_text("utf-8")
    drawn = re.findall(r"!\[[^\]]+\]\(figures/(\w+\.png)\)", text)
    assert len(drawn) == 8 and all((DOCS / "paper" / "figures" / f).is_file() for f in drawn)
    assert not re.search(r"\b(?:nan|None|inf)\b", text)
    assert "100 records of 20 motions" in text and "## A real arm" in text
