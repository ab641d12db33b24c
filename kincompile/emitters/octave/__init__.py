"""Functions for Octave and MATLAB."""
