"""What is in a file or folder, whatever it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from posekit.formats import own as files
from posekit.formats.kinds import Kind, kind_of
from posekit.inspection.batches import is_shard, run_lines, run_of, shard_lines
from posekit.inspection.inspection import inspect
from posekit.inspection.reports import evaluation_lines, report_lines
from posekit.inspection.results import result_lines
from posekit.objects import object_lines
from posekit.views.source import Source


def _evaluation(path: Path) -> list[str]:
    return evaluation_lines(path, files.read_json(path))


def _report(path: Path) -> list[str]:
    return report_lines(files.read_report(path))


def _object(path: Path) -> list[str]:
    return object_lines(files.read_object(path))


OWN: Final[Mapping[str, tuple[str, Callable[[Path], list[str]]]]] = {
    "posekit.evaluation": ("an evaluation", _evaluation),
    "posekit.report": ("a report of validation", _report),
    "posekit.object": ("objects", _object),
}
"""What is told of files of some schemas, and what they are called."""


def describe(path: Path, source: Source, *, unit: str = "") -> list[str]:
    """Describe a file or folder in some lines.

    Parameters
    ----------
    path : Path
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
    what = kind_of(path, source.format)
    if what.kind is Kind.RESULT:
        return [f"{path}: a result ({what.schema})", *result_lines(files.read_result(path))]
    if what.kind is Kind.OTHER and what.schema.partition("/")[0] in OWN:
        name, lines = OWN[what.schema.partition("/")[0]]
        return [f"{path}: {name} ({what.schema})", *lines(path)]
    return inspect(path, source, unit=unit)
