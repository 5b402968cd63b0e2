"""Pictures: postures as meshcat scenes, drawn without a server; plots; pages to be opened anywhere."""

from posekit.viewer.body import Look as Look
from posekit.viewer.body import add_posture as add_posture
from posekit.viewer.eye import Eye as Eye
from posekit.viewer.eye import ViewEye as ViewEye
from posekit.viewer.scene import Scene as Scene
from posekit.viewer.sight import Sight as Sight
from posekit.viewer.sight import add_sight as add_sight
from posekit.viewer.stage import add_stage as add_stage
from posekit.viewer.standalone import standalone_page as standalone_page
from posekit.viewer.world import World as World
from posekit.viewer.world import upright_world as upright_world
