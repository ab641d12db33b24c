"""What a person writes: bodies, joints, drivers, cams, free equations."""
