"""How far two postures are apart: after alignment, joint by joint, angle by angle, and for a set of answers.

A point with NaN in either posture is left out, and every measure says how many were.
"""

from posekit.measures.alignment import Alignment as Alignment
from posekit.measures.alignment import align as align
from posekit.measures.angles import POSTURE_ANGLES as POSTURE_ANGLES
from posekit.measures.angles import AngleDisparity as AngleDisparity
from posekit.measures.angles import adjacent_segments as adjacent_segments
from posekit.measures.angles import angle_disparity as angle_disparity
from posekit.measures.angles import joint_angles as joint_angles
from posekit.measures.best_of import BestOf as BestOf
from posekit.measures.best_of import best_of as best_of
from posekit.measures.distances import Distance as Distance
from posekit.measures.distances import mpjpe as mpjpe
from posekit.measures.distances import pa_mpjpe as pa_mpjpe
from posekit.measures.distances import rms_distance as rms_distance
