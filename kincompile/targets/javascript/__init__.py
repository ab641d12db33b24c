"""JavaScript for pages."""
