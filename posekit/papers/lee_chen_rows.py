"""What Lee & Chen 1985 print, row by row, each calculated another way where there is one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_spread import cell_spreads
from posekit.papers.lee_chen_table2 import CameraEstimate, exact_image
from posekit.papers.lee_chen_tables34 import PAPER_TOLERANCE, SAME_POSTURE_METRES, WalkCounts
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.rows import PaperRow, agreement
from posekit.recovery import recover
from posekit.skeleton import JOINT, JOINTS, PARENTS
from posekit.synthesis import seq1
from posekit.synthesis.random_postures import random_postures
from posekit.validators import load_ranges
from posekit.views.builtin import view_of

PAPER_TITLE = "Lee & Chen 1985"
OPEN_WALKS = "the walk is Cutting's, whose constants are not printed; nor is a tolerance: 1 cm here"
N_POSTURES = 20


def lee_chen_rows(work: LeeChenWork) -> Iterator[PaperRow]:
    """Yield the rows of the paper."""
    yield from _tree_rows()
    yield from _table_1_rows()
    yield from _table_2_rows({one.way: one for one in work.estimates}, work.tables)
    for counts in work.counts.values():
        yield from _count_rows(counts, work.chosen)
    yield from _body_rows()


def _row(place: str, print_: str, here: str, fits: bool, check: str, why: str = "") -> PaperRow:
    return PaperRow(
        paper=PAPER_TITLE,
        place=place,
        printed=print_,
        here=here,
        verdict=agreement(fits),
        check=check,
        why=why,
    )


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
        "§2.2: two positions of a joint",
        "where its ray meets the sphere of its segment",
        f"{worst:.0e} m off at most",
        worst < SAME_POSTURE_METRES,
        f"roots of the quadratic equation, for every joint of the {len(frame)} interpretations of SEQ1's frame 1",
    )


def _table_1_rows() -> Iterator[PaperRow]:
    limits = load_ranges("table1-printed").limits
    for angle, bounds in printed.TABLE_1.items():
        yield _row(
            f"Table 1, {angle.replace('.', ', ').replace('_', ' ')}",
            f"{bounds[0]:g} to {bounds[1]:g} degrees",
            f"{limits[angle][0]:g} to {limits[angle][1]:g} degrees",
            limits[angle] == bounds,
            "the tests bend a body by 0.3 degrees to both sides of each bound",
        )
    yield _row(
        "§3.2.A: abduction as the angle of a projection",
        "an angle of the projection on the frontal plane",
        "`table1`: the angle out of the plane of flexion; `table1-printed`: as printed",
        False,
        "a hip flexed by 100 degrees with a bent knee, in the tests",
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
    spreads, here = cell_spreads(counts), counts.cells[chosen].tolist()
    table = "Table 3 (SEQ1)" if counts.name == "seq1" else "Table 4 (SEQ2)"
    check = f"among {len(counts.settings)} settings of the walker, none left out"
    outside = []
    for spread, ours in zip(spreads, here, strict=True):
        low, _, high = spread.percentiles
        inside = low <= spread.printed <= high
        place = f"{table}, frame {spread.frame}, {spread.constraints}, {spread.joint}"
        if not inside:
            outside.append(place.removeprefix(f"{table}, "))
        if spread.joint == "all":
            place = f"§4.2, {counts.name.upper()}, {spread.constraints}"
        elif spread.joint != JOINTS[-1]:
            continue
        yield PaperRow(
            paper=PAPER_TITLE,
            place=place,
            printed=str(spread.printed),
            here=f"{ours} at the closest setting; 5 to 95 % have {low:g} to {high:g}",
            verdict="open" if inside else "differs",
            check=f"{check}: {spread.below:.0%} have fewer, {spread.equal:.0%} as many",
            why=OPEN_WALKS,
        )
    yield PaperRow(
        paper=PAPER_TITLE,
        place=f"{table}, all levels",
        printed=f"{len(spreads)} counts, §4.2's among them",
        here=f"{len(spreads) - len(outside)} lie within what 5 to 95 % of the settings have",
        verdict="differs" if outside else "open",
        check=check,
        why=f"{OPEN_WALKS}; outside: {'; '.join(outside) or 'none'}",
    )


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
    yield PaperRow(
        paper=PAPER_TITLE,
        place="Table A.1, the torso",
        printed="a rigid torso",
        here="not flat: the shoulders' middle is 3.742 cm before the line from neck to pelvis",
        verdict="open",
        check="trilateration of the printed lengths",
        why="lengths cannot tell before from behind: before is taken",
    )
