"""What a mechanism looks like: one description of its shapes, plots, and a page that moves."""
