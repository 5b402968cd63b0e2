"""Joints that were not seen: where each of them can be, and one position in the middle of that.

A joint without an image point has a continuum of positions. The figure's rigid parts, its lengths, the rays of
joints beyond it and the checks leave a part of it: a point, an arc, a region of a sphere, an interval of depth.
"""

from posekit.hidden.complete import complete as complete
from posekit.hidden.completion import CompletedSurvivors as CompletedSurvivors
from posekit.hidden.completion import CompletionOutcome as CompletionOutcome
from posekit.hidden.completion import PositionKind as PositionKind
from posekit.hidden.completion import Region as Region
from posekit.hidden.rejecting import reject as reject
from posekit.hidden.settings import OcclusionSampling as OcclusionSampling
