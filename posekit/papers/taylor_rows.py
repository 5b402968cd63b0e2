"""What Taylor 2000 prints, row by row, each calculated another way where there is one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from posekit.body import load_figure
from posekit.papers.rows import PaperRow, Verdict, agreement
from posekit.papers.taylor_constrained import Constrained, constrained
from posekit.papers.taylor_protocol import PRINTED_ERRORS
from posekit.papers.taylor_random_views import RandomViews, view_at_random
from posekit.papers.taylor_study import Study, synthetic_study
from posekit.skeleton import SEGMENTS
from posekit.synthesis import CameraSphere, random_views

PAPER_TITLE = "Taylor 2000"
N_BODIES = 200
N_PICTURES = 100
"""Synthetic photographs: enough for a table in half a minute."""


class TaylorWork(NamedTuple):
    """What was calculated of the paper: its two objects, in random views too, and its people."""

    objects: list[Constrained]
    views: list[RandomViews]
    study: Study


def find_taylor() -> TaylorWork:
    """Calculate what the paper prints."""
    objects = constrained()
    views = [view_at_random(one, posed=posed) for posed in (False, True) for one in objects]
    return TaylorWork(objects, views, synthetic_study(N_PICTURES))


def taylor_rows(found: TaylorWork) -> Iterator[PaperRow]:
    """Yield the rows of the paper."""
    yield from _method_rows(found.study)
    for one in found.objects:
        within = float((one.worst <= one.printed).mean())
        yield _row(
            f"{one.figure}, {one.constraint}",
            f"angles always within {one.printed:g} degree{'s' if one.printed > 1 else ''}",
            f"{within:.1%} of {len(one.worst)} pictures; median {np.median(one.worst):.2f} degrees",
            "open",
            f"without noise the true scale comes out to {np.abs(one.found.s / one.s - 1).min():.0e}",
            "lengths, posture and noise of the object are not printed: one like it, with 1 pixel of noise",
        )
    for each in found.views:
        yield _row(
            f"{each.constrained.figure} from any direction{', any posture' if each.posed else ''}",
            f"within {each.constrained.printed:g} degree{'s' if each.constrained.printed > 1 else ''}",
            f"{int(each.solvable.sum())} of {len(each.chance)} views can be solved, of these "
            f"{each.within(each.solvable):.1%} are within; of all {each.within(each.chance >= 0):.1%}",
            "open",
            f"the sensitivity of the angles expects {each.chance.mean():.1%} of all",
            "the paper shows one picture: in the others the noise decides",
        )
    yield from _accuracy_rows(found.study)


def _row(place: str, print_: str, here: str, verdict: Verdict, check: str, why: str = "") -> PaperRow:
    return PaperRow(
        paper=PAPER_TITLE, place=place, printed=print_, here=here, verdict=verdict, check=check, why=why
    )


def _method_rows(study: Study) -> Iterator[PaperRow]:
    points = random_views(load_figure(), N_BODIES, np.random.default_rng(3), CameraSphere()).joints_cam
    s, segments = 100.0, np.array(SEGMENTS)
    apart = points[:, segments[:, 1]] - points[:, segments[:, 0]]
    seen, length = s * np.linalg.norm(apart[..., :2], axis=-1), np.linalg.norm(apart, axis=-1)
    depth = np.sqrt(np.maximum(length**2 - (seen / s) ** 2, 0))
    off = float(np.abs(depth - np.abs(apart[..., 2])).max())
    yield _row(
        "eqs. (1)-(2): a segment's depth",
        "dZ^2 = l^2 - (du^2 + dv^2) / s^2",
        f"{off:.0e} m off at most",
        agreement(off < 1e-6),
        f"{apart[..., 0].size} segments of {N_BODIES} random postures in scaled orthographic pictures",
    )
    yield _row(
        "eq. (3): bound of the scale",
        "s >= l / sqrt(du^2 + dv^2)",
        f"s >= sqrt(du^2 + dv^2) / l holds for {(s >= (1 - 1e-12) * seen / length).mean():.0%} of the segments; "
        f"as printed, pixels are compared with their inverse",
        "differs",
        "the same segments, at their true scale",
        "printed upside down",
    )
    none = next(row for row in study.exact if row.checks == "none")
    yield _row(
        "number of postures",
        "2048",
        f"{none.count.mean():g} in each of {len(none.count)} pictures",
        agreement(bool((none.count == 2**11).all())),
        "2^11 flips of 11 segments",
    )


def _accuracy_rows(study: Study) -> Iterator[PaperRow]:
    for one in study.photographs:
        by_hand = one.accuracy[0]
        for name, values, unit in (("rms", by_hand.rms * 100, "cm"), ("angle", by_hand.angles, "degrees")):
            mean, median = PRINTED_ERRORS[name]
            yield _row(
                f"§3.2, {'RMS' if name == 'rms' else 'disparity of angles'}, {one.proportions}, s {one.scale}",
                f"mean {mean:g}, median {median:g} {unit}",
                f"mean {np.nanmean(values):.2f}, median {np.nanmedian(values):.2f} {unit}",
                "open",
                f"{study.pictures} pictures, flips {by_hand.flips}, six points after the best similarity",
                "the paper's 11 photographs and their truth are not published: random postures instead",
            )
