"""Solutions: their columns, tables, files, plots and summaries."""
