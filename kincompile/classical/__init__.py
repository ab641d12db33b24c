"""Classical linkages as drawings, and exact synthesis: dimensions from poses and points."""
