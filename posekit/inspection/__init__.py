"""What a file holds, told in lines."""

from posekit.inspection.describe import describe as describe
from posekit.inspection.inspection import inspect as inspect
