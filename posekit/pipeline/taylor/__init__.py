"""Taylor 2000 on posekit's figure: his human completed to fourteen joints, judged, and measured."""
