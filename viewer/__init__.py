"""Pictures: postures as meshcat scenes, drawn without a server; the paper's plots; pages to be opened anywhere.

`scene` says what is drawn, `browser` draws it, `pictures`, `moving` and `video` write files, `overlay` draws over
photographs and videos, `page` is the interactive page, `plots` has the paper's figures and joint angles.
"""

from posekit.viewer.pictures import Shot as Shot
from posekit.viewer.pictures import write_picture as write_picture
from posekit.viewer.scene import DrawnSubject as DrawnSubject
from posekit.viewer.scene import Eye as Eye
from posekit.viewer.scene import ParallelEye as ParallelEye
from posekit.viewer.scene import Style as Style
from posekit.viewer.scene import ViewEye as ViewEye
from posekit.viewer.scene import subject_of as subject_of
