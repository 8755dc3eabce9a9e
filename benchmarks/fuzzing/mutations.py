"""How a file is spoilt: bytes, tokens of a text, members of an archive, and nasty values."""

from __future__ import annotations

import gzip
import io
import random
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable

Rewrite = Callable[[bytes, random.Random], bytes]

#: Files are kept below this size [bytes]: what is slow or large has to be so out of proportion.
LARGEST = 2**16

#: Numbers that are none, or too large, too small, too long.
NUMBERS = (
    "0", "-0", "-1", "1", "2", "1e308", "1e999", "-1e-320", "nan", "inf", "-inf", "+nan", "1_0",
    "9" * 25, "9" * 400, "9" * 5000, "0x" + "f" * 5000, "0b11", "1e-400", "1.5", "4294967296",
    "18446744073709551616", "9223372036854775807", "-9223372036854775808", "1,5", "٣",
    "0." + "1" * 999,
)  # fmt: skip

#: Texts that mean something to a page, a shell, a spreadsheet, a terminal or a file system.
TEXTS = (
    "", " ", "a", "é", "\U0001f916", "<script>alert(1)</script>", "&amp;", "]]>", "'\"`", "=1+1",
    "=cmd|' /C calc'!A0", "@SUM(1)", "$(reboot)", "`id`", ";rm -rf .", "../../etc/passwd",
    "/etc/passwd", "/dev/zero", "/dev/stdin", "C:\\x", "a" * 3000, "\\u0000", "\\u001b[2J",
    "\\u202e", "%s%n", "{0}", "${pi}", "\x7f", "\u2028", "__import__('os')", "q[0]", "q[:, 0]",
    "q[99999999999999999999]", "*.csv", "file:///etc/passwd", "http://localhost:9/x", "__class__",
)  # fmt: skip


