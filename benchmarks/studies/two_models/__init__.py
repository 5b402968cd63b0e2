"""The same postures on the stick figure and on example-robot-data's `human`, with the same ranges.

The human's axes are the ISB's (Wu et al. 2005, J. Biomech. 38: x forward, y up, z right). Its shoulders and hips turn
in the stick figure's order, flexion, abduction, rotation: one angle stands for one angle. Its spine does not: from hips
to trunk it flexes, bends and then turns, while the stick figure does so from trunk to hips.
"""

from benchmarks.studies.two_models.angles import angles_of as angles_of
from benchmarks.studies.two_models.angles import excess as excess
from benchmarks.studies.two_models.angles import figure_limits as figure_limits
from benchmarks.studies.two_models.angles import in_human_order as in_human_order
from benchmarks.studies.two_models.angles import readings as readings
from benchmarks.studies.two_models.human import HELD_JOINTS as HELD_JOINTS
from benchmarks.studies.two_models.human import HUMAN_NAME as HUMAN_NAME
from benchmarks.studies.two_models.human import Counterpart as Counterpart
from benchmarks.studies.two_models.human import joint_columns as joint_columns
from benchmarks.studies.two_models.human import limits_of_human as limits_of_human
from benchmarks.studies.two_models.human import limits_on_human as limits_on_human
from benchmarks.studies.two_models.human import mapped_ranges as mapped_ranges
from benchmarks.studies.two_models.human import measure_counterparts as measure_counterparts
from benchmarks.studies.two_models.human import ranges_text as ranges_text
from benchmarks.studies.two_models.human import without_collision as without_collision
from benchmarks.studies.two_models.labelled import ILLEGAL_KINDS as ILLEGAL_KINDS
from benchmarks.studies.two_models.labelled import Labelled as Labelled
from benchmarks.studies.two_models.labelled import labelled_postures as labelled_postures
from benchmarks.studies.two_models.reasons import reasons as reasons
