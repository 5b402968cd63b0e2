"""Functions on vectors, quaternions, rotations, rigid alignments and distances.

Arrays are batches: vectors (..., 3), quaternions (..., 4) in Pinocchio's order x, y, z, w, rotations (..., 3, 3).
NaN marks an unknown value and propagates. A result never depends on the size of the batch.
"""

from posekit.geometry.hulls import beyond_hull as beyond_hull
from posekit.geometry.least_squares import into_bounds as into_bounds
from posekit.geometry.least_squares import smoothed as smoothed
from posekit.geometry.quaternions import median_lean as median_lean
from posekit.geometry.quaternions import quaternion_from_rotation as quaternion_from_rotation
from posekit.geometry.quaternions import quaternion_log as quaternion_log
from posekit.geometry.quaternions import quaternion_rotate as quaternion_rotate
from posekit.geometry.quaternions import rotation_from_quaternion as rotation_from_quaternion
from posekit.geometry.quaternions import shorter_quaternion as shorter_quaternion
from posekit.geometry.record import Record as Record
from posekit.geometry.record import locked as locked
from posekit.geometry.record import read_only as read_only
from posekit.geometry.rigid import Alignment as Alignment
from posekit.geometry.rigid import align as align
from posekit.geometry.rigid import best_rotation as best_rotation
from posekit.geometry.rigid import fit_rotation as fit_rotation
from posekit.geometry.rigid import known_median as known_median
from posekit.geometry.rigid import mean_known as mean_known
from posekit.geometry.rigid import mpjpe as mpjpe
from posekit.geometry.rigid import pa_mpjpe as pa_mpjpe
from posekit.geometry.rigid import rms_distance as rms_distance
from posekit.geometry.rotations import coordinate_rotation as coordinate_rotation
from posekit.geometry.rotations import cross_matrix as cross_matrix
from posekit.geometry.rotations import frame_along as frame_along
from posekit.geometry.rotations import rotation_about as rotation_about
from posekit.geometry.rotations import rotation_between as rotation_between
from posekit.geometry.rotations import rotation_from_vector as rotation_from_vector
from posekit.geometry.rotations import turned_near as turned_near
from posekit.geometry.rotations import vector_from_rotation as vector_from_rotation
from posekit.geometry.segments import segment_distance as segment_distance
from posekit.geometry.units import FARTHEST_COORDINATE as FARTHEST_COORDINATE
from posekit.geometry.units import PER_METRE as PER_METRE
from posekit.geometry.units import UNIT_WORDS as UNIT_WORDS
from posekit.geometry.units import UP_AXES as UP_AXES
from posekit.geometry.units import UP_WORDS as UP_WORDS
from posekit.geometry.units import from_metres as from_metres
from posekit.geometry.units import to_metres as to_metres
from posekit.geometry.units import up_vector as up_vector
from posekit.geometry.vectors import Array as Array
from posekit.geometry.vectors import Flags as Flags
from posekit.geometry.vectors import Ints as Ints
from posekit.geometry.vectors import cross as cross
from posekit.geometry.vectors import dot as dot
from posekit.geometry.vectors import groups as groups
from posekit.geometry.vectors import norm as norm
from posekit.geometry.vectors import numbers as numbers
from posekit.geometry.vectors import perpendicular as perpendicular
from posekit.geometry.vectors import runs as runs
from posekit.geometry.vectors import unit as unit
