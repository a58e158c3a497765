"""The guided calibration of a camera, in the terminal and on the page."""
