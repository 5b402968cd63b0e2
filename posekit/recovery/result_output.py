"""A result, written in any of its formats: in Parquet it stands beside the table of its survivors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from posekit.formats.own.result_file import write_result as write_json_or_npz
from posekit.safe_io.regular_file import plain_suffix

if TYPE_CHECKING:
    from posekit.formats.motion import SurvivorTable
    from posekit.formats.own import Result


def write_result(path: str | Path, result: Result) -> None:
    """Write a result, whole or not at all.

    Parameters
    ----------
    path : path
        ``.json``, ``.json.gz``; ``.npz``, which is five times faster to write and to read; or ``.parquet``, whose table
        of survivors pandas reads as well.
    result : Result
        What to write; lengths are turned into ``result.unit``, those of the table are in metres.

    Raises
    ------
    InputError
        Where the file cannot be written, or would be larger than can be read again.
    """
    if plain_suffix(path) == ".parquet":
        from posekit.formats.own.result_parquet import write_result_parquet

        write_result_parquet(path, result, table_of(result))
    else:
        write_json_or_npz(path, result)


def table_of(result: Result) -> SurvivorTable:
    """Return all survivors of a result, the likeliest of each frame first, in its camera's world where that is known.

    Parameters
    ----------
    result : Result
        The result; where no frame has a survivor, the table has no row.
    """
    from posekit.formats.motion import SurvivorTable
    from posekit.recovery.result_sequence import sequence_of_result

    if any(len(frame.joints) for frame in result.frames):
        return sequence_of_result(result, posture="all").table()
    none = np.zeros(0)
    return SurvivorTable(
        frame=none.astype(np.int64), time=none, survivor=none.astype(np.int64), joints=np.zeros((0, 14, 3))
    )
