"""What is known of a view's noise: how far its image points, its necks and the person's lengths may be off."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import LengthUncertainty
from posekit.errors import InputError
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.settings import ALLOWED_DEVIATIONS
from posekit.settings.rooting import DETECTED_DEVIATION
from posekit.skeleton import HEAD, JOINTS, N_TRUNK_JOINTS, RIGID_SEGMENTS, TREE_SEGMENTS, segment_name

JOINT_OFFSET: Final = 0.012
"""Metres: standard deviation of a detector's key points from the figure's joints, at full confidence."""

OFFSET_POWER: Final = 0.7
"""How key points' deviations fall with confidence: as its inverse to this power (docs, "Detections")."""

UNTOLD_CONFIDENCE: Final = 0.5
"""What the confidence of a detector's point counts as where the file has none: MediaPipe's, which are 2 cm off."""

LEAST_OFFSET_CONFIDENCE: Final = 0.05
"""A confidence below this counts as this, for how far key points are from joints."""

KEY_POINT_DEVIATION: Final = 3.0
"""Pixels: standard deviation of a detector's points beside that, of a person some 700 pixels tall. Where necks can be
is searched with more (`DETECTED_DEVIATION`): frames whose trunk is off most would have none."""

LEAST_CONFIDENCE: Final = 0.25
"""A confidence below this counts as this, for the deviation in pixels."""

UNSTATED_DEVIATION_PIXELS: Final = 1.0
"""Standard deviation (px) of image points of which nobody says any, of a body whose lengths are not exact."""

FOREARM_METRES: Final = 0.24
"""Metres: a forearm. It is in front of other parts more often than any other segment, and turned most by what its ends
are off."""

HEAD_OFFSET_METRES: Final = 0.08
"""Metres: standard deviation of the points of a head that nobody measured from the figure's. Heads are alike to 2 cm;
but conventions put the neck, on which they hang, at the seventh vertebra, the throat, or between the shoulders."""

HEAD_METRES: Final = 0.2
"""Metres from the neck to the head's points."""

CONTACT_UNDER_NOISE_METRES: Final = 0.03
"""Metres by which bodies may come nearer than they should, before refinement and after it: depths are off by as much,
and refinement knows nothing of bodies."""


