"""False alarms: findings in clips that have no known fault.

    python -m benchmarks.clean_clips [--data DIR] [--half 1]

Prints the share of valid frames, the checks over time that reject a clip, and each rejected clip with its findings.
Every finding must be inspected: it is a fault of the recording or a false alarm.
"""

from __future__ import annotations

from collections import Counter

from benchmarks.common import data_of, parser, recordings
from posekit.validators import validate_motion

POSTURE_CHECKS = ("rigid-parts", "joint-range", "collision")
"""Checks of single postures; all others judge motion over time."""


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--half", type=int)
    given = made.parse_args()
    clips = recordings(data_of(given))[slice(given.half, None, 1 if given.half is None else 2)]
    frames = valid = alarmed = 0
    by_check: Counter[str] = Counter()
    for motion in clips:
        report = validate_motion(motion)
        named = {name: one["frames"] for name, one in report.by_check().items() if one["frames"]}
        frames, valid = frames + len(report), valid + len(report) - int(report.invalid.sum())
        by_check.update(named.keys())
        over_time = sorted(set(named) - set(POSTURE_CHECKS))
        alarmed += bool(over_time)
        if named or report.warnings:
            first = next((str(span) for clip in report.clips for span in clip.spans), "")
            print(f"{motion.source}, {len(motion)} frames: {named} {first} {'; '.join(report.warnings)}")
    print(
        f"{len(clips)} clips, {frames} frames: {valid / max(frames, 1):.2%} valid; "
        f"{alarmed} clips rejected by a check over time; clips by check: {dict(by_check.most_common())}"
    )


if __name__ == "__main__":
    main()
