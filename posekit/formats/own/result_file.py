"""Read ``posekit.result/2`` and ``/1``, write ``/2``; the suffix decides between JSON, NPZ and Parquet."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from posekit.formats.own.npz import suffix
from posekit.formats.own.result import Result
from posekit.safe_io.extras import extra
from posekit.safe_io.refusal import refusal
from posekit.safe_io.regular_file import plain_suffix
from posekit.safe_io.writing import check_target

RESULT_SUFFIXES: Final = (".json", ".npz", ".parquet")


def read_result(path: str | Path) -> Result:
    """Read a result, in metres.

    Parameters
    ----------
    path : path
        ``.json``, ``.json.gz``, ``.npz`` or ``.parquet``.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        Where the file breaks its schema, ``posekit.result/2`` or ``posekit.result/1``.

    Notes
    -----
    In JSON margins and groups are written with each posture; where no frame has a survivor, none are read.
    """
    kind = suffix(path, *RESULT_SUFFIXES)
    if kind == ".json":
        from posekit.formats.own.result_json import read_result_json

        return read_result_json(path)
    if kind == ".parquet":
        from posekit.formats.own.result_parquet import read_result_parquet

        return read_result_parquet(path)
    from posekit.formats.own.result_npz import read_result_npz

    return read_result_npz(path)


def check_result_path(path: str | Path) -> None:
    """Refuse a result's name before the work that it is for is done."""
    if plain_suffix(path) == ".csv":
        says = "write .npz, and then: posekit convert RESULT.npz TABLE.csv --posture all"
        raise refusal(path, "", 'the suffix ".csv"', f"a result: {' or '.join(RESULT_SUFFIXES)}", says)
    if suffix(path, *RESULT_SUFFIXES) == ".parquet":
        extra("pyarrow.parquet", "parquet", "writing Parquet")
    check_target(path)


def write_result(path: str | Path, result: Result) -> None:
    """Write a result, whole or not at all.

    Parameters
    ----------
    path : path
        ``.json``, ``.json.gz``, or ``.npz``, which is five times faster to write and to read.
    result : Result
        What to write; lengths are turned into ``result.unit``.

    Raises
    ------
    InputError
        Where the file cannot be written, or would be larger than can be read again.
    """
    if suffix(path, ".json", ".npz") == ".json":
        from posekit.formats.own.result_json import write_result_json

        write_result_json(path, result)
    else:
        from posekit.formats.own.result_npz import write_result_npz

        write_result_npz(path, result)
