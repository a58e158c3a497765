"""Reports: one self-contained page, and one PDF, of any log."""
