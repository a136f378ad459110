"""Motions of one disk: solutions, scenes, basins and the basin boundary."""