def spoilt_bytes(data: bytes, rng: random.Random) -> bytes:
    """A few bytes changed, cut out, repeated or put in."""
    body = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        at = rng.randrange(len(body) + 1)
        end = min(len(body), at + rng.choice((1, 2, 4, 8, 64, 1024)))
        match rng.randrange(7):
            case 0 if body:
                body[at % len(body)] ^= 1 << rng.randrange(8)
            case 1 if body:
                body[at % len(body)] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
            case 2:
                del body[at:end]
            case 3:
                body[at:at] = body[at:end] * rng.choice((1, 2, 50))
            case 4:
                size = rng.choice((1, 2, 4, 8))
                value = rng.choice((0, 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, rng.getrandbits(64)))
                body[at : at + size] = (value % 2 ** (8 * size)).to_bytes(size, "little")
            case 5:
                body[at:at] = rng.randbytes(rng.choice((1, 4, 32)))
            case _:
                del body[rng.choice((at, len(body) // 2)) :]
    return bytes(body[:LARGEST])


_TOKEN = re.compile(r'"[^"\n]*"|-?\d+(?:\.\d+)?(?:e-?\d+)?|\b\w+\b')


def spoilt_text(data: bytes, rng: random.Random, chunks: tuple[str, ...] = ()) -> bytes:
    """A text with tokens, lines or its encoding changed.

    Args:
        data: the text.
        rng: source of chance.
        chunks: pieces that mean something in this format.
    """
    text = data.decode("utf-8", "replace")
    if rng.random() < 0.5:
        return _gentle(text, rng).encode("utf-8", "replace")[:LARGEST]
    for _ in range(rng.choice((1, 1, 2, 3))):
        lines = text.split("\n")
        line = rng.randrange(len(lines))
        match rng.randrange(8):
            case 0 | 1 | 2:
                text = _other_token(text, rng)
            case 3:
                del lines[line]
                text = "\n".join(lines)
            case 4:
                lines.insert(rng.randrange(len(lines) + 1), lines[line])
                text = "\n".join(lines)
            case 5:
                other = rng.randrange(len(lines))
                lines[line], lines[other] = lines[other], lines[line]
                text = "\n".join(lines)
            case _ if chunks:
                at = rng.randrange(len(text) + 1)
                text = text[:at] + rng.choice(chunks) + text[at:]
            case _:
                at = rng.randrange(len(text) + 1)
                text = text[:at] + rng.choice(TEXTS + NUMBERS) + text[at:]
    text = text[:LARGEST]
    if rng.random() < 0.95:
        return text.encode("utf-8", "replace")
    encoding = rng.choice(("utf-16", "utf-8-sig", "latin-1", "utf-7", "utf-32"))
    return text.encode(encoding, "replace")


def _gentle(text: str, rng: random.Random) -> str:
    """A text that mostly still means something: a number changed, a line away or there twice."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        numbers = list(re.finditer(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text))
        lines = text.split("\n")
        match rng.randrange(4):
            case 0:
                del lines[rng.randrange(len(lines))]
                text = "\n".join(lines)
            case 1:
                lines.insert(rng.randrange(len(lines) + 1), rng.choice(lines))
                text = "\n".join(lines)
            case _ if numbers:
                old = rng.choice(numbers)
                new = rng.choice(
                    (f"{rng.gauss(0, 3):.3g}", str(rng.randrange(9)), rng.choice(NUMBERS))
                )
                text = text[: old.start()] + new + text[old.end() :]
    return text


def _other_token(text: str, rng: random.Random) -> str:
    """The text with one number, name or quoted text replaced, mostly by one of its kind."""
    tokens = list(_TOKEN.finditer(text))
    if not tokens:
        return text
    token = rng.choice(tokens)
    old = token.group()
    if rng.random() < 0.15:
        new = rng.choice(tokens).group()
    elif old.startswith('"'):
        value = rng.choice(TEXTS + NUMBERS) if rng.random() < 0.9 else old[1:-1] * 2
        new = f'"{value}"'
    elif old[0].isdigit() or old[0] == "-":
        new = rng.choice(NUMBERS) if rng.random() < 0.5 else f"{abs(rng.gauss(0, 3)):.3g}"
        new = new if rng.random() < 0.9 else f'"{rng.choice(TEXTS)}"'
    else:
        new = rng.choice(TEXTS)
    return text[: token.start()] + new + text[token.end() :]


def packed(content: bytes) -> bytes:
    """Content as a gzip file."""
    return gzip.compress(content, 1)


def inside_gzip(rewrite: Rewrite) -> Rewrite:
    """A change of what a gzip file holds, packed again."""

    def rewritten(data: bytes, rng: random.Random) -> bytes:
        try:
            content = gzip.decompress(data)
        except (OSError, EOFError, zlib.error):
            return spoilt_bytes(data, rng)
        return gzip.compress(rewrite(content, rng), 1)[:LARGEST]

    return rewritten


def inside_zip(data: bytes, rng: random.Random) -> bytes:
    """An archive with its members changed, renamed or repeated, with right checksums."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [(info.filename, archive.read(info)) for info in archive.infolist()]
    except Exception:
        return spoilt_bytes(data, rng)
    if not members:
        return spoilt_bytes(data, rng)
    at = rng.randrange(len(members))
    name, content = members[at]
    match rng.randrange(6):
        case 0 | 1:
            members[at] = name, spoilt_header(content, rng)
        case 2:
            members[at] = name, spoilt_bytes(content, rng)
        case 3:
            members[at] = rng.choice(TEXTS).replace("\\u0000", "\0") + ".npy", content
        case 4:
            members.append((name, content))
        case _:
            members[at] = name, b"\0" * rng.choice((0, 10, 2**20))
    packed = io.BytesIO()
    warnings.simplefilter("ignore")  # of a name that is there twice
    method = rng.choice(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    with zipfile.ZipFile(packed, "w", method) as archive:
        for name, content in members:
            archive.writestr(name or "x", content)
    return packed.getvalue()[: 4 * LARGEST]


#: What may stand in the header of an array.
HEADERS = (
    "'descr': '|O'", "'descr': '<f8'", "'descr': '<c16'", "'descr': '<M8[s]'", "'descr': '<U9'",
    "'descr': [('a', '<f8')]", "'descr': 3", "'descr': '|V999999999'", "'fortran_order': 3",
    "'shape': (3,)", "'shape': (-1,)", "'shape': (99999999999,)", "'shape': (2**99,)",
    "'shape': " + "(" * 200 + ")" * 200, "'shape': (True, 2)", "'shape': (0,)", "'shape': 3",
    "'shape': (" + "1," * 70 + ")", "'x': 1", "'shape': (9" + "9" * 60 + ",)",
    "'descr': '<f8\\x00'",
)  # fmt: skip


def spoilt_header(content: bytes, rng: random.Random) -> bytes:
    """A .npy array whose header says something else, its length made right."""
    end = content.find(b"\n")
    if not content.startswith(b"\x93NUMPY") or end < 0:
        return spoilt_bytes(content, rng)
    header = content[10:end].decode("latin-1")
    chunk = rng.choice(HEADERS)
    key = chunk.split(":")[0]
    if key in header and rng.random() < 0.9:
        header = re.sub(rf"{key}: (\([^)]*\)|[^,}}]*)", lambda _: chunk, header)
    else:
        header = spoilt_text(header.encode(), rng, HEADERS).decode("latin-1")
    if rng.random() < 0.05:
        header = rng.choice(("(" * 900, "{" * 5000, "[" * 3000 + "]" * 3000, "-" * 5000 + "1"))
    line = header.encode("utf-8") + b"\n"
    version = rng.choice(((1, 0), (1, 0), (1, 0), (2, 0), (3, 0), (9, 9)))
    size = (
        len(line).to_bytes(2 if version == (1, 0) else 4, "little", signed=False)
        if len(line) < 65536
        else b"\xff\xff"
    )
    return b"\x93NUMPY" + bytes(version) + size + line + content[end + 1 :]


def inside_mat(data: bytes, rng: random.Random) -> bytes:
    """A MATLAB file of version 5 with a packed element unpacked, changed and packed again."""
    at, kind = 128, 15
    elements = []
    while at + 8 <= len(data):
        kind = int.from_bytes(data[at : at + 4], "little")
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        elements.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    if not elements:
        return spoilt_bytes(data, rng)
    chosen = rng.randrange(len(elements))
    kind, body = elements[chosen]
    if kind == 15:
        try:
            body = zlib.decompress(body)
        except zlib.error:
            return spoilt_bytes(data, rng)
        elements[chosen] = 15, zlib.compress(_spoilt_words(body, rng), 1)
    else:
        elements[chosen] = kind, _spoilt_words(body, rng)
    packed = [k.to_bytes(4, "little") + len(b).to_bytes(4, "little") + b for k, b in elements]
    return data[:128] + b"".join(packed)


def _spoilt_words(body: bytes, rng: random.Random) -> bytes:
    """One of the first 32-bit words, which hold types, sizes and shapes, or any byte changed."""
    if rng.random() < 0.4 or len(body) < 8:
        return spoilt_bytes(body, rng)
    at = 4 * rng.randrange(min(len(body) // 4, 24))
    values = (
        0,
        1,
        2,
        3,
        5,
        6,
        7,
        9,
        13,
        14,
        15,
        16,
        17,
        2**16,
        2**24,
        2**31 - 1,
        2**32 - 1,
        rng.getrandbits(32),
    )
    return body[:at] + rng.choice(values).to_bytes(4, "little") + body[at + 4 :]


#: What may stand in the place of a length, a count, a number of a channel or a definition.
WORDS = (0, 1, 2, 3, 4, 8, 40, 255, 2**16 - 1, 2**24, 2**31 - 1, 2**31, 2**32 - 1)
DEFINITIONS = (
    b"float64[]", b"string[] ", b"float64[99999999] x\n", b"a/B x\n", b"sensor_msgs/JointState x\n",
    b"wstring s\n", b"MSG: std_msgs/Header\n", b"bool[] ", b"string", b"time[] ", b"=",
    b"Header[] h\n",
)  # fmt: skip


def spoilt_bag(data: bytes, rng: random.Random) -> bytes:
    """A bag with lengths, words of its definition, or single bytes changed, or an end cut off."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(max(len(changed) - 8, 1))
        match rng.randrange(6):
            case 0:
                word = rng.choice(WORDS).to_bytes(4, "little")
                changed[at : at + 4] = word
            case 1:
                changed[at : at + 8] = rng.choice((*WORDS, 2**63, 2**64 - 1)).to_bytes(8, "little")
            case 2:
                changed[at] = rng.randrange(256)
            case 3:  # the definition is text, and found by what stands in it
                at = changed.find(rng.choice((b"float64", b"string", b"Header", b"MSG")))
                if at >= 0:
                    word = rng.choice(DEFINITIONS)
                    changed[at : at + len(word)] = word
            case 4:
                length = rng.choice((1, 9, 100))
                changed[at:at] = changed[at : at + length]
            case _:
                del changed[at : at + rng.choice((1, 4, 100, len(changed)))]
    return bytes(changed[:LARGEST])
