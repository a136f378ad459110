"""Any analysis over many points, on one core, all cores or a cluster: `plan` says what, `running` does it."""
