"""The program: kernels and instances, straight-line code, and its interpreter."""
