"""How many defects are found, named rightly and at the right frames, by kind and size; false alarms on clean clips.

    python -m benchmarks.defects_found CAPTURE.npz [FILE ...] [--cases 2000] [--seed 0] [--only KIND,KIND]

Thresholds are set on clips with even numbers in their files; what is printed is of those with odd numbers, or with
`--thresholds` of the others. A defect is found where a check that names it rightly rejects frames, the first and the
last of which are at most two from the first and the last that are wrong. Prints Markdown tables.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.clean_clips import CleanClip, clean_clips
from benchmarks.defect_cases import DefectCase, draw
from benchmarks.defects import DEFECTS
from benchmarks.defects_in_files import FOUND_IN_FILES, rejected_in_file
from posekit.formats.markdown import table_lines
from posekit.validators.motion import MotionClip, judge_motion, load_profile

SPAN_TOLERANCE = 2
"""Frames."""


def rejected(clip: MotionClip) -> dict[str, NDArray[np.bool_]]:
    """Say which frames (T,) each check over time rejects."""
    verdict = judge_motion(load_profile("posekit").checks, clip)
    return {one.check.replace("_", "-"): np.asarray(one.violated.any(axis=1)) for one in verdict.judgements}


def is_found(case: DefectCase, frames: Mapping[str, NDArray[np.bool_]]) -> bool:
    """Say whether a check that names a defect rightly rejects its frames, and none that is far from them."""
    named = np.zeros(len(case.clip), dtype=np.bool_)
    for name in DEFECTS[case.kind].checks:
        named |= frames.get(name, np.False_)
    at = np.flatnonzero(named)
    return bool(
        len(at)
        and abs(int(at[0]) - case.span[0]) <= SPAN_TOLERANCE
        and abs(int(at[-1]) - case.span[1]) <= SPAN_TOLERANCE
    )


def _rejected_of(case: DefectCase) -> dict[str, NDArray[np.bool_]]:
    by_file = set(DEFECTS[case.kind].checks) & set(FOUND_IN_FILES)
    return rejected_in_file(case.clip) if by_file else rejected(case.clip)


@cache
def _asked(kind: str) -> bool:
    """Say whether something names a kind."""
    names = {*FOUND_IN_FILES, *(check.name for check in load_profile("posekit").checks)}
    return bool(names & set(DEFECTS[kind].checks))


def cases(clips: Sequence[CleanClip], count: int, seed: int, kinds: Sequence[str]) -> list[DefectCase]:
    """Draw as many cases of each kind and size."""
    rng = np.random.default_rng(seed)
    wanted = [(DEFECTS[kind], size) for kind in kinds for size in DEFECTS[kind].sizes]
    drawn = [draw(clips, kind, size, rng) for kind, size in wanted for _ in range(-(-count // len(wanted)))]
    return [case for case in drawn if case is not None]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("captures", nargs="*")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--thresholds", action="store_true")
    parser.add_argument("--missed", action="store_true", help="list what is not found")
    given = parser.parse_args()
    if not given.captures:
        print("no capture given: python -m benchmarks.defects_found CAPTURE.npz [FILE ...]")
        return
    clips = [one for one in clean_clips(given.captures) if one.thresholds == given.thresholds]
    kinds = given.only.split(",") if given.only else [kind for kind in DEFECTS if _asked(kind)]
    print_alarms(clips)
    print_found(cases(clips, given.cases, given.seed, kinds), missed=given.missed)


def print_found(drawn: Sequence[DefectCase], *, missed: bool) -> None:
    """Print the share that is found, by kind and size, and what else is named."""
    found: dict[tuple[str, float], list[bool]] = defaultdict(list)
    others: dict[tuple[str, float], Counter[str]] = defaultdict(Counter)
    for case in drawn:
        frames, key = _rejected_of(case), (case.kind, case.size)
        found[key].append(is_found(case, frames))
        others[key].update(
            name for name, at in frames.items() if at.any() and name not in DEFECTS[case.kind].checks
        )
        if missed and not found[key][-1] and case.size >= DEFECTS[case.kind].asked:
            said = {
                name: (int(at.argmax()), int(len(at) - 1 - at[::-1].argmax()))
                for name, at in frames.items()
                if at.any()
            }
            print(f"missed: {case.kind} {case.size:g} {case.place} {case.source} {case.span}: {said}")
    rows = [
        [
            kind,
            f"{size:g} {DEFECTS[kind].unit}",
            "yes" if size >= DEFECTS[kind].asked else "",
            str(len(hits)),
            f"{np.mean(hits):.1%}",
            ", ".join(f"{name} {number}" for name, number in others[kind, size].most_common(4)),
        ]
        for (kind, size), hits in found.items()
    ]
    print("\n".join(table_lines(["defect", "size", "asked", "cases", "found", "also named"], rows)))
    asked = [hit for (kind, size), hits in found.items() if size >= DEFECTS[kind].asked for hit in hits]
    if asked:
        print(f"Of {len(asked)} cases of the sizes that are asked, {np.mean(asked):.2%} are found.")


def print_alarms(clips: Sequence[CleanClip]) -> None:
    """Print which clean clips are rejected, and where."""
    rows, clips_hit, frames_hit = [], 0, 0
    for clean in clips:
        frames = rejected(clean.clip)
        every = np.any(list(frames.values()), axis=0)
        clips_hit += bool(every.any())
        frames_hit += int(every.sum())
        rows += [
            [clean.name, name, str(int(at.sum())), str(int(at.argmax()))]
            for name, at in frames.items()
            if at.any()
        ]
    total = sum(len(clean.clip) for clean in clips)
    print(
        f"Clean: {clips_hit} of {len(clips)} clips, {frames_hit} of {total} frames ({frames_hit / total:.2%}).\n"
    )
    if rows:
        print("\n".join(table_lines(["clip", "check", "frames", "first"], rows)))


if __name__ == "__main__":
    main()
