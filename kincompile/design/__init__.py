"""From analysis to design: what tolerances do to a motion, and dimensions that reach targets."""
