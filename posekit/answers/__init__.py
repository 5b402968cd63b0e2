"""What is to be said of a frame: the likeliest posture, how sure it is, and what else it can be.

`answers_of` makes an `Answer` a frame of `ListedBodies`, the bodies that it can be with their probabilities;
`path_answer` says the same of the paths through a sequence.
"""

from typing import TYPE_CHECKING

from posekit.answers.answer import Answer as Answer
from posekit.answers.answer import answers_of as answers_of
from posekit.answers.depth_order import ANSWER_SEGMENTS as ANSWER_SEGMENTS
from posekit.answers.depth_order import DepthOrder as DepthOrder
from posekit.answers.listed_bodies import ListedBodies as ListedBodies
from posekit.answers.listed_bodies import ListedFrame as ListedFrame
from posekit.answers.regions import JointRegions as JointRegions
from posekit.answers.written import written_answer as written_answer
from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.answers.paths import PathAnswer as PathAnswer
    from posekit.answers.paths import path_answer as path_answer
else:
    __getattr__ = on_demand(__name__, {"paths": ("PathAnswer", "path_answer")})
