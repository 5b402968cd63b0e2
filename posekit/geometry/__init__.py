"""Vectors, quaternions, rotations and rigid fits, each formula once.

Everything is for a batch: vectors are (..., 3), quaternions (..., 4) in Pinocchio's order x, y, z, w, rotations
(..., 3, 3). What is not known is NaN, and so is all that follows from it. Products of vectors also take the batch last,
(..., 3, N) with ``axis=-2``, as `posekit.geometry.batch_last` does throughout, because NumPy is fastest along the last
axis. Nothing here depends on how large the batch is, so a posture has the same numbers alone and among thousands.
"""

from posekit.geometry.angles import other_branch as other_branch
from posekit.geometry.angles import other_hinge as other_hinge
from posekit.geometry.angles import turned_near as turned_near
from posekit.geometry.arrays import Array as Array
from posekit.geometry.arrays import runs as runs
from posekit.geometry.quaternions import quaternion_conjugate as quaternion_conjugate
from posekit.geometry.quaternions import quaternion_exp as quaternion_exp
from posekit.geometry.quaternions import quaternion_from_rotation as quaternion_from_rotation
from posekit.geometry.quaternions import quaternion_log as quaternion_log
from posekit.geometry.quaternions import quaternion_product as quaternion_product
from posekit.geometry.quaternions import quaternion_rotate as quaternion_rotate
from posekit.geometry.quaternions import rotation_from_quaternion as rotation_from_quaternion
from posekit.geometry.quaternions import shorter_quaternion as shorter_quaternion
from posekit.geometry.rigid import best_rotation as best_rotation
from posekit.geometry.rigid import centred_covariance as centred_covariance
from posekit.geometry.rigid import fit_rotation as fit_rotation
from posekit.geometry.rotations import coordinate_rotation as coordinate_rotation
from posekit.geometry.rotations import cross_matrix as cross_matrix
from posekit.geometry.rotations import frame_along as frame_along
from posekit.geometry.rotations import relative_rotation as relative_rotation
from posekit.geometry.rotations import rotate_back as rotate_back
from posekit.geometry.rotations import rotation_about as rotation_about
from posekit.geometry.rotations import rotation_between as rotation_between
from posekit.geometry.rotations import rotation_from_vector as rotation_from_vector
from posekit.geometry.rotations import vector_from_rotation as vector_from_rotation
from posekit.geometry.vectors import cross as cross
from posekit.geometry.vectors import dot as dot
from posekit.geometry.vectors import perpendicular as perpendicular
from posekit.geometry.vectors import unit as unit
