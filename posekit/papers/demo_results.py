"""`posekit demo`: the main job on the built-in views, in one go."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from posekit.body import load_figure
from posekit.display.plural import plural
from posekit.formats.markdown import table_lines
from posekit.formats.own import (
    Postures,
    View,
    read_postures,
    write_postures,
    write_report,
    write_result,
    write_view,
)
from posekit.papers.lee_chen import reproduce_lee_chen
from posekit.recovery.conductor import recover
from posekit.recovery.recovery import Recovery
from posekit.recovery.result import result_of
from posekit.safe_io.writing import write_lines
from posekit.synthesis import random_views
from posekit.validation.judging import validate_postures
from posekit.validators import PHYSICAL_CHECKS, Validator
from posekit.viewer.illustrate import illustrate
from posekit.views.builtin import builtin_view, view_of

DEMO_SEED = 1985
RANDOM_VIEWS = 20


def demo(folder: Path, *, pictures: bool = True) -> Iterator[str]:
    """Recover the built-in views, validate the survivors, reproduce the paper; yield what to print.

    Parameters
    ----------
    folder : Path
        Where views, results, pictures, reports and tables are written; must exist.
    pictures : bool
        Whether to draw the results too.
    """
    random = view_of(
        random_views(load_figure(), RANDOM_VIEWS, np.random.default_rng(DEMO_SEED), ranges="urdf")
    )
    jobs = (
        ("seq1", builtin_view("seq1"), PHYSICAL_CHECKS),
        ("seq2", builtin_view("seq2"), PHYSICAL_CHECKS),
        ("seq1-walking", builtin_view("seq1"), (*PHYSICAL_CHECKS, "walking")),
        ("random", random, PHYSICAL_CHECKS),
    )
    rows = []
    for name, view, checks in jobs:
        write_view(folder / f"{name}.view.json", view)
        recovery = recover(view, checks=checks, ranges="urdf", group=0.05)
        result = result_of(recovery, unit=view.unit, explain=True)
        write_result(folder / f"{name}.result.json", result)
        if pictures:
            yield from illustrate(folder, name, result, view)
        rows.append((name, *_row(view, recovery)))
        yield f"{name}: {plural(rows[-1][3], 'posture')} in {plural(rows[-1][1], 'frame')}"
    head = (
        "view",
        "frames",
        "leaves",
        "postures",
        "most in a frame",
        "input among them",
        "furthest FK joint, m",
    )
    table = ["# posekit demo", "", *table_lines(head, rows)]
    given = read_postures(folder / "seq1.result.json")
    report = validate_postures(Validator(ranges="urdf", strict=True), given)
    write_report(folder / "seq1.report.json", report)
    write_postures(folder / "seq1.postures.json", Postures(joints=given.joints))
    table += [
        f"Validated again from the file: {report.summary['valid']} of {plural(len(report.postures), 'posture')} valid.",
        "",
    ]
    write_lines(folder / "demo.md", table)
    yield from table[2:]
    reproduce_lee_chen(folder, pictures=pictures)
    drawn = ", pictures (*.png), pages (*.page.html)" if pictures else ""
    yield f"written: {folder}: views, results, reports, demo.md, lee-chen.md{drawn}"


def _row(view: View, recovery: Recovery) -> tuple[int, int, int, int, str, str]:
    counts = [len(frame) for frame in recovery.frames]
    found = 0
    for frame, truth in zip(recovery.frames, view.truth, strict=True):
        error = np.linalg.norm(frame.joints - truth, axis=-1).max(axis=1)
        found += bool((error < 1e-6).any())
    distance = max((float(frame.fk_distance.max(initial=0.0)) for frame in recovery.frames), default=0.0)
    return (
        len(counts),
        8192 * len(counts),
        sum(counts),
        max(counts),
        f"{found} of {len(counts)}",
        f"{distance:.1e}",
    )
