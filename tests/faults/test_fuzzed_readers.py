"""Every reader with a few spoilt files: an answer or a PividentError, nothing else."""

import contextlib
import random

import pytest
from fuzzing.readers import READERS
from hypothesis import HealthCheck, given, settings, strategies as st

from pivident.foundation.errors import PividentError
from pivident.robot.modified_dh import parse_modified_dh
from pivident.robot.urdf import parse_urdf

#: Spoilt files of each reader; `benchmarks/fuzz_readers.py` takes a thousand times as many.
EXAMPLES = 60

some = settings(
    max_examples=EXAMPLES,
    derandomize=True,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    database=None,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzzed")


@pytest.mark.parametrize("name", READERS)
def test_seeds_are_read(name, folder):
    reader = READERS[name]
    path = folder / name / reader.file
    path.parent.mkdir()
    answers = 0
    for data in reader.seeds():
        path.write_bytes(data)
        with contextlib.suppress(PividentError):
            reader.read(path)
            answers += 1
    assert answers, "no seed is a file that can be read"


@pytest.mark.parametrize("name", READERS)
def test_spoilt_files_are_read_or_refused(name, folder):
    reader = READERS[name]
    seeds = reader.seeds()
    path = folder / f"{name}-spoilt" / reader.file
    path.parent.mkdir()

    @some
    @given(st.integers(0, 2**32))
    def spoil(seed):
        rng = random.Random(seed)
        data = rng.choice(seeds)
        for _ in range(rng.randrange(1, 3)):
            data = reader.mutated(data, rng)
        path.write_bytes(data)
        with contextlib.suppress(PividentError):
            reader.read(path)

    spoil()


@some
@given(st.text(max_size=30), st.text(max_size=30))
def test_any_text_as_a_name_of_a_urdf(link, joint):
    from xml.sax.saxutils import quoteattr

    ends = f'<parent link="a"/><child link={quoteattr(link)}/>'
    text = (
        f'<robot name="r"><link name="a"/><link name={quoteattr(link)}/>'
        f'<joint name={quoteattr(joint)} type="revolute">{ends}</joint></robot>'
    )
    with contextlib.suppress(PividentError):
        # XML turns line ends in attributes into blanks, and Python's UTF-8 knows no surrogates.
        robot = parse_urdf(text.encode("utf-8", "replace"))
        assert not any(c in name for name in robot.joint_names for c in "\x1b\x9b\u202e\n")


@some
@given(st.text(max_size=200))
def test_any_text_as_a_robot_file(text):
    for parse in (parse_modified_dh, parse_urdf):
        with contextlib.suppress(PividentError):
            parse(text)
