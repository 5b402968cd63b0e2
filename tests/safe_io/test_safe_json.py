"""What others wrote is refused in one line, whatever is wrong with it."""

import json
import os
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.safe_io import parse_json, read_json
from posekit.safe_io.json_file import MAX_BYTES, MAX_DEPTH, nesting

numbers = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**20), 10**20)
documents = st.recursive(
    st.none() | st.booleans() | numbers | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=20,
)


def refusal_of(tmp_path, content: bytes | str) -> str:
    path = tmp_path / "in.json"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as caught:
        read_json(path)
    text = str(caught.value)
    assert text.isprintable()
    assert text.startswith(f"{path}: ")
    assert "got " in text
    assert "; expected " in text
    return text.removeprefix(f"{path}: ")


@given(documents)
def test_what_json_writes_is_read_back(document):
    assert parse_json("x", json.dumps(document).encode()) == document
    assert parse_json("x", json.dumps(document, ensure_ascii=False, indent=1).encode()) == document


def depth_of(document) -> int:
    if isinstance(document, dict | list):
        inner = document.values() if isinstance(document, dict) else document
        return 1 + max(map(depth_of, inner), default=0)
    return 0


@given(documents)
def test_nesting_is_counted_as_a_walk_counts_it(document):
    assert nesting(json.dumps(document).encode())[0] == depth_of(document)


@given(st.binary(max_size=60) | st.text('[]{}":,\\ 01eE+-.naNIf', max_size=60).map(str.encode))
def test_any_bytes_are_read_or_refused(data):
    try:
        parse_json("x", data)
    except InputError as error:
        assert str(error).isprintable()


def test_a_byte_order_mark_is_skipped(tmp_path):
    (tmp_path / "a.json").write_bytes(b"\xef\xbb\xbf[1]")
    assert read_json(tmp_path / "a.json") == [1]


@pytest.mark.parametrize(
    ("content", "where"),
    [
        ('{"a": 1,\n "b" 3}', "line 2 column 6: got"),
        ("[1,", "line 1 column 4: got the end of the file"),
        ("[1] 2", "line 1 column 5: got"),
        ('"open', "line 1 column 1: got"),
        ("[1, NaN, ", "line 1 column 10: got the end of the file"),
        ("nonsense\n\x1b[31m", "line 1 column 1: got"),
    ],
)
def test_malformed_json_names_line_and_column(tmp_path, content, where):
    assert refusal_of(tmp_path, content).startswith(where)


@pytest.mark.parametrize(
    "literal", ["NaN", "Infinity", "-Infinity", "1e400", "-1e400", "9" * 400, "9" * 5000]
)
def test_numbers_that_no_float_holds_name_their_field(tmp_path, literal):
    text = refusal_of(tmp_path, f'{{"a": [0, {{"b": {literal}}}]}}')
    assert text.startswith(f"a[1].b: got {literal[:40]}")
    assert "expected a finite number" in text


def test_repeated_keys_are_refused(tmp_path):
    text = refusal_of(tmp_path, '{"frames": [{"x": 1}, {"x": 1, "x": 2}]}')
    assert text.startswith("frames[1].x: got the same key twice")


@pytest.mark.parametrize(
    "bomb", ["[" * 100_000, "[" * 100_000 + "]" * 100_000, '{"a":' * 100_000, "[" * 65 + "]" * 65]
)
def test_nesting_bombs_are_refused_before_parsing(tmp_path, bomb):
    text = refusal_of(tmp_path, bomb)
    assert "nested levels; expected at most 64" in text


def test_the_deepest_nesting_allowed_is_read():
    assert parse_json("x", ("[" * MAX_DEPTH + "]" * MAX_DEPTH).encode())


def test_brackets_in_strings_nest_nothing():
    text = "[" * 1000
    assert parse_json("x", json.dumps([text, '"' + text, "\\" + text]).encode())


def test_the_parsers_own_recursion_limit_is_an_input_error():
    limit = sys.getrecursionlimit()

    def deep(levels):
        return parse_json("x", b"[" * 60 + b"]" * 60) if levels == 0 else deep(levels - 1)

    here = len(__import__("inspect").stack())
    for levels in range(limit - here - 70, limit - here - 8, 3):
        try:
            deep(levels)
        except (InputError, RecursionError):
            continue  # the stack may also end in this test's own frames; that is no fault of the file


def test_many_empty_lists_are_refused(tmp_path):
    text = refusal_of(tmp_path, b"[" + b"[]," * 10_000_001 + b"0]")
    assert "10,000,002 lists and objects" in text


def test_an_unterminated_string_of_escaped_quotes_is_linear():
    with pytest.raises(InputError, match="unterminated string"):
        parse_json("x", b'"' + b'\\"' * 1_000_000)


def test_more_than_100_megabytes_are_refused_by_size_alone(tmp_path):
    path = tmp_path / "large.json"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(InputError, match=r"large\.json: got 100\.0 MB; expected at most 100 MB"):
        read_json(path)
    os.truncate(path, 0)


def test_files_that_are_none_are_refused(tmp_path):
    (tmp_path / "empty.json").touch()
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "loop.json").symlink_to(tmp_path / "loop.json")
    for name, reason in [
        ("missing.json", "No such file"),
        ("", "a directory"),
        ("empty.json", "an empty file"),
        ("pipe.json", "a pipe or a device"),
        ("loop.json", "symbolic links"),
        ("a\nb.json", "No such file"),
        ("a\0b.json", "null"),
    ]:
        with pytest.raises(InputError, match=reason) as caught:
            read_json(tmp_path / name)
        assert str(caught.value).isprintable()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_an_unreadable_file_is_refused(tmp_path):
    path = tmp_path / "secret.json"
    path.write_text("[]")
    path.chmod(0)
    with pytest.raises(InputError, match="Permission denied"):
        read_json(path)


def test_text_that_is_not_utf8_names_the_byte(tmp_path):
    assert refusal_of(tmp_path, b'["\xff"]').startswith("byte 2: got 0xff; expected text in UTF-8")
    assert "UTF-8" in refusal_of(tmp_path, '{"a": 1}'.encode("utf-16"))


def test_long_and_odd_keys_stay_on_one_line(tmp_path):
    text = refusal_of(tmp_path, json.dumps({"a\n" * 1000: "x"})[:-1] + ', "b": NaN}')
    assert len(text) < 300
    text = refusal_of(tmp_path, '{"\\u0007' + "k" * 1000 + '": NaN}')
    assert len(text) < 300


@pytest.mark.parametrize(
    "number",
    [
        "1" * 199 + "e99",
        "1" * 200 + "e99",
        "1" * 308,
        "-" + "1" * 307,
        "1e307",
        "1E+307",
        "1e-999",
        "0." + "0" * 400 + "1",
    ],
)
def test_a_long_number_that_a_float_holds_is_read(number: str) -> None:
    assert parse_json("x", f"[{number}]".encode()) == [json.loads(number)]


@pytest.mark.parametrize(
    "number", ["1" * 211 + "e99", "1" * 309, "1" * 310 + ".5", "1e309", "1E+0999", "-9e999"]
)
def test_a_number_that_no_float_holds_is_refused(number: str) -> None:
    with pytest.raises(InputError, match="expected a finite number"):
        parse_json("x", f"[{number}]".encode())
