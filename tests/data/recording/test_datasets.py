import gzip
import hashlib
import threading
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pooch
import pytest

from pivident.data.recording import datasets
from pivident.data.recording.datasets import Dataset, PublicFile
from pivident.foundation.errors import ChecksumMismatch, DatasetUnavailable, RecordingError

CONTENT = b"a,b\n1,2\n"
PACKED = gzip.compress(CONTENT, mtime=0)


def digest(content):
    return hashlib.sha256(content).hexdigest()


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """A data set of one small file, an empty cache, and no folder named by the user."""
    file = PublicFile("log.csv", digest(CONTENT), gzipped=digest(PACKED))
    monkeypatch.setitem(datasets.DATASETS, "toy", Dataset("a toy", "MIT", "nobody", {"log": file}))
    monkeypatch.setattr(pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    monkeypatch.delenv("PIVIDENT_DATA", raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    return file


def put(folder, name, content):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)
    return folder / name


def publish(monkeypatch, file, url):
    entry = replace(datasets.DATASETS["toy"], files={"log": replace(file, url=url)})
    monkeypatch.setitem(datasets.DATASETS, "toy", entry)


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@pytest.fixture
def server(tmp_path):
    """Address of a web server for the folder ``published``."""
    (tmp_path / "published").mkdir()
    handler = partial(Quiet, directory=tmp_path / "published")
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{http.server_port}"
        http.shutdown()


@pytest.mark.parametrize("below", ["toy", "data/toy"])
@pytest.mark.parametrize(("name", "content"), [("log.csv", CONTENT), ("log.csv.gz", PACKED)])
def test_files_are_found_in_the_folder_the_user_names(
    toy, tmp_path, monkeypatch, below, name, content
):
    path = put(tmp_path / "mine" / below, name, content)
    monkeypatch.setenv("PIVIDENT_DATA", str(tmp_path / "mine"))
    assert datasets.dataset_files("toy") == datasets.fetch("toy", "log") == {"log": path}


def test_a_changed_file_in_that_folder_is_refused_and_left_alone(toy, tmp_path, monkeypatch):
    path = put(tmp_path / "mine" / "toy", "log.csv", b"changed")
    monkeypatch.setenv("PIVIDENT_DATA", str(tmp_path / "mine"))
    with pytest.raises(ChecksumMismatch) as caught:
        datasets.fetch("toy")
    assert (caught.value.found, caught.value.expected) == (digest(b"changed"), toy.sha256)
    assert path.read_bytes() == b"changed"


def test_a_file_is_fetched_once_and_then_taken_from_the_cache(toy, tmp_path, monkeypatch, server):
    put(tmp_path / "published", "log.csv", CONTENT)
    publish(monkeypatch, toy, f"{server}/log.csv")
    path = datasets.fetch("toy")["log"]
    assert path.read_bytes() == CONTENT
    assert path.is_relative_to(tmp_path / "cache")
    (tmp_path / "published" / "log.csv").unlink()
    assert datasets.fetch("toy") == datasets.dataset_files("toy") == {"log": path}


def test_a_broken_file_in_the_cache_is_fetched_again(toy, tmp_path, monkeypatch, server):
    put(tmp_path / "published", "log.csv", CONTENT)
    put(tmp_path / "cache" / "pivident" / "toy", "log.csv", b"half")
    publish(monkeypatch, toy, f"{server}/log.csv")
    assert datasets.fetch("toy")["log"].read_bytes() == CONTENT


def test_a_published_file_that_changed_is_refused(toy, tmp_path, monkeypatch, server):
    put(tmp_path / "published", "log.csv", b"version 2")
    publish(monkeypatch, toy, f"{server}/log.csv")
    with pytest.raises(DatasetUnavailable, match="no longer holds"):
        datasets.fetch("toy")
    with pytest.raises(DatasetUnavailable):
        datasets.dataset_files("toy")


def test_without_a_network_the_next_step_is_named(toy, monkeypatch):
    publish(monkeypatch, toy, "http://127.0.0.1:9/log.csv")
    with pytest.raises(DatasetUnavailable, match=r"cannot be reached.*PIVIDENT_DATA.*toy/log\.csv"):
        datasets.fetch("toy")


def test_a_file_that_nobody_publishes_can_only_be_local(toy):
    with pytest.raises(DatasetUnavailable, match="not published"):
        datasets.fetch("toy")
    with pytest.raises(DatasetUnavailable, match="neither in PIVIDENT_DATA nor cached"):
        datasets.dataset_files("toy")


def test_unknown_names_are_answered_with_the_known_ones():
    with pytest.raises(RecordingError, match="staubli_tx40, emps"):
        datasets.fetch("puma")
    with pytest.raises(RecordingError, match="estimation, pulses"):
        datasets.fetch("emps", "validation")


def test_every_data_set_describes_itself():
    assert tuple(datasets.DATASETS) == ("staubli_tx40", "emps", "kuka_kr300", "tiago")
    for name in datasets.DATASETS:
        text = datasets.describe(name)
        assert "Licence" in text and "Cite" in text


def test_addresses_are_fixed_to_a_commit_and_hashes_are_whole():
    for dataset in datasets.DATASETS.values():
        for file in dataset.files.values():
            assert all(len(expected) == 64 for _, expected in file.forms())
            if file.url is not None:
                assert len(file.url.split("/")[5]) == 40
                assert file.url.endswith(f"/{file.name}")


@pytest.mark.record
@pytest.mark.parametrize("name", datasets.DATASETS)
def test_the_local_copies_are_the_published_files(name, data_dir, monkeypatch):
    monkeypatch.setenv("PIVIDENT_DATA", str(data_dir))
    for key, path in datasets.dataset_files(name).items():
        file = datasets.DATASETS[name].files[key]
        content = path.read_bytes()
        assert digest(gzip.decompress(content) if path.suffix == ".gz" else content) == file.sha256
