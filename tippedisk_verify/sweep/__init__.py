"""Analyses at many points, on one core, all cores or a cluster.

`plan` defines a sweep, `running` carries it out.
"""
