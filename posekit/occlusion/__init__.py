"""Joints that were not seen: where each of them can be, and one position in the middle of that.

A joint without an image point has a continuum of positions. The figure's rigid parts, its lengths, the rays of
joints beyond it and the checks leave a part of it: a point, an arc, a region of a sphere, an interval of depth.
"""

from posekit.occlusion.complete import complete as complete
from posekit.occlusion.completion import Completion as Completion
from posekit.occlusion.completion import Kind as Kind
from posekit.occlusion.completion import Outcome as Outcome
from posekit.occlusion.completion import Region as Region
from posekit.occlusion.rejecting import reject as reject
from posekit.occlusion.settings import Sampling as Sampling
