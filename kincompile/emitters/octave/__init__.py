"""Octave and MATLAB scripts."""
