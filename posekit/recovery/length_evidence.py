"""Whether lengths may be taken at their word: what torsos and hips say where nobody says how noisy points are."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.cameras import PinholeCamera
from posekit.formats.own import View
from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.hypotheses import ObservedHypotheses
from posekit.recovery.noise import UNSTATED_DEVIATION_PIXELS, Noise
from posekit.refinement import find_trunks

MAX_FRAMES_ASKED: Final = 64
"""Frames that are looked at, spread over the view: one body is in all of them."""

LIKELY_CHI2: Final = 3.0
"""The largest median of chi2 of trunks, of some six degrees of freedom, at which lengths are taken at their word.

Of real motion (CMU, 16 clips, exact points) it is 0.1 with the clip's own lengths, 2 to 3 with all of them 2 % off, 11
to 23 with 5 %, 10 with 3 % each: docs, "Noise".
"""


def lengths_fit(view: View, fit: CameraFit, figure: Figure) -> bool:
    """Tell whether a view's torsos and hips fit lengths as well as those of a body that was measured.

    Only necks that are given say anything: where the neck is placed, a body of another size fits as well.
    """
    given = np.isfinite(view.root[fit.frame]).all(axis=1) & np.isfinite(fit.root).all(axis=1)
    rows = np.flatnonzero(given)
    if not len(rows):
        return True
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MAX_FRAMES_ASKED)).astype(np.intp))]
    camera = fit.cameras(rows)
    if not isinstance(camera, PinholeCamera):
        return True
    noise = Noise(deviation=UNSTATED_DEVIATION_PIXELS, lengths=MEASURED_LENGTHS)
    trunks = find_trunks(ObservedHypotheses.of(view, fit, rows, camera, figure, noise).sight, level=0.0)
    best = np.full(len(rows), np.inf)
    np.minimum.at(best, trunks.frame, trunks.chi2)
    return bool(np.median(best) <= LIKELY_CHI2)
