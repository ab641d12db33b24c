"""C libraries."""
