"""Motions of one disk: solutions, scenes, basins and the reduced flow."""
