"""Data: the stick figure's URDF and SRDF, and named tables of joint ranges."""
