"""Any file into any other format that can hold what it says."""

from posekit.conversion.conversion import Conversion as Conversion
from posekit.conversion.conversion import convert as convert
