"""What is in a file or folder, whatever it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from posekit.formats import own as files
from posekit.formats.format import Content
from posekit.formats.recognising import recognise
from posekit.inspection.batches import is_shard, run_lines, run_of, shard_lines
from posekit.inspection.inspection import inspect
from posekit.inspection.reports import evaluation_lines, report_lines
from posekit.inspection.results import result_lines
from posekit.objects import object_lines
from posekit.safe_io import read_json
from posekit.views.source import Source

OWN_LINES: Final[Mapping[Content, Callable[[Path], list[str]]]] = {
    Content.RESULT: lambda path: result_lines(files.read_result(path)),
    Content.EVALUATION: lambda path: evaluation_lines(path, read_json(path)),
    Content.REPORT: lambda path: report_lines(files.read_report(path)),
    Content.OBJECTS: lambda path: object_lines(files.read_object(path)),
}
"""What is told of posekit's own files, by what they hold."""


def describe(path: Path, source: Source, *, unit: str = "") -> list[str]:
    """Describe a file or folder in some lines.

    Parameters
    ----------
    path : Path
        The file or folder to describe.
    source : Source
        How key points are to be read.
    unit : str
        Of motion capture.

    Raises
    ------
    InputError
        Where it cannot be read, is damaged, or is nothing that is known.
    """
    run = None if source.format else run_of(path)
    if run is not None:
        return [f"{path}: results of a batch (posekit.batch/1)", *run_lines(run)]
    if not source.format and is_shard(path):
        return [f"{path}: results of a batch, one shard (posekit.batch_shard/1)", *shard_lines(path)]
    what = recognise(path, source.format)
    if what.holds in OWN_LINES:
        return [f"{path}: {what.title}", *OWN_LINES[what.holds](path)]
    return inspect(path, source, unit=unit)
