"""Reports: documents as data and their media, formulas, pictures, and the templates they fill."""
