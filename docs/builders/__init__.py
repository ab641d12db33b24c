"""What `make docs`, `make pictures` and `make course` write: pages, pictures, lessons."""
