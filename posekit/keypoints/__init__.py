"""Key points: what detectors found in pictures, in the formats that they write."""

from posekit.keypoints.keypoints import KeyPoints as KeyPoints
