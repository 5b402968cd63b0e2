"""Key points: what detectors found in pictures, in the formats that they write."""

from posekit.keypoints.format import Format as Format
from posekit.keypoints.given import Given as Given
from posekit.keypoints.keypoints import KeyPoints as KeyPoints
from posekit.keypoints.persons import Person as Person
from posekit.keypoints.persons import choose as choose
from posekit.keypoints.persons import list_people as list_people
from posekit.keypoints.reading import chosen as chosen
from posekit.keypoints.reading import formats as formats
from posekit.keypoints.reading import is_format as is_format
from posekit.keypoints.reading import read_keypoints as read_keypoints
from posekit.keypoints.reading import suiting as suiting
from posekit.keypoints.reading import write_keypoints as write_keypoints
from posekit.keypoints.sides import SideCheck as SideCheck
from posekit.keypoints.sides import check_sides as check_sides
from posekit.keypoints.sides import swap as swap
from posekit.keypoints.tracking import track as track
