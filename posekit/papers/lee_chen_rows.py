"""What Lee & Chen 1985 print, row by row, each calculated another way where there is one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_spread import CellSpread, cell_spreads
from posekit.papers.lee_chen_table2 import CameraEstimate, exact_image
from posekit.papers.lee_chen_tables34 import PAPER_TOLERANCE, SAME_POSTURE_METRES, WalkCounts, cell_names
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.posed import HIP_WORDS, PROBE_DEGREES, probes, projected_hips
from posekit.papers.rows import PaperRow, compared
from posekit.recovery import recover
from posekit.skeleton import JOINT, JOINTS, PARENTS
from posekit.synthesis import seq1
from posekit.synthesis.random_postures import random_postures
from posekit.views.builtin import view_of

PAPER_TITLE = "Lee & Chen 1985"
OPEN_WALKS = "the walk is Cutting's, whose constants are not printed; nor is a tolerance: 1 cm here"
OPEN_STEPS = f"{OPEN_WALKS}; nor the size of groups and the thresholds of rules"
SHOULDERS_WHY = {
    "seq1": "an untrue shoulder leaves the elbow out of reach by more than the 1 mm that is allowed here: see "
    "'Table 3, frame 1: the shoulders'",
    "seq2": "the shoulders' other reading breaks the torso's distances or leaves limbs out of reach, also where 5 cm "
    "are allowed for the distances (40 settings tried)",
}
N_POSTURES = 20


def lee_chen_rows(work: LeeChenWork) -> Iterator[PaperRow]:
    """Yield the rows of the paper."""
    yield from _tree_rows()
    yield from _table_1_rows()
    yield from _table_2_rows({one.way: one for one in work.estimates}, work.tables)
    for counts in work.counts.values():
        yield from _count_rows(counts, work.chosen)
    yield from _body_rows()


_row = partial(compared, PAPER_TITLE)


def _tree_rows() -> Iterator[PaperRow]:
    scene = seq1().select([0])
    (frame,) = recover(view_of(scene), checks=(), tolerance=PAPER_TOLERANCE).frames
    truth, worst = scene.joints_cam[0], 0.0
    # The optical centre is a focal length behind the origin of the paper's camera frame.
    rays = truth / truth[:, 2:]
    for joint in range(1, len(JOINTS)):
        ray, length = rays[joint], np.linalg.norm(truth[joint] - truth[PARENTS[joint]])
        for parent, end in np.unique(frame.joints[:, [PARENTS[joint], joint]], axis=0):
            roots = np.roots([ray @ ray, -2 * ray @ parent, parent @ parent - length**2]).real
            worst = max(worst, float(np.abs(np.outer(roots, ray) - end).max(axis=1).min()))
    yield _row(
        "§3.1, number of interpretations", "2^13 = 8196", f"2^13 = {2**13}", False, "arithmetic", "misprint"
    )
    yield _row(
        "§2.2, eqs. (6)-(7), Fig. 3: two positions of a joint",
        "where its ray meets the sphere of its segment",
        f"{worst:.0e} m off at most",
        worst < SAME_POSTURE_METRES,
        f"roots of the quadratic equation, for every joint of the {len(frame)} interpretations of SEQ1's frame 1",
    )


def _table_1_rows() -> Iterator[PaperRow]:
    for angle, bounds in printed.TABLE_1.items():
        inside, outside = probes(angle, bounds)
        yield _row(
            f"Table 1, {angle.replace('.', ', ').replace('_', ' ')}",
            f"{bounds[0]:g} to {bounds[1]:g} degrees",
            f"{sum(inside)} of {len(inside)} postures inside are legal, {sum(outside)} of {len(outside)} outside",
            all(inside) and not any(outside),
            f"Pinocchio bends a body by {PROBE_DEGREES:g} degrees to both sides of each bound, all else at rest; "
            "`table1` judges its joints",
        )
    yield _row(
        "§3.2.A: abduction as the angle of a projection",
        "an angle of the projection on the frontal plane",
        "`table1`: the angle out of the plane of flexion; `table1-printed`: as printed",
        False,
        f"a thigh {HIP_WORDS}: {', '.join(projected_hips())} with `table1-printed`",
        "past 90 degrees of flexion the projection turns over: the printed 0-120 degrees could never apply",
    )


def _table_2_rows(estimates: dict[str, CameraEstimate], tables: dict[str, Array]) -> Iterator[PaperRow]:
    gap = float(np.abs(exact_image() * [100, -100] - printed.IMAGE_A2).max())
    exact = "projections of Table A.2(a) by a camera at (400, 0, 0) cm"
    yield _row("Table A.2(b)", "image points, 5 digits", f"{gap:.0e} cm off at most", gap < 1e-3, exact)
    wrong = estimates["the same, linear solution alone"]
    yield _row(
        "Table A.2(a), right eye, x",
        "-32.168 cm",
        "-31.168 cm",
        False,
        f"with the printed value the camera is {wrong.off:.0f} cm off, and the eye is named as not fitting",
        "misprint: only -31.168 gives its own image point and Table 2(d)",
    )
    for name, key, print_, within in (
        ("(a), transformation matrix", "T", printed.T, 0.03),
        ("(b), rotation matrix", "R", printed.R, 1e-4),
        ("(c), camera position, cm", "position", printed.PRINTED_POSITION, 0.03),
        ("(d), head in the camera frame, cm", "head", printed.PRINTED_HEAD, 0.03),
    ):
        off = float(np.abs(tables[key] - print_).max())
        yield _row(f"Table 2{name}", "5 decimals", f"{off:.5f} off at most", off < within, exact)
    refined, linear = estimates["printed digits, f free"], estimates["printed digits, linear solution alone"]
    yield _row(
        "§2.1: the camera by the linear solution",
        "least squares of eq. (1)",
        f"{linear.off:.1f} cm off; refined {refined.off:.1f} cm",
        False,
        "both from the printed image points",
        "the printed digits are too coarse for the linear solution: the reprojection error is minimised",
    )


def _count_rows(counts: WalkCounts, chosen: int) -> Iterator[PaperRow]:
    """Yield a row for each line of the table, and for each step of §4.2."""
    spreads = dict(zip(cell_names(), cell_spreads(counts), strict=True))
    ours = dict(zip(cell_names(), counts.cells[chosen].tolist(), strict=True))
    table = "Table 3 (SEQ1)" if counts.name == "seq1" else "Table 4 (SEQ2)"
    for level, joint in enumerate(JOINTS):
        cells = [
            (kind, frame, joint) for kind in ("physical", "rules 1-2") for frame in printed.PRINTED_FRAMES
        ]
        why = SHOULDERS_WHY[counts.name] if level in (1, 2) else OPEN_WALKS
        place = f"{table}, level {level}, {joint.replace('_', ' ')}"
        yield _count_row(place, [spreads[cell] for cell in cells], [ours[cell] for cell in cells], why)
    for step, cell in (
        ("Rules 1-2", ("rules 1-2", 1, JOINTS[-1])),
        ("grouped (Figs. 6 to 8)", ("grouped", 1, "all")),
        ("Rules 3-5", ("rules 3-5", 1, "all")),
    ):
        yield _count_row(f"§4.2, {counts.name.upper()}, {step}", [spreads[cell]], [ours[cell]], OPEN_STEPS)


def _count_row(place: str, spreads: Sequence[CellSpread], ours: Sequence[int], why: str) -> PaperRow:
    """Put counts at the closest setting beside the print: differing where any print is rare among all settings."""
    equal = all(spread.printed == count for spread, count in zip(spreads, ours, strict=True))
    ranges = [spread.percentiles for spread in spreads]
    usual = all(low <= spread.printed <= high for spread, (low, _, high) in zip(spreads, ranges, strict=True))
    return PaperRow(
        paper=PAPER_TITLE,
        place=place,
        printed=_in_columns([str(spread.printed) for spread in spreads]),
        here=_in_columns([str(count) for count in ours]),
        verdict="agrees" if equal and usual else "open" if usual else "differs",
        check="the walker's setting that is closest to all cells; of all settings, none left out, "
        + _in_columns([f"{spread.below:.0%}" for spread in spreads])
        + " have fewer, "
        + _in_columns([f"{spread.equal:.0%}" for spread in spreads])
        + " as many",
        why="" if equal and usual else why,
    )


def _in_columns(texts: Sequence[str]) -> str:
    """Write frames 1, 3, 5 after the physical constraints; then with Rules 1 and 2."""
    half = len(texts) // 2
    return "; ".join(" / ".join(part) for part in (texts[:half], texts[half:]) if part)


def _body_rows() -> Iterator[PaperRow]:
    figure = load_figure()
    points = figure.forward_kinematics(random_postures(figure, N_POSTURES, np.random.default_rng(0)))
    worst = 0.0
    for (one, other), length in printed.TABLE_A1.items():
        apart = np.linalg.norm(points[:, JOINT[one]] - points[:, JOINT[other]], axis=-1)
        worst = max(worst, float(np.abs(100 * apart - length).max()))
    yield _row(
        "Table A.1",
        f"{len(printed.TABLE_A1)} lengths",
        f"{worst:.0e} cm off at most",
        worst < 1e-6,
        f"distances of joints of {N_POSTURES} random postures of the rigid-body model",
    )
    neck, pelvis, half = (
        printed.TABLE_A1["neck", "right_shoulder"],
        printed.TABLE_A1["right_shoulder", "pelvis"],
        printed.TABLE_A1["right_shoulder", "left_shoulder"] / 2,
    )
    spine = printed.TABLE_A1["neck", "pelvis"]
    below = (neck**2 - pelvis**2 + spine**2) / (2 * spine)
    before = np.sqrt(neck**2 - half**2 - below**2)
    yield PaperRow(
        paper=PAPER_TITLE,
        place="Table A.1, the torso",
        printed="a rigid torso",
        here=f"not flat: the shoulders' middle is {before:.3f} cm before the line from neck to pelvis",
        verdict="open",
        check="trilateration of the printed lengths",
        why="lengths cannot tell before from behind: before is taken",
    )
