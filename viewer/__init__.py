"""Pictures: postures as meshcat scenes, drawn without a server; plots; pages to be opened anywhere."""

from posekit.viewer.body import Look as Look
from posekit.viewer.body import add_posture as add_posture
from posekit.viewer.compose import Style as Style
from posekit.viewer.compose import compose as compose
from posekit.viewer.eye import Eye as Eye
from posekit.viewer.eye import ViewEye as ViewEye
from posekit.viewer.framing import fitted_eye as fitted_eye
from posekit.viewer.pictures import Shot as Shot
from posekit.viewer.pictures import write_picture as write_picture
from posekit.viewer.scene import Scene as Scene
from posekit.viewer.sight import Sight as Sight
from posekit.viewer.sight import add_sight as add_sight
from posekit.viewer.stage import add_stage as add_stage
from posekit.viewer.standalone import standalone_page as standalone_page
from posekit.viewer.studio import Studio as Studio
from posekit.viewer.subject import Subject as Subject
from posekit.viewer.subject import subject_of as subject_of
from posekit.viewer.world import World as World
from posekit.viewer.world import upright_world as upright_world
