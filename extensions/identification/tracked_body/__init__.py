"""The delay of the tracker's poses, and the pose of the tracked body on the vehicle."""
