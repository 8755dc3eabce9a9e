"""Projects: names, texts, undo, and what is not theirs."""

import threading

import pytest

from pivident.app.studio.projects import (
    EXPERIMENT,
    HIDDEN,
    MAX_EARLIER,
    Changed,
    ProjectError,
    Projects,
    checked_name,
    version_of,
)

BAD_NAMES = ["", ".", "..", ".hidden", "a/b", "a\\b", "a\0b", "-x", " ", "a" * 81, "a\n", "x:y",
             "con?", "<b>", "a.", "../a"]  # fmt: skip


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_are_none(name, tmp_path):
    with pytest.raises(ProjectError, match="cannot be used as a name"):
        checked_name(name)
    if name == name.strip():  # a person's spaces around it do not count
        with pytest.raises(ProjectError):
            Projects(tmp_path).create(name)
    assert not list(tmp_path.iterdir())


def test_create_find_and_list(tmp_path):
    projects = Projects(tmp_path)
    first = projects.create("arm one")
    (tmp_path / "something else").mkdir()
    assert [p.name for p in projects.listed()] == ["arm one"]
    assert projects.find("arm one").folder == first.folder
    with pytest.raises(ProjectError, match="exists already"):
        projects.create("arm one")
    with pytest.raises(ProjectError, match="no project 'something else'"):
        projects.find("something else")


def test_a_folder_with_an_experiment_is_one_project(tmp_path):
    (tmp_path / EXPERIMENT).write_text("", encoding="utf-8")
    projects = Projects(tmp_path)
    assert projects.is_single and projects.find(tmp_path.name).folder == tmp_path
    with pytest.raises(ProjectError, match="is a project itself"):
        projects.create("another")


def test_write_only_what_was_read(tmp_path):
    projects = Projects(tmp_path)
    project = projects.create("arm")
    projects.write(project, "a = 1\n", version_of(""))
    with pytest.raises(Changed, match="changed meanwhile"):
        projects.write(project, "a = 2\n", version_of(""))
    assert project.text == "a = 1\n"
    project.experiment.write_text("b = 3\n", encoding="utf-8")  # an editor
    with pytest.raises(Changed):
        projects.write(project, "a = 2\n", version_of("a = 1\n"))
    assert project.text == "b = 3\n"


def test_undo_goes_back_step_by_step(tmp_path):
    projects = Projects(tmp_path)
    project = projects.create("arm")
    texts = [f"a = {k}\r\n" for k in range(4)]
    for before, text in zip(["", *texts], texts, strict=False):
        projects.write(project, text, version_of(before))
    for text in reversed(texts[:-1]):
        assert projects.earlier_text(project) == text
        projects.undo(project)
        assert project.text == text
    with pytest.raises(ProjectError, match="no earlier text"):
        projects.undo(project)


def test_few_earlier_texts_are_kept(tmp_path):
    projects = Projects(tmp_path)
    project = projects.create("arm")
    for k in range(MAX_EARLIER + 10):
        projects.write(project, f"a = {k}\n", version_of(project.text))
    assert len(list((project.hidden / "earlier").iterdir())) == MAX_EARLIER
    projects.undo(project)
    assert project.text == f"a = {MAX_EARLIER + 8}\n"


def test_of_two_writers_one_wins(tmp_path):
    projects = Projects(tmp_path)
    project = projects.create("arm")
    outcomes = []

    def write(k):
        try:
            projects.write(project, f"a = {k}\n", version_of(""))
            outcomes.append(k)
        except Changed:
            pass

    threads = [threading.Thread(target=write, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(outcomes) == 1 and project.text == f"a = {outcomes[0]}\n"


@pytest.mark.parametrize(
    "path", ["../other", "a/../../b", "/etc/passwd", ".pivident-studio/x", "a//b", "", ".", "a/.b",
             "a\0b", "..%2f"],
)  # fmt: skip
def test_paths_stay_inside(path, tmp_path):
    project = Projects(tmp_path).create("arm")
    with pytest.raises(ProjectError, match="no file of the project"):
        project.path_of(path)


def test_a_link_leads_nowhere_else(tmp_path):
    project = Projects(tmp_path).create("arm")
    (tmp_path / "secret.txt").write_text("secret", encoding="utf-8")
    (project.folder / "log.csv").symlink_to(tmp_path / "secret.txt")
    with pytest.raises(ProjectError):
        project.path_of("log.csv")


def test_inputs_are_neither_results_nor_hidden(tmp_path):
    project = Projects(tmp_path).create("arm")
    for name in ("log.csv", "arm.urdf", "bag/metadata.yaml", "results/001-x/a.csv", f"{HIDDEN}/b",
                 EXPERIMENT, ".part"):  # fmt: skip
        path = project.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x", encoding="utf-8")
    names = [p.relative_to(project.folder).as_posix() for p in project.inputs()]
    assert names == ["arm.urdf", "bag/metadata.yaml", "log.csv"]
