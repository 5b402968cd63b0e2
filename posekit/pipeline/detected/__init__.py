"""From what detectors and motion capture write to views, and from recoveries to what other programs open."""

from posekit.pipeline.detected.compare import Comparison as Comparison
from posekit.pipeline.detected.compare import compare as compare
from posekit.pipeline.detected.conversion import Conversion as Conversion
from posekit.pipeline.detected.conversion import convert as convert
from posekit.pipeline.detected.given_views import given_views as given_views
from posekit.pipeline.detected.inspection import inspect as inspect
from posekit.pipeline.detected.opening import Opened as Opened
from posekit.pipeline.detected.opening import open_views as open_views
from posekit.pipeline.detected.source import Source as Source
