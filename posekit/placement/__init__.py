"""Where the body is: the depth of the neck from the head, from the rigid torso, or searched along its ray."""