@dataclass(frozen=True, kw_only=True)
class Noise:
    """How far image points and lengths may be off.

    Parameters
    ----------
    deviation : float
        Standard deviation of each coordinate of an image point that was seen with full confidence, pixels.
    offset : float
        How far a detector's points are from the figure's joints at full confidence, standard deviation, metres.
    lengths : LengthUncertainty
        How well the person's lengths are known; exactly if not given.
    overlap : float
        Metres by which bodies may come nearer than they should, before refinement and after it.
    """

    deviation: float
    offset: float = 0.0
    lengths: LengthUncertainty = field(default_factory=LengthUncertainty)
    overlap: float = CONTACT_UNDER_NOISE_METRES

    @staticmethod
    def of(
        view: View, deviation: float | None, lengths: LengthUncertainty, *, asked: bool | None
    ) -> Noise | None:
        """Say what the noise of a view is; None where neither points nor lengths are off, and it was not `asked` for.

        The deviation that is given comes before the view's own, and that before what detectors' points have.
        """
        detected = bool(view.derived)
        known = deviation or view.deviation or (KEY_POINT_DEVIATION if detected else None)
        if known is None and lengths.exact and not asked:
            return None
        noise = Noise(
            deviation=known or (DETECTED_DEVIATION if lengths.exact else UNSTATED_DEVIATION_PIXELS),
            offset=JOINT_OFFSET if detected else 0.0,
            lengths=lengths,
        )
        # What lies in the image plane is off in depth by as much as its length: a forearm before a torso, say.
        by_lengths = ALLOWED_DEVIATIONS * noise.limb * FOREARM_METRES
        return replace(noise, overlap=CONTACT_UNDER_NOISE_METRES + by_lengths)

    @property
    def limb(self) -> float:
        """The largest deviation of the limbs' lengths beside the common size."""
        return max(
            self.lengths.own[segment_name(pair)] for pair in TREE_SEGMENTS if max(pair) >= N_TRUNK_JOINTS
        )

    @property
    def rigid(self) -> float:
        """The largest of the distances inside torso and hips, likewise."""
        return max(self.lengths.own[segment_name(pair)] for pair in RIGID_SEGMENTS)

    @property
    def scale(self) -> float:
        """How far a trunk that was found may be off in scale, to first order: by the common size, or what it shows.

        Height and width show the scale as well as each of them is known.
        """
        shown = self.rigid / math.sqrt(2)
        return 1 / math.hypot(1 / self.lengths.common, 1 / shown) if self.lengths.common and shown else 0.0

    def document(self) -> dict[str, Any]:
        """Return what results say of it."""
        lengths = self.lengths
        return {
            "deviation": self.deviation,
            "offset": self.offset,
            "size": lengths.common,
            "by_segment": dict(lengths.own),
            "overlap": self.overlap,
        }

    @staticmethod
    def from_document(said: Mapping[str, Any]) -> Noise:
        """Read what `document` wrote."""
        lengths = LengthUncertainty(common=said.get("size", 0.0), own=said["by_segment"])
        overlap = said.get("overlap", CONTACT_UNDER_NOISE_METRES)
        return Noise(deviation=said["deviation"], offset=said["offset"], lengths=lengths, overlap=overlap)

    def of_points(self, view: View, frames: NDArray[np.intp], depth: Array, focal: Array) -> Array:
        """Return the standard deviations of joints and head points (F, 19), pixels.

        A residual that is weighted with its confidence w (Bogo et al. 2016, eq. 2) has the deviation 1 / sqrt(w).

        Parameters
        ----------
        view : View
            Whose confidences count.
        frames : int array (F,)
            Which of its frames.
        depth : array (F,)
            Of the neck, metres.
        focal : array (F,)
            Focal length, pixels.
        """
        told = view.confidence[frames]
        confidence = np.clip(np.nan_to_num(told, nan=1.0), LEAST_CONFIDENCE, 1.0)
        sure = np.clip(np.nan_to_num(told, nan=UNTOLD_CONFIDENCE), LEAST_OFFSET_CONFIDENCE, 1.0)
        offset = self.offset * sure**-OFFSET_POWER
        # A head is not larger where limbs are longer; and one that nobody measured has its nose and neck elsewhere.
        of_head = HEAD_METRES * math.hypot(self.lengths.common, max(self.lengths.own.values()))
        if view.head_points is None and not self.lengths.exact:
            of_head = math.hypot(of_head, HEAD_OFFSET_METRES)
        beside = np.hypot(offset, np.repeat([0.0, of_head], [len(JOINTS), len(HEAD)]))
        off = beside * (focal / depth)[:, None]
        return np.asarray(np.hypot(self.deviation / np.sqrt(confidence), off))


def noiseless_camera(view: View) -> str:
    """Name the camera of a view whose noise is not allowed for; empty where it is."""
    return "" if isinstance(view.camera, OpenCVModel | ScaledOrthographicModel) else "lee-chen"


def refuse_deviation(view: View, deviation: float | None) -> None:
    """Refuse a deviation that is asked for where it has no effect.

    Raises
    ------
    InputError
        Where one is given for a `lee-chen` camera.
    """
    camera = noiseless_camera(view)
    if camera and deviation is not None:
        raise InputError(
            f"--deviation: the view's camera is {camera}: a deviation has no effect there; expected another "
            "camera; leave the option out, or give tolerances (--rigid-tolerance, --tangent-tolerance)"
        )


def contact_under_noise(asked: float, overlap: float = CONTACT_UNDER_NOISE_METRES) -> float:
    """Return the margin (m) that bodies must keep under noise; negative allows penetration, as in `asked`."""
    return asked - overlap
