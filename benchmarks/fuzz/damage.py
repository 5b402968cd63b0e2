"""Damage: bytes changed, cut out, doubled, exchanged, and numbers and words of the grammars put in."""

from __future__ import annotations

import io
import random
import re
import zipfile
from typing import Final

GRAMMAR_MARKS: Final = (
    *(
        b"<",
        b">",
        b"/>",
        b'"',
        b"'",
        b"&",
        b"&#0;",
        b"<!DOCTYPE a>",
        b"<!ENTITY b 'c'>",
        b"]]>",
        b"<![CDATA[",
    ),
    *(
        b"[",
        b"]",
        b"{",
        b"}",
        b",",
        b":",
        b"[" * 100,
        b"=",
        b"\n",
        b"#",
        b"a.b.c.d",
        b"'''",
        b'"""',
        b"\t",
        b"|",
    ),
    *(
        b"\0",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\xed\xa0\x80",
        b"\x07",
        b"\x1b]0;x\x07",
        b"null",
        b"true",
        b'"x"',
    ),
)
ODD_NUMBERS: Final = (
    *(
        b"nan",
        b"inf",
        b"-inf",
        b"NaN",
        b"-1",
        b"0",
        b"-0",
        b"",
        b"1_0",
        b"9" * 400,
        b"1e999",
        b"1e308",
        b"-1e308",
    ),
    *(
        b"1e200",
        b"1e-320",
        b"2147483648",
        b"9223372036854775808",
        b"0x10",
        b"1.5.2",
        b"00",
        b"1e6",
        b"0.5",
        b"3",
    ),
)


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return data, changed in one to four places; of a ZIP as often inside its members."""
    if data[:2] == b"PK" and rng.random() < 0.6:
        return _members_damaged(data, rng)
    for _ in range(rng.randint(1, 4)):
        data = _once(data, rng)
    return data


def _once(data: bytes, rng: random.Random) -> bytes:
    """Change data in one place."""
    start = rng.randrange(max(len(data), 1))
    length = rng.randint(0, 8) if rng.random() < 0.7 else rng.randint(0, len(data) // 2)
    kind = rng.choice(("number", "number", "mark", "cut", "double", "move", "byte", "end", "line"))
    if kind == "number":
        numbers = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", data[start : start + 4000]))
        if numbers:
            number = rng.choice(numbers)
            return data[: start + number.start()] + rng.choice(ODD_NUMBERS) + data[start + number.end() :]
        kind = "mark"
    if kind == "mark":
        return data[:start] + rng.choice(GRAMMAR_MARKS) + data[start + min(length, 8) :]
    if kind == "line":
        lines = data.split(b"\n")
        at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[at] = rng.choice((b"", lines[other], lines[at] + b"\n" + lines[at]))
        return b"\n".join(lines)
    piece = data[start : start + length]
    place = rng.randrange(max(len(data), 1))
    return {
        "cut": data[:start] + data[start + length :],
        "double": data[:start] + piece + data[start:],
        "move": data[:place] + piece + data[place:],
        "byte": data[:start] + bytes([rng.randrange(256)]) + data[start + 1 :],
        "end": data[:start],
    }[kind]


def _members_damaged(data: bytes, rng: random.Random) -> bytes:
    """Damage, drop or exchange a member of an archive, which stays a whole archive."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, other = rng.choice(sorted(members)), rng.choice(sorted(members))
    kind = rng.choice(("bytes", "bytes", "floats", "drop", "exchange", "rename"))
    if kind == "bytes":
        members[name] = damaged(members[name], rng)
    elif kind == "floats" and len(members[name]) > 136:
        place = rng.randrange(128, len(members[name]) - 7) & ~7
        odd = rng.choice((b"\0\0\0\0\0\0\xf8\x7f", b"\0\0\0\0\0\0\xf0\x7f", b"\xff" * 7 + b"\x7f", b"\0" * 8))
        members[name] = members[name][:place] + odd + members[name][place + 8 :]
    elif kind == "drop":
        del members[name]
    elif kind == "exchange":
        members[name] = members[other]
    else:
        members[f"{name[:-4]}x.npy"] = members.pop(name)
    with zipfile.ZipFile(out, "w") as archive:
        for member, held in members.items():
            archive.writestr(member, held)
    return out.getvalue()
