"""Every file format: key points, motion, cameras, layouts of key points, and the files of posekit itself."""
