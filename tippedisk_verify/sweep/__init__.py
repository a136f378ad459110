"""Any analysis over many points, on one core, all cores or a cluster: `plan` says what, `running` does it."""

from threading import Lock

from tippedisk_verify.fingerprint import origin

__all__ = ["code_version"]

_ONE_THREAD = Lock()  # Python 3.11 fails where several threads read source texts as syntax trees


def code_version() -> str:
    """Which code the numbers of this process come from, with the versions of the packages that compute."""
    with _ONE_THREAD:
        return ", ".join(f"{name} {version}" for name, version in origin("tippedisk_verify.sweep.plan").items())
