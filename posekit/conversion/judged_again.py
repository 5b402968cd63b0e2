"""A file that was repaired, judged again as whoever validates it next would judge it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from posekit.formats.own import ValidationReport
from posekit.formats.own.report_schema import VERDICT_NAMES
from posekit.remedy import Repaired, UnrepairedFrame
from posekit.validation import WantedDetail, validate_files
from posekit.validation.files import AskedValidation
from posekit.validation.reading import StatedMotion


def as_read_again(asked: AskedValidation) -> AskedValidation:
    """Return what is asked of a file that was written: it says itself its unit, its axes and its rate."""
    return replace(asked, stated=StatedMotion(body_model=asked.stated.body_model))


def judged_again(path: Path, asked: AskedValidation) -> ValidationReport:
    """Judge a written file as `posekit validate` does: its lengths and its noise are measured anew.

    Parameters
    ----------
    path : Path
        The file.
    asked : AskedValidation
        By what its source was judged.
    """
    return validate_files([path], as_read_again(asked), wanted=WantedDetail(detail="findings"))


def records_judged(records: Sequence[Repaired], report: ValidationReport) -> Iterator[Repaired]:
    """Let records of the clips of one file say what a fresh validation of the file still rejects.

    Parameters
    ----------
    records : sequence of Repaired
        Of each clip of the file.
    report : ValidationReport
        Of `judged_again`.
    """
    count = len(report)
    valid = (
        np.array([posture.verdict == "valid" for posture in report.postures], dtype=np.bool_)
        if report.columns is None
        else report.columns.verdict == VERDICT_NAMES.index("valid")
    )
    several = len(records) > 1 and report.frames is not None
    clip = report.frames.clip if several and report.frames is not None else np.zeros(count, dtype=np.intp)
    left: list[list[UnrepairedFrame]] = [[] for _ in records]
    for k, posture in enumerate(report.postures):
        row = k if posture.index is None else posture.index
        left[int(clip[row])] += [
            UnrepairedFrame(
                frame=row if posture.frame is None else posture.frame,
                check=finding.check.replace("_", "-"),
                place=finding.where,
                left=-float(finding.margin or 0.0),
                unit=finding.unit,
            )
            for finding in posture.findings
            if finding.verdict == "invalid"
        ]
    for index, record in enumerate(records):
        yield replace(record, left=tuple(left[index]), valid=valid[clip == index])
