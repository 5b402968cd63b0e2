"""Synthetic views with true joints: of a walker, of random valid postures, and of motion capture."""

from posekit.synthesis.cameras import default_camera as default_camera
from posekit.synthesis.cameras import look_at as look_at
from posekit.synthesis.cameras import place_cameras as place_cameras
from posekit.synthesis.cameras import to_camera as to_camera
from posekit.synthesis.objects import object_document as object_document
from posekit.synthesis.objects import object_view as object_view
from posekit.synthesis.objects import random_configurations as random_configurations
from posekit.synthesis.views import builtin_view as builtin_view
from posekit.synthesis.views import forget_camera as forget_camera
from posekit.synthesis.views import mocap_view as mocap_view
from posekit.synthesis.views import mocap_views as mocap_views
from posekit.synthesis.views import random_postures as random_postures
from posekit.synthesis.views import random_views as random_views
from posekit.synthesis.views import walker_view as walker_view
from posekit.synthesis.views import with_noise as with_noise
from posekit.synthesis.walker import Walker as Walker
