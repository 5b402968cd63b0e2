"""Several people in one file of motion capture, whose points have the same names behind another name each."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from posekit.formats.motion.motion import Motion
from posekit.formats.skeleton_maps import find_by_names
from posekit.formats.skeleton_maps.skeleton_map import plain


def people_apart(motion: Motion) -> Motion:
    """Lay the people of a file behind one another, a clip each: ``Ann:LSHO`` and ``Bob:LSHO`` are two people.

    Parameters
    ----------
    motion : Motion
        As it was recorded; as it is where there is one person in it.
    """
    behind = Counter(plain(name) for name in motion.names)
    prefixes = [name.rpartition(":")[0] for name in motion.names]
    people = [one for one in dict.fromkeys(prefixes) if one]
    columns = {one: [k for k, prefix in enumerate(prefixes) if prefix == one] for one in people}
    bodies = [one for one in people if find_by_names([motion.names[k] for k in columns[one]])]
    if len(bodies) < 2 or max(behind.values()) < 2:
        return motion
    short = [[motion.names[k].rpartition(":")[2] for k in columns[one]] for one in bodies]
    shared = [name for name in short[0] if all(name in others for others in short[1:])]
    chosen = [
        [columns[one][names.index(name)] for name in shared] for one, names in zip(bodies, short, strict=True)
    ]
    clips = tuple(f"{clip} {one}".strip() for one in bodies for clip in motion.clips)
    return replace(
        motion,
        names=tuple(shared),
        points=np.concatenate([motion.points[:, places] for places in chosen]),
        time=np.tile(motion.time, len(bodies)),
        clip=np.concatenate([motion.clip + k * len(motion.clips) for k in range(len(bodies))]),
        clips=clips,
        actions=motion.actions * len(bodies),
        rates=np.tile(motion.rates, len(bodies)),
        said=(*motion.said, f"{len(bodies)} people, a clip each: {', '.join(bodies[:4])}"),
    )
