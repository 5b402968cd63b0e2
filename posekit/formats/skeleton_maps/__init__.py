"""Skeleton maps: which points of a format stand for which points of the body. Data (TOML), which a user can add to."""

from posekit.formats.skeleton_maps.find import find_by_names as find_by_names
from posekit.formats.skeleton_maps.find import find_by_order as find_by_order
from posekit.formats.skeleton_maps.reading import load_skeleton_map as load_skeleton_map
from posekit.formats.skeleton_maps.reading import skeleton_map_names as skeleton_map_names
from posekit.formats.skeleton_maps.reading import skeleton_map_of as skeleton_map_of
from posekit.formats.skeleton_maps.skeleton_map import LANDMARK_INDEX as LANDMARK_INDEX
from posekit.formats.skeleton_maps.skeleton_map import LANDMARK_ORDER as LANDMARK_ORDER
from posekit.formats.skeleton_maps.skeleton_map import SkeletonMap as SkeletonMap
