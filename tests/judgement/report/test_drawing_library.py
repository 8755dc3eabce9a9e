"""The drawing library comes out of the page as it went in, whatever the packer did."""

import base64
import json
import random
import sys
import zlib
from pathlib import Path

import pytest
from plotly.offline import get_plotlyjs

import pivident.judgement.report
from pivident.foundation.document.plot import deflated, drawing_library
from tests.browser import asked, needs_browser

SCRIPT = Path(pivident.judgement.report.__file__).parent / "templates" / "inflate.js"

STRATEGIES = (zlib.Z_DEFAULT_STRATEGY, zlib.Z_FIXED, zlib.Z_HUFFMAN_ONLY)


def packed(text, level, strategy):
    packer = zlib.compressobj(level, wbits=-15, strategy=strategy)
    return base64.b64encode(packer.compress(text) + packer.flush()).decode()


def test_it_is_deflated_and_nothing_else():
    found = drawing_library()
    text = zlib.decompress(base64.b64decode(found.packed), wbits=-15)
    assert text.decode() == get_plotlyjs()
    assert len(text) == found.size
    assert len(found.packed) < 0.45 * found.size


def test_it_is_packed_once(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    found = deflated(b"text", tmp_path)
    (kept,) = tmp_path.iterdir()
    monkeypatch.setattr(zlib, "compressobj", None)  # what packs
    assert deflated(b"text", tmp_path) == found
    assert list(tmp_path.iterdir()) == [kept]


@pytest.mark.parametrize("damage", [lambda x: b"", lambda x: x[:-1], lambda x: x[:40] + b"A" * 9])
def test_what_is_damaged_or_of_another_text_is_packed_again(tmp_path, monkeypatch, damage):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    deflated(b"text", tmp_path)
    (kept,) = tmp_path.iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(damage(whole))
    for text in (b"text", b"another"):
        assert zlib.decompress(base64.b64decode(deflated(text, tmp_path)), wbits=-15) == text
    assert kept.read_bytes() == whole


def test_nothing_is_kept_where_python_writes_no_bytecode(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert deflated(b"text", tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def samples():
    noise = random.Random(4).randbytes(90_000)
    return {
        "empty": b"",
        "one": b"a",
        "long runs": b"a" * 70_000,
        "noise": noise,
        "both": noise[:999] * 9 + b"ab" * 400 + noise,
        "words": "Kräfte und Momente ‖τ − Φθ‖ ".encode() * 3000,
    }


@needs_browser
def test_the_page_unpacks_every_kind_of_block(samples, tmp_path):
    cases = [
        (f"{name}, level {level}, strategy {strategy}", text, packed(text, level, strategy))
        for name, text in samples.items()
        for level in (0, 1, 9)
        for strategy in STRATEGIES
    ]
    sent = json.dumps([[name, len(text), zlib.crc32(text), own] for name, text, own in cases])
    question = """
    const table = Array.from({ length: 256 }, (_, k) => {
      for (let bit = 0; bit < 8; bit += 1) k = k & 1 ? (k >>> 1) ^ 0xedb88320 : k >>> 1;
      return k >>> 0;
    });
    const checksum = (bytes) =>
      ~bytes.reduce((sum, byte) => (sum >>> 8) ^ table[(sum ^ byte) & 255], -1) >>> 0;
    return CASES.map(([name, size, wanted, packed]) => {
      const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
      return [name, checksum(inflate(bytes, size)) === wanted];
    });"""
    page = f"<!doctype html><html><head></head><body><script>{SCRIPT.read_text()}</script></body>"
    found = asked(page, tmp_path, question.replace("CASES", sent))
    assert len(found) == len(cases) == 54
    assert [name for name, same in found if not same] == []
