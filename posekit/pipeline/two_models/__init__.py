"""The same postures on the stick figure and on example-robot-data's `human`, with the same ranges.

The human's axes are the ISB's (Wu et al. 2005, J. Biomech. 38: x forward, y up, z right). Its shoulders and hips turn
in the stick figure's order, flexion, abduction, rotation: one angle stands for one angle. Its spine does not: from hips
to trunk it flexes, bends and then turns, while the stick figure does so from trunk to hips.
"""

from posekit.pipeline.two_models.angles import angles_of as angles_of
from posekit.pipeline.two_models.angles import excess as excess
from posekit.pipeline.two_models.angles import figure_limits as figure_limits
from posekit.pipeline.two_models.angles import in_human_order as in_human_order
from posekit.pipeline.two_models.angles import readings as readings
from posekit.pipeline.two_models.human import HELD as HELD
from posekit.pipeline.two_models.human import HUMAN as HUMAN
from posekit.pipeline.two_models.human import Counterpart as Counterpart
from posekit.pipeline.two_models.human import joint_columns as joint_columns
from posekit.pipeline.two_models.human import limits_of_human as limits_of_human
from posekit.pipeline.two_models.human import limits_on_human as limits_on_human
from posekit.pipeline.two_models.human import mapped_ranges as mapped_ranges
from posekit.pipeline.two_models.human import measure_counterparts as measure_counterparts
from posekit.pipeline.two_models.human import ranges_text as ranges_text
from posekit.pipeline.two_models.human import without_collision as without_collision
from posekit.pipeline.two_models.labelled import KINDS as KINDS
from posekit.pipeline.two_models.labelled import Labelled as Labelled
from posekit.pipeline.two_models.labelled import labelled_postures as labelled_postures
from posekit.pipeline.two_models.reasons import reasons as reasons
