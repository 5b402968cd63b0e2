"""What Taylor 2000 prints, row by row, each calculated another way where there is one."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from posekit.body import load_figure
from posekit.linkages import Linkage, LinkageFamily, name_nearer, search
from posekit.papers.rows import PaperRow, Verdict, agreement, compared
from posekit.papers.taylor_constrained import Constrained, constrained
from posekit.papers.taylor_protocol import PRINTED_ERRORS
from posekit.papers.taylor_random_views import RandomViews, view_at_random
from posekit.papers.taylor_study import Study, synthetic_study
from posekit.recovery.taylor_figure.human import taylor_human
from posekit.recovery.taylor_figure.proportions import figure_of
from posekit.skeleton import JOINT, SEGMENTS
from posekit.synthesis import CameraSphere, random_views

PAPER_TITLE = "Taylor 2000"
N_BODIES = 200
STATURE_METRES = 1.75
PRINTED_SCALES = (2.3569, 2.9461, 3.5353)
PRINTED_LENGTHS = {
    "forearm": (14.0, (("right_elbow",), ("right_wrist",))),
    "upper arm": (15.0, (("right_shoulder",), ("right_elbow",))),
    "shoulder girdle": (18.0, (("right_shoulder",), ("left_shoulder",))),
    "foreleg": (20.0, (("right_knee",), ("right_ankle",))),
    "thigh": (19.0, (("right_hip",), ("right_knee",))),
    "pelvic girdle": (14.0, (("right_hip",), ("left_hip",))),
    "spine": (24.0, (("right_shoulder", "left_shoulder"), ("pelvis",), ("right_hip", "left_hip"))),
}
"""Table 1: lengths, and between the middles of which joints they lie."""

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
    yield from _family_rows()
    yield from _proportion_rows()
    for one in found.objects:
        yield _zero_row(one)
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
    yield _row(
        "Figs. 1, 5 and 6: people in photographs",
        "postures by flips given by hand, seen from the side",
        "not repeated",
        "open",
        "§3.2's rows are of synthetic photographs",
        "neither the photographs nor the points in them are published",
    )


def _row(place: str, print_: str, here: str, verdict: Verdict, check: str, why: str = "") -> PaperRow:
    return PaperRow(
        paper=PAPER_TITLE, place=place, printed=print_, here=here, verdict=verdict, check=check, why=why
    )


_compared = partial(compared, PAPER_TITLE)


def _method_rows(study: Study) -> Iterator[PaperRow]:
    points = random_views(load_figure(), N_BODIES, np.random.default_rng(3), CameraSphere()).joints_cam
    s, segments = 100.0, np.array(SEGMENTS)
    apart = points[:, segments[:, 1]] - points[:, segments[:, 0]]
    seen, length = s * np.linalg.norm(apart[..., :2], axis=-1), np.linalg.norm(apart, axis=-1)
    depth = np.sqrt(np.maximum(length**2 - (seen / s) ** 2, 0))
    off = float(np.abs(depth - np.abs(apart[..., 2])).max())
    yield _row(
        "eqs. (1)-(2), Fig. 2: a segment's depth",
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


def _family_rows() -> Iterator[PaperRow]:
    """Look at all postures behind one picture, and at the scales of Fig. 4."""
    human = taylor_human()
    linkage, points = human.linkage, np.random.default_rng(2000).normal(size=(12, 3))
    unknown, measured = 2 + 2 * len(linkage.segments) + 1, 2 * len(linkage.points)
    yield _compared(
        "§2: unknowns and measurements",
        "25 and 24",
        f"{unknown} and {measured}",
        (unknown, measured) == (25, 24),
        "two for the place, two for the direction of each of 11 segments, one for s; two for each of 12 points",
    )
    lengths, image = human.measure(points[None]), 100.0 * points[None, :, :2]
    leaves = human.grow(image, lengths[0], 1.2 * human.bound(image, lengths))
    postures = human.twelve(leaves.positions(range(len(human.points)), np.arange(len(leaves.code))))
    off = float(np.abs(human.measure(postures) - lengths[0]).max())
    different = len(np.unique(np.round(postures, 6).reshape(len(postures), -1), axis=0))
    yield _compared(
        "§2, §4: solutions at one s",
        "2048, each with the segments' lengths",
        f"{different} different, {off:.0e} off at most",
        different == 2048 and off < 1e-9,
        "all postures behind a picture of a random body, measured again",
    )
    chain = np.random.default_rng(3).normal(size=(4, 3))
    lengths_of_chain = np.linalg.norm(np.diff(chain, axis=0), axis=1)
    three = Linkage.from_names(
        name="chain",
        segments={pair: length for pair, length in zip(pairwise("abcd"), lengths_of_chain, strict=True)},
    )
    held = LinkageFamily(linkage=three, image=100.0 * chain[:, :2])
    found = np.array([held.points(100.0, np.array(signs)) for signs in product((-1, 1), repeat=3)])
    kept = float(np.abs(np.linalg.norm(np.diff(found, axis=1), axis=2) - lengths_of_chain).max())
    count = len(np.unique(found.round(6).reshape(len(found), -1), axis=0))
    yield _compared(
        "Fig. 3: a chain of three segments",
        "8 configurations project to the same image",
        f"{count} different, lengths {kept:.0e} off at most",
        count == 8 and kept < 1e-9,
        "a random chain at its true scale, measured again",
    )
    family = LinkageFamily(linkage=linkage, image=points[:, :2])
    depths = family.foreshortening(family.minimum_scale * np.array(PRINTED_SCALES) / PRINTED_SCALES[0])
    yield _compared(
        "Fig. 4: s = 2.3569, 2.9461, 3.5353",
        "the larger the scale, the deeper the posture",
        f"{(np.diff(depths, axis=0) > 0).all(axis=0).sum()} of {depths.shape[1]} segments grow deeper at each step",
        bool((np.diff(depths, axis=0) > 0).all()),
        "a random picture at its bound and at 1.25 and 1.5 times it, the print's ratios",
    )


def _proportion_rows() -> Iterator[PaperRow]:
    """Measure Table 1 on the body that is made from it."""
    figure, unit = figure_of(STATURE_METRES), STATURE_METRES / 70
    points = figure.neutral_points
    for name, (length, chain) in PRINTED_LENGTHS.items():
        ends = [np.mean([points[JOINT[joint]] for joint in joints], axis=0) for joints in chain]
        found = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(ends)) / unit
        yield _compared(
            f"Table 1, {name}",
            f"{length:g}, with a height of 70",
            f"{found:.6g}",
            abs(found - length) < 1e-9,
            f"the body of {STATURE_METRES:g} m, measured between its joints by Pinocchio",
        )


def _zero_row(one: Constrained) -> PaperRow:
    """Look for all scales at which the constraint holds, flips given by hand."""
    family = LinkageFamily(linkage=one.linkage, image=one.points[:, :2] * one.s)
    flips = name_nearer(one.linkage, family.flips_of(one.points))
    found = search(family, {one.constraint: 1.0}, nearer=flips)
    exact = found.s[found.residual < 1e-20] / one.s
    return _compared(
        f"{one.figure}b, the residual over s",
        "its zero gives the posture",
        f"zero at {', '.join(f'{s:.9g}' for s in exact) or 'no'} times the true s",
        len(exact) == 1 and abs(exact[0] - 1) < 1e-9,
        "an object like it without noise, flips by hand: all minima",
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
