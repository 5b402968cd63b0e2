"""Results as packed JSON: the same as plain ones, and no more than is allowed comes out of a small file."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.safe_io import read_json, regular_file


@pytest.fixture
def result(command: Callable[..., Any], tmp_path: Path) -> Path:
    """Return a packed result of two frames."""
    view, path = tmp_path / "view.json", tmp_path / "result.json.gz"
    assert command("synth", "walker", "-o", view, "--frames", 2).code == 0
    assert command("recover", view, "-o", path).code == 0
    return path


def test_a_packed_result_goes_everywhere(result: Path, command: Callable[..., Any], tmp_path: Path) -> None:
    packed, plain = posekit.read_result(result), tmp_path / "plain.json"
    posekit.write_result(plain, packed)
    assert json.loads(gzip.decompress(result.read_bytes())) == json.loads(plain.read_text())
    assert result.stat().st_size < plain.stat().st_size / 3
    for words in (
        ("validate",),
        ("inspect",),
        ("convert", tmp_path / "out.csv"),
        ("convert", tmp_path / "out.bvh"),
    ):
        done = command(words[0], result, *words[1:])
        assert done.code == 0, done.err
    posekit.write_result(tmp_path / "again.json.gz", packed)
    assert (tmp_path / "again.json.gz").read_bytes() == result.read_bytes()
    np.testing.assert_array_equal(packed.frames[0].joints, posekit.read_result(plain).frames[0].joints)


def test_what_is_packed_has_a_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bomb.json.gz"
    path.write_bytes(gzip.compress(b"[" + b" " * 5_000_000 + b"]"))
    assert read_json(path) == []
    monkeypatch.setattr(regular_file, "MAX_UNPACKED", 1_000_000)
    with pytest.raises(InputError, match="more than 1,000,000 bytes unpacked"):
        read_json(path)


@pytest.mark.parametrize("damage", ["cut off", "plain", "nothing"])
def test_a_damaged_file_is_refused_in_one_line(
    damage: str, result: Path, command: Callable[..., Any]
) -> None:
    data = result.read_bytes()
    result.write_bytes({"cut off": data[:400], "plain": b"{}", "nothing": gzip.compress(b"")}[damage])
    for name in ("validate", "inspect"):
        done = command(name, result)
        assert done.code == 2
        assert done.err.count("\n") == 1
