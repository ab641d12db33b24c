"""Motions that follow from forces: consistent starts, integration, projection, events."""
