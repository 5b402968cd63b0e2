"""What is drawn and from where: bodies, cameras, the stage, and the eye that looks."""

from posekit.viewer.scene.compose import Style as Style
from posekit.viewer.scene.compose import compose as compose
from posekit.viewer.scene.drawn_posture import DrawnPosture as DrawnPosture
from posekit.viewer.scene.drawn_posture import Look as Look
from posekit.viewer.scene.drawn_posture import add_posture as add_posture
from posekit.viewer.scene.drawn_subject import DrawnSubject as DrawnSubject
from posekit.viewer.scene.drawn_subject import Shown as Shown
from posekit.viewer.scene.drawn_subject import subject_of as subject_of
from posekit.viewer.scene.eye import Eye as Eye
from posekit.viewer.scene.eye import ParallelEye as ParallelEye
from posekit.viewer.scene.eye import ViewEye as ViewEye
from posekit.viewer.scene.scene import Scene as Scene
from posekit.viewer.scene.world import World as World
from posekit.viewer.scene.world import upright_world as upright_world
