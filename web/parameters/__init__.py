"""Parameters for the page: values, changes, presets, files."""
