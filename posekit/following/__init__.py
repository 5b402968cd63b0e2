"""People over many frames: detections, tracks of people, paths through recovered postures, and live tracking."""
