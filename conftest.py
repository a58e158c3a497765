"""Pytest finds what all tests share: those of `tests`, and those in the folders of extensions."""

pytest_plugins = ["tests.suite"]
