"""Everything right of the wall: load an emitted module and solve the motion with it."""
