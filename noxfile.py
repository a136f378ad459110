"""The tests before a release: `nox`.

With the newest packages on each Python that pyproject.toml names and this machine has, and at the
lowest versions that it allows, on the oldest of these; the slow tests run once, on the newest. `nox
-s newest-3.13 -- tests/theory` runs a part, and `nox -s site` builds the site alone.
"""

import nox

PYTHONS = nox.project.python_versions(nox.project.load_toml("pyproject.toml"))
nox.options.default_venv_backend = "uv"


@nox.session(python=PYTHONS)
def newest(session: nox.Session) -> None:
    session.install(".[test]")
    session.run("pytest", *session.posargs)


@nox.session(python=PYTHONS[:1])
def floors(session: nox.Session) -> None:
    session.install("--resolution=lowest-direct", ".[test]")
    session.run("pytest", *session.posargs)


@nox.session(python=PYTHONS[-1:])
def slow(session: nox.Session) -> None:
    """All slow tests, once; build/slow.xml says which ran and how long each took."""
    session.install(".[test]")
    session.run("pytest", "-m", "slow", "--junit-xml=build/slow.xml", *session.posargs)


@nox.session
def site(session: nox.Session) -> None:
    session.install(".[docs]")
    session.run(
        "sphinx-build", "--fail-on-warning", "--keep-going", "docs", "build/site", *session.posargs
    )
