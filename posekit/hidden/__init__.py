"""Joints that were not seen: where each of them can be, and one position in the middle of that.

A joint without an image point has a continuum of positions. The figure's rigid parts, its lengths, the rays of
joints beyond it and the checks leave a part of it: a point, an arc, a region of a sphere, an interval of depth.

The trunk is placed first (`trunk_placer`), then each limb on it (`limb_placer`); one placement of each limb is chosen
such that they pass together (`representatives`, `limb_combinations`), and the sets are described (`set_descriptions`).
"""

from posekit.hidden.complete import complete as complete
from posekit.hidden.complete import complete_points as complete_points
from posekit.hidden.completion import CompletedSurvivors as CompletedSurvivors
from posekit.hidden.completion import CompletionOutcome as CompletionOutcome
from posekit.hidden.completion import PositionKind as PositionKind
from posekit.hidden.completion import Region as Region
from posekit.hidden.rejection import reject as reject
from posekit.hidden.sampling import OcclusionSampling as OcclusionSampling
